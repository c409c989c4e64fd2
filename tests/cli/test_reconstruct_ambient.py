"""``psstereo reconstruct``: a frame to subtract, ambient light as an unknown, and colour."""

import numpy as np
import pytest

from tests.cli.capture_files import assert_one_message, read_png, save_png


@pytest.mark.parametrize("gray", ["chroma", "specular-free", "bt709"])
def test_colour_by_name(run, folder, tmp_path, plain, gray):
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--json", "--normals-only", "--gray", gray)
    assert done.code == 0
    assert done.record["normals"]["gray"] == gray
    assert (tmp_path / "out" / "normals.npy").read_bytes() != (plain / "normals.npy").read_bytes()


def test_a_wrong_colour_is_told_with_the_nearest(run, folder, tmp_path):
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--gray", "croma")
    assert_one_message(done)
    assert "Did you mean chroma?" in done.text


def test_a_frame_is_subtracted(run, folder, tmp_path, plain):
    first = next(p for p in sorted(folder.glob("*.png")) if p.name != "mask.png")
    image = read_png(first)
    frame = tmp_path / "room.png"
    save_png(frame, np.zeros_like(image))
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--json", "--normals-only", "--ambient", frame)
    assert done.code == 0
    assert "room.png is subtracted." in done.record["capture"]["notes"]
    assert done.record["normals"]["below_dark"] == 0
    # channels are added in another order
    np.testing.assert_allclose(np.load(tmp_path / "out/normals.npy"), np.load(plain / "normals.npy"), rtol=0, atol=1e-4)
    save_png(frame, np.full_like(image, 9000))
    done = run("reconstruct", folder, "-o", tmp_path / "second", "--normals-only", "--ambient", frame)
    assert done.code == 0
    assert "brighter than the photographs" in done.text
    save_png(frame, image[:-1])
    done = run("reconstruct", folder, "-o", tmp_path / "third", "--ambient", frame)
    assert_one_message(done)
    assert "room.png" in done.text
    done = run("reconstruct", folder, "-o", tmp_path / "third", "--ambient", tmp_path / "none.png")
    assert_one_message(done)


def test_the_level_as_an_unknown(run, folder, tmp_path):
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--json", "--normals-only", "--solver", "ambient")
    assert done.code == 0
    low, middle, high = done.record["normals"]["ambient_share"]
    assert low <= middle <= high < 0.2
    assert "ambient light" in {step["name"] for step in done.record["steps"]}
