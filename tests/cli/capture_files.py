"""Looking into results and changing captures on disk, for the tests of the commands."""

import json
import re
from pathlib import Path

import cv2
import numpy as np

ARRAYS = {"normals.npy", "albedo.npy", "uncertainty.npy", "flags.npy"}
PICTURES = {"normals.png", "albedo.png"}
DEPTH = {"depth.npy", "depth.png", "mesh.ply", "mesh.glb"}


def everything(folder: Path) -> dict[str, bytes]:
    """Return the content of all files below a folder, by relative name; folders have a name only."""
    return {
        str(p.relative_to(folder)): p.read_bytes() if p.is_file() else b"<folder>" for p in sorted(folder.rglob("*"))
    }


TIMED = {"run.json", "report.html"}
"""What says how long things took, and so differs from run to run."""


def results(out: Path) -> dict[str, bytes]:
    """Return the files of a result but the record, which holds times, and folders."""
    return {p.name: p.read_bytes() for p in out.iterdir() if p.is_file() and p.name not in TIMED}


def record_of(out: Path) -> dict:
    return json.loads((out / "run.json").read_text(encoding="utf-8"))


def read_png(path: Path) -> np.ndarray:
    image = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
    assert image is not None
    return image


def save_png(path: Path, image: np.ndarray) -> None:
    cv2.imencode(".png", image)[1].tofile(path)


def lights_of(folder: Path) -> np.ndarray:
    return np.loadtxt(folder / "light_directions.txt")


def write_lights(folder: Path, rows: np.ndarray, name: str = "light_directions.txt") -> None:
    np.savetxt(folder / name, rows, fmt="%.17g")


def keep_images(folder: Path, count: int) -> None:
    """Leave only the first images and their lights."""
    names = (folder / "filenames.txt").read_text().split()[:count]
    (folder / "filenames.txt").write_text("\n".join(names) + "\n")
    for name in ("light_directions.txt", "light_intensities.txt"):
        write_lights(folder, np.loadtxt(folder / name)[:count], name)


def write_capture(folder: Path, width: int, height: int, lights: int = 24) -> Path:
    """Write a colour capture without noise."""
    from psstereo.io import write_diligent
    from psstereo_synth import checker, hills, lambertian_capture, spiral

    surface = hills(width, height, steepness=2.0)
    capture, _ = lambertian_capture(surface, checker((height, width), tint=True), spiral(lights), noise=0.001)
    write_diligent(
        folder,
        images=(capture.stack.frame(i) for i in range(lights)),
        directions=capture.rig.directions,
        intensities=np.ones(lights),
        mask=surface.mask,
    )
    return folder


def assert_one_message(done, words=()):
    """Check for exit code 3 and one message of three parts."""
    assert done.code == 3
    assert done.out == ""
    # libpng itself writes what was wrong inside a picture to the process's stderr; nobody can make it silent.
    lines = [line for line in done.err.splitlines() if not line.startswith("libpng ")]
    assert len(lines) == 3, done.err
    assert lines[0].startswith("psstereo: ")
    assert all(line.startswith("  ") for line in lines[1:])
    assert all(re.search(r"\S.*[.?]$", line) for line in lines), done.err
    for word in words:
        assert word in done.err, done.err
