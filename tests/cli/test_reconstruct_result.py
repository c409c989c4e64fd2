"""``psstereo reconstruct``: what the result folder holds, and that threads and tiles do not change it."""

import os
import re
from dataclasses import dataclass

import numpy as np
import pytest

from psstereo.depth import INTEGRATORS, Poisson
from psstereo.flags import Flag, fatal_mask
from psstereo.io import read_capture
from psstereo.io.normal_map import read_normal_map
from psstereo.metrics import angular_error
from psstereo.normals import NORMAL_SOLVERS
from tests.cli.capture_files import ARRAYS, DEPTH, PICTURES, TIMED, read_png, record_of, results, write_capture


def test_a_result_holds_what_the_contract_says(run, folder, tmp_path):
    out = tmp_path / "deep" / "er" / "out"
    done = run("reconstruct", folder, "-o", out)
    assert done.code == 0
    assert done.out == ""
    assert {p.name for p in out.iterdir()} == ARRAYS | PICTURES | DEPTH | TIMED
    assert [p.name for p in out.parent.iterdir()] == ["out"]
    shapes = {
        name: (*(a := np.load(out / f"{name}.npy", allow_pickle=False)).shape, a.dtype.name)
        for name in ("normals", "albedo", "depth", "uncertainty", "flags")
    }
    assert shapes == {
        "normals": (40, 48, 3, "float32"),
        "albedo": (40, 48, "float32"),
        "depth": (40, 48, "float32"),
        "uncertainty": (40, 48, "float32"),
        "flags": (40, 48, "uint16"),
    }
    if os.name == "posix":
        mask = os.umask(0)
        os.umask(mask)
        assert out.stat().st_mode & 0o777 == 0o777 & ~mask


def test_arrays_are_nan_outside_and_flags_say_why(run, folder, tmp_path):
    run("reconstruct", folder, "-o", tmp_path / "out")
    mask = read_png(folder / "mask.png") > 0
    normals, flags = np.load(tmp_path / "out" / "normals.npy"), np.load(tmp_path / "out" / "flags.npy")
    assert np.array_equal((flags & Flag.OUTSIDE_MASK) > 0, ~mask)
    known = ~fatal_mask(flags)
    assert np.array_equal(np.isfinite(normals).all(axis=2), known)
    assert np.isnan(normals[~known]).all()
    assert np.abs(np.linalg.norm(normals[known].astype(float), axis=1) - 1).max() < 1e-6
    albedo = np.load(tmp_path / "out" / "albedo.npy")
    assert np.array_equal(np.isfinite(albedo), known)
    assert (albedo[known] > 0).all()
    assert np.isnan(np.load(tmp_path / "out" / "depth.npy")[~mask]).all()
    assert np.isnan(np.load(tmp_path / "out" / "uncertainty.npy")[~known]).all()


def test_normals_depth_and_uncertainty_are_true(run, folder, tmp_path):
    run("reconstruct", folder, "-o", tmp_path / "out")
    _, truth = read_capture(folder)
    assert truth is not None
    normals = np.load(tmp_path / "out" / "normals.npy")
    error = np.degrees(angular_error(normals.astype(float), truth.normals))
    expected = np.load(tmp_path / "out" / "uncertainty.npy")
    both = np.isfinite(error) & np.isfinite(expected)
    ratio = np.sqrt((error[both] ** 2).mean() / (expected[both] ** 2).mean())
    assert both.sum() > 900
    assert 0.6 < ratio < 1.6  # the promised root mean square is kept, in degrees
    depth = np.load(tmp_path / "out" / "depth.npy").astype(float)
    known = np.isfinite(depth)
    off = depth[known] - truth.depth[known]
    assert np.std(off) < 0.03 * np.ptp(truth.depth[known])  # up to a constant, upright and not inverted


def test_pictures_show_the_arrays(run, folder, tmp_path):
    out = tmp_path / "out"
    run("reconstruct", folder, "-o", out)
    normals = np.load(out / "normals.npy").astype(float)
    known = np.isfinite(normals[..., 0])
    colours = read_png(out / "normals.png")[..., ::-1]  # R, G, B
    assert colours.dtype == np.uint16
    assert np.abs(colours[known] / 65535 * 2 - 1 - normals[known]).max() < 2e-5  # red right, green up: OpenGL
    assert (colours[~known] == 0).all()
    assert np.nanmax(angular_error(read_normal_map(out / "normals.png").normals, normals)) < 1e-4
    depth, gray = np.load(out / "depth.npy"), read_png(out / "depth.png")
    assert gray.dtype == np.uint16
    inside = np.isfinite(depth)
    assert gray[np.unravel_index(np.nanargmax(depth), depth.shape)] == 65535  # near is bright
    assert gray[np.unravel_index(np.nanargmin(depth), depth.shape)] == 1
    assert (gray[~inside] == 0).all()
    assert np.corrcoef(gray[inside].astype(float), depth[inside])[0, 1] > 0.999999
    albedo = read_png(out / "albedo.png")
    assert albedo.dtype == np.uint8
    assert albedo.shape == (40, 48)


def test_the_mesh_is_the_surface(run, folder, tmp_path):
    import trimesh

    out = tmp_path / "out"
    run("reconstruct", folder, "-o", out)
    figures = record_of(out)["mesh"]
    for name in ("mesh.ply", "mesh.glb"):
        mesh = trimesh.load(out / name, force="mesh", process=False)
        assert len(mesh.vertices) == figures["vertices"] == int(np.isfinite(np.load(out / "depth.npy")).sum())
        assert len(mesh.faces) == figures["triangles"] > 1000
    assert mesh.face_normals[:, 2].min() > 0  # all triangles face the camera


def test_the_record_says_what_was_done(run, folder, tmp_path):
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--json", "--threads", "1")
    record = record_of(tmp_path / "out")
    assert done.record == {**record, "out": str(tmp_path / "out")}
    assert {
        "schema",
        "command",
        "capture",
        "normals",
        "depth",
        "mesh",
        "steps",
        "peak_memory_bytes",
        "versions",
    } <= set(record)
    assert record["command"] == "reconstruct"
    assert record["capture"] | {"notes": []} == {
        "name": "capture",
        "images": 8,
        "width": 48,
        "height": 40,
        "channels": 3,
        "type": "uint16",
        "camera": "orthographic",
        "lights": "light_directions.txt",
        "strength_unit": "relative",
        "notes": [],
    }
    assert record["normals"]["solver"] in NORMAL_SOLVERS
    assert record["normals"]["gate"] == "auto"
    assert record["normals"]["albedo"] == "relative"
    assert record["normals"]["light_source"] == "light_directions.txt"
    flags = np.load(tmp_path / "out" / "flags.npy")
    for name, count in record["normals"]["flags"].items():
        assert count == int(((flags & Flag[name]) > 0).sum())
    spread = np.load(tmp_path / "out" / "uncertainty.npy")
    assert record["normals"]["median_uncertainty_deg"] == pytest.approx(np.nanmedian(spread), rel=1e-5)
    depth = np.load(tmp_path / "out" / "depth.npy")
    assert record["depth"]["kind"] == "height"
    assert record["depth"]["unit"] == "px"
    assert record["depth"]["range"] == pytest.approx([np.nanmin(depth), np.nanmax(depth)], rel=1e-6)
    for step in record["steps"]:
        assert re.fullmatch(r"\S.*\.", step["reason"]), step
        assert step["seconds"] >= 0
        assert step["done"] or step["seconds"] == 0
    done = {step["name"]: step["done"] for step in record["steps"]}
    solver, depth_by = record["normals"]["solver"], record["depth"]["method"]
    models = {name: done.pop(name) for name in ("ambient solving", "robust solving", "non-Lambertian solving")}
    assert sum(models.values()) == (solver != "least-squares")
    assert done.pop("discontinuities") == (depth_by == "discontinuity")
    done.pop("compiled kernels")  # whether they pay depends on the solver
    assert done == {
        "linearisation": False,
        "dark level": False,
        "flat field": False,
        "light strengths": False,
        "near lamps": False,
        "reading": True,
        "survey": True,
        "saturation gate": True,
        "shadow gate": True,
        "observation mask": False,
        "tiling": False,
        f"normals ({solver})": True,
        "perspective": False,
        f"depth ({depth_by})": True,
        "mesh": True,
    }
    assert record["versions"].keys() >= {"python", "psstereo", "numpy"}
    assert record["peak_memory_bytes"] is None or record["peak_memory_bytes"] > 10**7


def test_a_person_is_told_what_was_used(run, folder, tmp_path):
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--integrator", "poisson")
    assert done.out == ""
    for word in ("solvers tried", "poisson", "saturation gate", "shadow gate", "expected error", "flag SHADOWED"):
        assert word in done.text
    assert f"The result is in {tmp_path / 'out'}." in done.err


def test_normals_only_leaves_depth_and_mesh_out(run, folder, tmp_path):
    run("reconstruct", folder, "-o", tmp_path / "all")
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--normals-only", "--json")
    assert {p.name for p in (tmp_path / "out").iterdir()} == ARRAYS | PICTURES | TIMED
    assert done.record["depth"] is None
    assert done.record["mesh"] is None
    assert [s["done"] for s in done.record["steps"] if s["name"] == "depth and mesh"] == [False]
    same = results(tmp_path / "all")
    assert results(tmp_path / "out") == {name: same[name] for name in ARRAYS | PICTURES}


@pytest.mark.parametrize(
    "options",
    [
        ("--threads", "1"),
        ("--threads", "2"),
        ("--threads", "7"),
    ],
)
def test_threads_and_repetition_do_not_change_a_byte(run, folder, tmp_path, options):
    assert run("reconstruct", folder, "-o", tmp_path / "one", "--threads", "1").code == 0
    for name in ("two", "again"):
        assert run("reconstruct", folder, "-o", tmp_path / name, *options).code == 0
        assert results(tmp_path / "one") == results(tmp_path / name)


def test_threads_count_in_the_memory_bound_and_reach_the_integrator(run, folder, tmp_path):
    least = []
    for threads in ("1", "30"):
        words = ("reconstruct", folder, "-o", tmp_path / threads, "--threads", threads, "--json")
        refused = run(*words, "--max-memory", "1kB").record["error"]["needed"]
        least.append(float(re.search(r"take (\d+) MB", refused)[1]))
        assert run(*words).record["depth"]["options"]["threads"] == int(threads)
    assert least[1] > 5 * least[0]


@pytest.mark.parametrize("gray", ["mean", "per-channel"])
def test_tiles_do_not_change_a_byte(run, tmp_path, gray):
    folder = write_capture(tmp_path / "capture", 260, 250)
    words = ("reconstruct", folder, "--normals-only", "--gray", gray, "--threads", "1", "--json")
    whole = run(*words, "-o", tmp_path / "whole")
    assert whole.record["normals"]["samples_in"] == "memory"
    too_small = run(*words, "-o", tmp_path / "none", "--max-memory", "1kB")
    assert too_small.code == 3
    needed = float(re.search(r"take (\d+) MB", too_small.record["error"]["needed"])[1])
    tiled = run(*words, "-o", tmp_path / "tiled", "--max-memory", f"{needed + 0.5}MB")
    assert tiled.code == 0
    assert tiled.record["normals"]["samples_in"] == "temporary file"
    assert [s["done"] for s in tiled.record["steps"] if s["name"] == "tiling"] == [True]
    assert results(tmp_path / "whole") == results(tmp_path / "tiled")


@dataclass(frozen=True, kw_only=True)
class Hasty(Poisson):
    """Gives up after one iteration."""

    max_iterations: int = 1


def test_a_run_that_did_not_converge_ends_with_4_and_keeps_its_result(run, folder, tmp_path, monkeypatch):
    monkeypatch.setitem(INTEGRATORS, "poisson", Hasty)
    poisson = ("--integrator", "poisson")
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--json", *poisson)
    assert done.code == 4
    assert done.record["depth"]["outcome"] == "not_converged"
    assert done.record["depth"]["iterations"] == 1
    assert {p.name for p in (tmp_path / "out").iterdir()} == ARRAYS | PICTURES | DEPTH | TIMED
    told = run("reconstruct", folder, "-o", tmp_path / "out2", *poisson)
    assert told.code == 4
    assert "stopped at its limit" in told.text
    assert run("reconstruct", folder, "-o", tmp_path / "out3", "--normals-only").code == 0
