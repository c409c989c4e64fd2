"""``psstereo reconstruct --prior``: depth known from elsewhere, fused with the normals, flagged or refused."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from psstereo.flags import Flag
from psstereo.io import read_capture, write_capture
from psstereo.stack import MemoryStack
from tests.cli.capture_files import assert_one_message, everything, save_png
from tests.unit.near.near_scenes import pinhole_sphere, ring, shoot


def depth_of(out):
    return np.load(out / "depth.npy").astype(float)


def test_reconstruct_fuses_a_prior(run, folder, plain, tmp_path):
    _, truth = read_capture(folder)
    heights = truth.depth + 40.0
    np.save(tmp_path / "prior.npy", heights)
    words = ("--prior", tmp_path / "prior.npy", "--prior-sigma", 0.1, "--json")
    done = run("reconstruct", folder, "-o", tmp_path / "out", *words)
    assert done.code == 0
    off = [np.abs(depth_of(out) - heights) for out in (tmp_path / "out", plain)]
    assert np.nanmax(off[0]) < 1
    assert np.nanmedian(off[1]) > 30
    step = next(step for step in done.record["steps"] if step["name"] == "prior")
    assert "known to 0.1 px" in step["reason"]
    assert any(note.startswith("prior.npy: ") for note in done.record["capture"]["notes"])
    (tmp_path / "points.txt").write_text("20 24 7.5\n")
    assert run("reconstruct", folder, "-o", tmp_path / "one", "--prior", tmp_path / "points.txt").code == 0
    moved = depth_of(tmp_path / "one") - depth_of(plain)
    assert depth_of(tmp_path / "one")[20, 24] == pytest.approx(7.5, abs=1e-5)
    assert np.nanmax(np.abs(moved - np.nanmean(moved))) < 1e-4  # one point moves the whole and bends nothing


def test_reconstruct_flags_what_a_prior_does_not_touch(run, folder, tmp_path):
    mask = cv2.imdecode(np.fromfile(folder / "mask.png", np.uint8), cv2.IMREAD_GRAYSCALE)
    mask[:, 22:25] = 0
    save_png(folder / "mask.png", mask)
    (tmp_path / "points.csv").write_text("row;col;depth\n20;15;100,5\n")
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--prior", tmp_path / "points.csv", "--json")
    assert done.code == 0
    flags, right = np.load(tmp_path / "out" / "flags.npy"), np.arange(48) >= 25
    lost = (flags & Flag.NO_DEPTH) > 0
    assert np.array_equal(lost, (mask > 0) & right)
    assert np.array_equal(np.isnan(depth_of(tmp_path / "out")), lost | (mask == 0))
    assert done.record["normals"]["flags"]["NO_DEPTH"] == lost.sum()


def test_reconstruct_refuses_a_prior_that_it_cannot_use(run, folder, tmp_path):
    np.save(tmp_path / "small.npy", np.ones((3, 3)))
    np.save(tmp_path / "fine.npy", np.ones((40, 48)))
    before = everything(tmp_path)
    for words, told in (
        (("--prior", tmp_path / "small.npy"), ("3 × 3", "48 × 40")),
        (("--prior", tmp_path / "fine.npy", "--normals-only"), ("only normals",)),
        (("--prior", tmp_path / "fine.npy", "--integrator", "frankot-chellappa"), ("frankot-chellappa", "poisson")),
        (("--prior", tmp_path / "fine.npy", "--prior-unit", "mm"), ("px",)),
        (("--prior-sigma", "1"), ("--prior",)),
    ):
        assert_one_message(run("reconstruct", folder, "-o", tmp_path / "out", *words), told)
    assert everything(tmp_path) == before


def test_reconstruct_refuses_a_prior_under_near_lamps(run, tmp_path):
    camera, depth, normals, mask = pinhole_sphere(24)
    capture = shoot(camera, depth, normals, mask, ring())
    images = np.round(np.repeat(capture.stack.read(), 3, axis=-1) * 60000).astype(np.uint16)
    write_capture(replace(capture, stack=MemoryStack(images)), tmp_path / "in", "near-ps")
    np.save(tmp_path / "prior.npy", depth)
    done = run("reconstruct", tmp_path / "in", "-o", tmp_path / "out", "--prior", tmp_path / "prior.npy")
    assert_one_message(done, ("lamps are near", "a prior depth"))
    assert not (tmp_path / "out").exists()
