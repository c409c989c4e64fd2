"""Lint, types and import contracts, run as part of the suite: one command checks everything."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def run(*words: str) -> None:
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{' '.join(words)}\n{done.stdout}\n{done.stderr}"


def script(name: str) -> str:
    beside = Path(sys.executable).parent / name
    found = str(beside) if beside.is_file() else shutil.which(name)
    assert found is not None, f"{name} is not installed; the extra 'test' brings it"
    return found


def test_ruff_finds_nothing() -> None:
    run(script("ruff"), "check", ".")


def test_code_is_formatted() -> None:
    run(script("ruff"), "format", "--check", ".")


@pytest.mark.slow
def test_mypy_strict_finds_nothing() -> None:
    run(sys.executable, "-m", "mypy")


def test_import_contracts_are_kept() -> None:
    run(script("lint-imports"))
