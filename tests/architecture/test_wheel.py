"""What is shipped: three import packages and nothing else at the top."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    words = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return next(folder.glob("*.whl"))


def test_three_packages_at_the_top(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        tops = {name.split("/")[0] for name in archive.namelist()}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"psstereo", "psstereo_synth", "psstereo_cli"}


def test_types_and_stub_are_shipped(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    assert {"psstereo/py.typed", "psstereo/__init__.pyi", "psstereo_cli/py.typed", "psstereo_synth/py.typed"} <= names
    parts = {part for name in names for part in name.split("/")}
    assert not [part for part in parts if part == "tests" or part.startswith(("test_", "conftest"))]
    assert not [name for name in names if name.endswith((".pyc", ".png"))]
    assert {"psstereo/report/page.html", "psstereo/report/style.css", "psstereo/bench/page.html"} <= set(names)


def test_contents_pass_the_checker(wheel: Path) -> None:
    checker = Path(sys.executable).parent / "check-wheel-contents"
    words = [str(checker), "--toplevel", "psstereo,psstereo_synth,psstereo_cli", str(wheel)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
