"""Captures under near lamps go through the command from the files of several makers, with metric results."""

from dataclasses import replace

import numpy as np
import pytest

from psstereo.capture import Truth
from psstereo.io import write_capture
from psstereo.stack import MemoryStack
from tests.unit.near.near_scenes import parallel_sphere, pinhole_sphere, ring, shoot


def sixteen_bits(capture):
    images = np.round(np.repeat(capture.stack.read(), 3, axis=-1) * 60000).astype(np.uint16)
    return replace(capture, stack=MemoryStack(images))


@pytest.fixture(scope="module")
def sphere():
    camera, depth, normals, mask = pinhole_sphere(32)
    capture = sixteen_bits(shoot(camera, depth, normals, mask, ring()))
    return capture, Truth(normals=normals, depth=depth), depth, mask


@pytest.mark.parametrize(("layout", "unit"), [("luces", "mm"), ("near-ps", "mm"), ("capture", "lamp units")])
def test_every_layout_with_lamps_is_solved(run, tmp_path, sphere, layout, unit):
    capture, truth, depth, mask = sphere
    write_capture(capture, tmp_path / "in", layout, truth=truth)
    done = run("reconstruct", tmp_path / "in", "-o", tmp_path / "out", "--json")
    assert done.code == 0, done.err
    record = done.record
    assert record["normals"]["solver"] == "near-lamps"
    assert record["depth"]["unit"] == unit
    assert record["depth"]["kind"] == "distance"
    assert record["depth"]["median_distance"] == pytest.approx(np.median(depth[mask]), rel=5e-3)
    rounds = record["depth"]["rounds"]
    assert rounds[-1]["energy"] < rounds[0]["energy"]
    found = np.load(tmp_path / "out" / "depth.npy")
    np.testing.assert_allclose(found[mask], depth[mask], rtol=5e-3)
    assert (tmp_path / "out" / "mesh.ply").is_file()
    assert {"normals (near-lamps)", "mesh"} <= {step["name"] for step in record["steps"]}
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert 'id="images"' in page
    assert 'id="picture-residual"' in page
    assert "The lamps, seen from the middle of the surface" in page
    assert page.count("<title>") == 1 + len(capture.rig)


def test_a_parallel_camera_of_known_pixel_size_is_solved(run, tmp_path):
    camera, depth, normals, mask = parallel_sphere(32)
    lamps = tuple(lamp.moved(np.eye(3), np.array([100.0, -100.0, 0.0])) for lamp in ring(aim=(0.0, 0.0, -650.0)))
    write_capture(sixteen_bits(shoot(camera, depth, normals, mask, lamps)), tmp_path / "in")
    done = run("reconstruct", tmp_path / "in", "-o", tmp_path / "out", "--json")
    assert done.code == 0, done.err
    assert done.record["depth"]["unit"] == "mm"
    assert np.abs(np.load(tmp_path / "out" / "depth.npy") - depth)[mask].max() < 1.0


def test_normals_only_and_a_named_solver(run, tmp_path, sphere):
    write_capture(sphere[0], tmp_path / "in", "luces", truth=sphere[1])
    done = run("reconstruct", tmp_path / "in", "-o", tmp_path / "out", "--normals-only", "--json")
    assert done.code == 0, done.err
    assert done.record["depth"] is None
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert 'id="images"' in page
    assert 'id="picture-residual"' not in page
    refused = run("reconstruct", tmp_path / "in", "-o", tmp_path / "other", "--solver", "least-squares")
    assert refused.code == 3
    assert "not a distant light" in refused.err
    assert not (tmp_path / "other").exists()


def test_a_distance_to_begin_with_is_for_near_lamps(run, tmp_path, sphere):
    write_capture(sphere[0], tmp_path / "in", "luces", truth=sphere[1])
    words = ("reconstruct", tmp_path / "in", "--normals-only", "--json", "-o")
    plain = run(*words, tmp_path / "a").record["depth"] is None and np.load(tmp_path / "a" / "normals.npy")
    guided = run(*words, tmp_path / "b", "--distance", "500")
    assert guided.code == 0, guided.err
    np.testing.assert_allclose(np.load(tmp_path / "b" / "normals.npy"), plain, rtol=0, atol=1e-3)
    for wrong, word in (("nan", "finite"), ("-1", "distance")):
        refused = run(*words, tmp_path / "c", "--distance", wrong)
        assert refused.code == 3
        assert word in refused.err.lower()
    distant = run(*words, tmp_path / "d", "--distance", "500", "--solver", "least-squares")
    assert distant.code == 3
    assert "The distance 500 is given" in distant.err


def test_three_lamps_are_refused(run, tmp_path, sphere):
    capture, truth, _, _ = sphere
    few = replace(capture, stack=MemoryStack(capture.stack.read()[:3]), rig=capture.rig.select([0, 1, 2]))
    write_capture(few, tmp_path / "in", "luces", truth=truth)
    done = run("reconstruct", tmp_path / "in", "-o", tmp_path / "out")
    assert done.code == 3
    assert "3 lamps" in done.err
    assert not (tmp_path / "out").exists()
