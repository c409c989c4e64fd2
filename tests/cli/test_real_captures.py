"""The real captures through the command, from their own files and with the published figures."""

import hashlib
from pathlib import Path

import cv2
import numpy as np
import pytest

pytestmark = pytest.mark.data

BASELINE = ("--solver", "least-squares", "--gray", "bt601", "--clip", "1", "--gate", "none", "--normals-only")

DISTANT = (
    "psm/cat",
    "psm/owl",
    "psm/chrome",
    "harvard/cat",
    "harvard/frog",
    "harvard/pig",
    "psbox_cat",
    "beethoven/Beethoven.mat",
    "beethoven/Beethoven_lights_permuted.mat",
    "face16",
    "bunny_rendered/bunny_lambert.npz",
    "bunny_rendered/bunny_lambert_noshadow.npz",
    "yale_b/yaleB01",
    "yale_b/yaleB02",
    "rendered/spot-lambert",
    "rendered/teapot-plastic",
    "rendered/sphere-near24",
    "diligent/ballPNG",
    "diligent/catPNG",
)


def digest(folder: Path) -> dict[str, tuple[int, str]]:
    """Return time stamp and checksum of every file."""
    return {
        str(p.relative_to(folder)): (p.stat().st_mtime_ns, hashlib.blake2b(p.read_bytes()).hexdigest())
        for p in sorted(folder.rglob("*"))
        if p.is_file()
    }


@pytest.fixture(scope="module", autouse=True)
def _originals_stay_untouched(data_dir):
    before = digest(data_dir)
    yield
    assert digest(data_dir) == before


def mean_error(run, capture, out, *options):
    """Reconstruct, evaluate, and return the angular figures."""
    assert run("reconstruct", capture, "-o", out, *options).code == 0
    done = run("evaluate", out, capture, "--json")
    assert done.code == 0
    return done.record["normals"]


@pytest.mark.parametrize(("name", "published"), [("ballPNG", 4.10), ("catPNG", 8.41)])
def test_the_published_baseline_is_met_and_the_defaults_beat_it(run, data_dir, tmp_path, name, published):
    capture = data_dir / "diligent" / name
    baseline = mean_error(run, capture, tmp_path / "baseline", *BASELINE)
    assert baseline["mean_deg"] == pytest.approx(published, abs=0.01)
    assert baseline["missing"] == 0
    if name == "catPNG":  # what the defaults do is looked at on the smaller object
        return
    default = mean_error(run, capture, tmp_path / "default", "--normals-only")
    assert default["mean_deg"] < baseline["mean_deg"] - 0.1
    assert default["missing"] == 0


def test_a_rendering_without_cast_shadows_is_exact(run, data_dir, tmp_path):
    capture = data_dir / "bunny_rendered" / "bunny_lambert_noshadow.npz"
    found = mean_error(run, capture, tmp_path / "out", "--normals-only")
    assert found["median_deg"] <= 0.001


def test_a_path_traced_scene_stays_below_three_degrees(run, data_dir, tmp_path):
    found = mean_error(run, data_dir / "rendered" / "spot-lambert", tmp_path / "out", "--normals-only")
    assert found["mean_deg"] < 3
    assert found["coverage"] > 0.99


@pytest.mark.parametrize("name", DISTANT)
def test_distant_lights_go_through_from_their_own_files(run, data_dir, tmp_path, name):
    least = ("--solver", "least-squares")  # files are the point here, not solvers
    done = run("reconstruct", data_dir / name, "-o", tmp_path / "out", "--normals-only", "--json", *least)
    assert done.code == 0, done.err
    normals = np.load(tmp_path / "out" / "normals.npy")
    record = done.record["normals"]
    assert normals.shape[:2] == (done.record["capture"]["height"], done.record["capture"]["width"])
    known = np.isfinite(normals).all(axis=2)
    assert known.sum() == record["pixels"] - record["pixels_lost"]
    if name == "psm/chrome":  # a mirror: most of it is black under every lamp, and the rest is not matte
        assert record["flags"]["NO_SIGNAL"] > 0.5 * record["pixels"]
        return
    assert known.sum() > 0.8 * record["pixels"]
    assert (normals[known][:, 2] > 0).mean() > 0.8  # what is seen faces the camera


def test_every_capture_of_distant_lights_is_in_the_list(run, data_dir):
    """A capture that is added to the data is added above, or said here to be of another kind."""
    other = {"hand", "near_face", "normal_maps", "stereo", "terrain"}
    tops = {p.name for p in data_dir.iterdir() if p.is_dir()} - other
    assert tops == {name.split("/")[0] for name in DISTANT}
    for group in ("psm", "harvard", "yale_b", "rendered", "diligent"):
        inside = {f"{group}/{p.name}" for p in (data_dir / group).iterdir() if p.is_dir()}
        assert inside == {name for name in DISTANT if name.startswith(f"{group}/")}


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("hand", ("no file of lights", "light", "capture.toml")),
        ("psm", ("sub-folders", "cat", "One capture at a time")),
        ("stereo/cones", ("light",)),
    ],
)
def test_what_cannot_be_solved_is_told_with_a_way_out(run, data_dir, tmp_path, name, words):
    done = run("reconstruct", data_dir / name, "-o", tmp_path / "out")
    assert done.code == 3
    assert done.out == ""
    assert len(done.err.splitlines()) == 3
    for word in words:
        assert word in done.err
    assert not list(tmp_path.iterdir())


def test_near_lamps_are_described(run, data_dir):
    done = run("info", data_dir / "near_face", "--json")
    assert done.code == 0
    assert done.record["format"] == "near-led"
    assert done.record["images"]["count"] == 7
    assert done.record["images"]["dark_image"] is True
    assert done.record["lights"]["distant"] is False


def every_second_pixel(source: Path, target: Path) -> Path:
    """Copy a capture of near lamps at half its size: in the same files, with the same lamps, a quarter of the work."""
    target.mkdir()
    for path in source.iterdir():
        if path.suffix == ".png":
            assert cv2.imwrite(str(target / path.name), cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[::2, ::2])
        elif path.name == "K.txt":
            np.savetxt(target / path.name, np.diag([0.5, 0.5, 1.0]) @ np.loadtxt(path))
        else:
            (target / path.name).write_bytes(path.read_bytes())
    return target


@pytest.mark.slow
def test_near_lamps_are_solved(run, data_dir, tmp_path):
    """From a smaller copy of the files; tests/reference/test_near.py takes all pixels."""
    small = every_second_pixel(data_dir / "near_face", tmp_path / "in")
    done = run("reconstruct", small, "-o", tmp_path / "out", "--json")
    assert done.code == 0, done.err
    assert done.record["normals"]["solver"] == "near-lamps"
    assert done.record["depth"]["unit"] == "mm"
    assert done.record["depth"]["median_distance"] == pytest.approx(700, rel=0.02)
    assert done.record["mesh"]["triangles"] > 50_000
