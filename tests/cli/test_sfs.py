"""``psstereo sfs``: one image to normals and depth, what was assumed, and what is refused."""

import numpy as np
import pytest

from psstereo.io import write_capture
from psstereo.io.pictures import write_png
from psstereo.metrics import angular_error
from psstereo_synth.problems import solver_problems
from psstereo_synth.shading_problems import shaded
from tests.cli.capture_files import assert_one_message, everything, record_of

PROBLEM = shaded("four hills", 48)
LIGHT = ("--light", "135,60")


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sfs é")
    write_png(folder / "hills.png", np.rint(60000 * PROBLEM.image.image).astype(np.uint16))
    np.save(folder / "rim.npy", PROBLEM.image.heights)
    np.save(folder / "small.npy", np.zeros((3, 3)))
    write_png(folder / "black.png", np.zeros((48, 48), np.uint16))
    (folder / "broken.png").write_bytes((folder / "hills.png").read_bytes()[:200])
    return folder


def test_a_photograph_becomes_a_result(run, given, tmp_path):
    words = ("sfs", given / "hills.png", "-o", tmp_path / "out", *LIGHT, "--albedo", 60000 / 65535)
    done = run(*words, "--heights", given / "rim.npy", "--json")
    assert done.code == 0
    assert done.err == ""
    normals = np.load(tmp_path / "out" / "normals.npy")
    assert np.degrees(np.nanmean(angular_error(normals, PROBLEM.normals))) < 2.0
    record = record_of(tmp_path / "out")
    assert record["normals"]["method"] == "variational"
    told = {one["name"]: one["basis"] for one in record["normals"]["assumptions"]}
    assert told["light"] == told["albedo"] == "given"
    assert "assumed" in told.values()
    assert {"depth.npy", "mesh.ply", "flags.npy", "normals.png"} <= {path.name for path in (tmp_path / "out").iterdir()}
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    for key in ("image", "normals", "albedo", "depth"):
        assert f'id="picture-{key}"' in page
    for one in record["normals"]["assumptions"]:
        assert f"<td>{one['name']}</td><td>{one['basis']}</td>" in page
    assert 'id="relight"' in page
    assert "http" not in page
    assert "off the view</title>" in page  # where the light stands


def test_what_is_not_given_is_estimated_and_said(run, given, tmp_path):
    done = run("sfs", given / "hills.png", "-o", tmp_path / "out", *LIGHT, "--method", "eikonal", "--no-report")
    assert done.code == 0
    assert not (tmp_path / "out" / "report.html").exists()
    assert "estimated" in done.text
    assert "brightest part" in done.text


def test_one_image_of_a_capture_is_taken_with_its_light(run, tmp_path):
    capture, _ = solver_problems(40, 32, 5)[0].make()
    write_capture(capture, tmp_path / "in", "capture")
    done = run("sfs", tmp_path / "in", "-o", tmp_path / "out", "--image", 2, "--method", "tsai-shah", "--json")
    assert done.code == 0
    direction = done.record["input"]["light_direction"]
    np.testing.assert_allclose(direction, capture.rig.directions[1], atol=1e-6)


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("hills.png",), ("no light", "--light AZ,EL")),
        (("hills.png", *LIGHT, "--image", 2), ("--image",)),
        (("hills.png", *LIGHT, "--method", "magic"), ("magic", "variational")),
        (("hills.png", *LIGHT, "--option", "smoothnes=1"), ("smoothnes",)),
        (("hills.png", "--light", "1,2,3"), ("light",)),
        (("hills.png", "--light", "eye", "--method", "pentland"), ("led", "directional")),
        (("hills.png", "--light", "1,0,0,0,0,0,0,0,0"), ("albedo", "harmonics")),
        (("hills.png", *LIGHT, "--heights", "small.npy"), ("3 × 3", "48 × 48")),
        (("hills.png", *LIGHT, "--method", "pentland", "--heights", "rim.npy"), ("known heights",)),
        (("black.png", *LIGHT), ("same brightness",)),
        (("black.png", *LIGHT, "--albedo", 1), ("Light on the surface",)),
        (("broken.png", *LIGHT), ("broken.png",)),
        (("missing.png", *LIGHT), ("missing.png", "not there")),
        ((".", *LIGHT), ("capture folder",)),
    ],
)
def test_bad_input_gets_one_message_and_leaves_nothing(run, given, words, parts):
    before = everything(given)
    placed = [given / word if str(word).endswith((".png", ".npy")) or word == "." else word for word in words]
    assert_one_message(run("sfs", *placed, "-o", given / "out"), parts)
    assert everything(given) == before
