"""Start-up: what is imported, counted in modules rather than seconds, so that the check is the same everywhere."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HEAVY = {"cv2", "scipy", "skimage", "numba", "pyrender", "trimesh", "matplotlib", "OpenEXR", "PIL", "tifffile"}


def modules_after(code: str) -> set[str]:
    """Return the top-level modules that a fresh interpreter holds after running some code."""
    paths = [str(ROOT), str(ROOT / "synth"), str(ROOT / "cli")]
    program = (
        f"import sys, json; sys.path[:0] = {paths!r}\n{code}\n"
        "sys.stdout.write('\\n' + json.dumps(sorted({name.split('.')[0] for name in sys.modules})))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout.splitlines()[-1]))


def test_importing_the_library_imports_next_to_nothing() -> None:
    loaded = modules_after("import psstereo")
    assert not loaded & (HEAVY | {"numpy"})


@pytest.mark.parametrize(
    "name", ["psstereo.io", "psstereo.normals", "psstereo.depth", "psstereo.pipeline", "psstereo_synth"]
)
def test_parts_of_the_library_leave_heavy_packages_alone(name: str) -> None:
    assert not modules_after(f"import {name}") & HEAVY


def test_help_loads_no_numerics() -> None:
    code = "import psstereo_cli.app as a\ntry:\n    a.app(['--help'])\nexcept SystemExit:\n    pass"
    assert not modules_after(code) & (HEAVY | {"numpy"})
