"""``psstereo terrain``: files in, a refined elevation out; what was assumed; errors that name the cause."""

import json

import cv2
import numpy as np
import pytest
import tifffile

from psstereo.io.elevation_file import read_elevation
from tests.unit.sfs.test_terrain import CELL, THREE, block_means, ground, render, rms

SUNS = ("--sun", "315,40", "--sun", "75,35", "--sun", "195,45")
NAMES = {
    "elevation.npy", "elevation.tif", "elevation.png", "hillshade.png", "normals.npy", "albedo.npy", "flags.npy",
    "shadows.npy", "residuals.npy", "run.json",
}  # fmt: skip


@pytest.fixture
def files(tmp_path):
    """Return truth, and a folder of a coarse elevation in three kinds of file and images in three."""
    heights, p, q = ground(48)
    images = 0.6 * render(heights, p, q, THREE, noise=0.002)
    coarse = block_means(heights, (8, 8)) + 300
    np.save(tmp_path / "dem.npy", coarse)
    np.savez(tmp_path / "dem.npz", elevation=coarse.astype(np.float32), slope=coarse)
    missing = coarse.astype(np.float32)
    missing[0, 0] = -32768
    tifffile.imwrite(tmp_path / "dem.tif", missing, extratags=[(42113, "s", 0, "-32768", True)])
    cv2.imwrite(str(tmp_path / "a.png"), np.rint(65535 * images[0]).astype(np.uint16))
    tifffile.imwrite(tmp_path / "b.tif", images[1].astype(np.float32))
    np.save(tmp_path / "c.npy", images[2])
    return heights + 300, tmp_path


def test_a_coarse_elevation_becomes_fine(run, files):
    heights, folder = files
    images = [folder / name for name in ("a.png", "b.tif", "c.npy")]
    out = folder / "out"
    cell = ("--cell", f"{CELL[0]},{CELL[1]}")
    done = run("terrain", folder / "dem.npy", *images, "-o", out, *SUNS, *cell, "--json")
    assert done.code == 0, done.err
    assert {path.name for path in out.iterdir()} == NAMES
    found = np.load(out / "elevation.npy")
    assert found.dtype == np.float32
    coarse = np.repeat(np.repeat(np.load(folder / "dem.npy"), 8, 0), 8, 1)
    assert rms(found - heights) < 0.1 * rms(coarse - heights)
    np.testing.assert_array_equal(read_elevation(out / "elevation.tif").depth, found)
    assert cv2.imread(str(out / "hillshade.png"), -1).shape == (48, 96)
    record = json.loads((out / "run.json").read_text(encoding="utf-8"))
    assert record["images"] == ["a.png", "b.tif", "c.npy"]
    assert {one["name"] for one in record["assumptions"]} >= {"suns", "reflectance", "elevation", "surroundings"}
    np.testing.assert_allclose(record["exposure"], [0.48, 0.78, 0.36], rtol=0.05)
    again = run("terrain", folder / "dem.npy", *images, "-o", out, *SUNS, *cell)
    assert again.code == 3
    assert "--overwrite" in again.text
    told = run("terrain", folder / "dem.npz", *images, "-o", out, *SUNS, *cell, "--overwrite")
    assert told.code == 0
    assert "azimuth 315.0°" in told.text
    assert "hillshade.png shows before" in told.text


def test_missing_heights_lunar_ground_and_too_few_rounds(run, files):
    _, folder = files
    words = ("--sun", "315,40", "--cell", "11", "--rounds", "1", "--reflectance", "lunar-lambert", "--json")
    done = run("terrain", folder / "dem.tif", folder / "c.npy", "-o", folder / "out", *words)
    assert done.code == 3  # the image of another sun
    assert "Image 1 does not grow brighter" in done.text
    done = run("terrain", folder / "dem.tif", folder / "a.png", "-o", folder / "out", *words)
    assert done.code == 4
    flags = done.record["terrain"]["flags"]
    assert flags["NO_ELEVATION"] == 64
    assert flags["NOT_CONVERGED"] == 48 * 48
    assert read_elevation(folder / "out" / "elevation.tif").pixel_size == 11


def test_errors_name_the_cause(run, files):
    _, folder = files
    start = ("terrain", folder / "dem.npy", folder / "a.png", "-o", folder / "out")
    for words, cause in (
        (("--sun", "315,40", "--sun", "75,35", "--cell", "10"), "2 suns are given for 1 images"),
        (("--sun", "315,-5", "--cell", "10"), "5.00° above the horizon"),
        (("--sun", "315", "--cell", "10"), "direction AZ,EL"),
        (("--sun", "315,40", "--cell", "10,0"), "above zero"),
        (("--sun", "315,40", "--cell", "1,2,3"), "or one number for both"),
        (("--sun", "315,40", "--cell", "10", "--variable", "z"), "Only .npz files"),
    ):
        done = run(*start, *words)
        assert done.code == 3
        assert cause in done.text
        assert not (folder / "out").exists()
    (folder / "cut.tif").write_bytes((folder / "dem.tif").read_bytes()[:60])
    for name, cause in (("cut.tif", "cannot be decoded"), ("none.npy", "does not exist"), ("a.png", "ends in '.png'")):
        done = run("terrain", folder / name, folder / "a.png", "-o", folder / "out", "--sun", "315,40", "--cell", "10")
        assert done.code == 3
        assert cause in done.text
