"""``psstereo reconstruct``: the result folder, every option, and what it does with input that cannot be used."""

import json
import os
import re
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from psstereo.depth import INTEGRATORS, Poisson
from psstereo.flags import Flag, fatal_mask
from psstereo.io import read_capture
from psstereo.io.normal_map import read_normal_map
from psstereo.metrics import angular_error
from psstereo_synth import hills

ARRAYS = {"normals.npy", "albedo.npy", "uncertainty.npy", "flags.npy"}
PICTURES = {"normals.png", "albedo.png"}
DEPTH = {"depth.npy", "depth.png", "mesh.ply", "mesh.glb"}


def everything(folder: Path) -> dict[str, bytes]:
    """Return the content of all files below a folder, by relative name; folders have a name only."""
    return {
        str(p.relative_to(folder)): p.read_bytes() if p.is_file() else b"<folder>" for p in sorted(folder.rglob("*"))
    }


def results(out: Path) -> dict[str, bytes]:
    """Return the files of a result but the record, which holds times."""
    return {p.name: p.read_bytes() for p in out.iterdir() if p.name != "run.json"}


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


# --- the result folder ------------------------------------------------------------------------------------------------


def test_a_result_holds_what_the_contract_says(run, folder, tmp_path):
    out = tmp_path / "deep" / "er" / "out"
    done = run("reconstruct", folder, "-o", out)
    assert done.code == 0
    assert done.out == ""
    assert {p.name for p in out.iterdir()} == ARRAYS | PICTURES | DEPTH | {"run.json"}
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
    assert record["normals"]["solver"] == "least-squares"
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
    assert {step["name"]: step["done"] for step in record["steps"]} == {
        "linearisation": False,
        "dark level": False,
        "reading": True,
        "saturation gate": True,
        "shadow gate": True,
        "tiling": False,
        "normals (least-squares)": True,
        "depth (poisson)": True,
        "mesh": True,
    }
    assert record["versions"].keys() >= {"python", "psstereo", "numpy"}
    assert record["peak_memory_bytes"] is None or record["peak_memory_bytes"] > 10**7


def test_a_person_is_told_what_was_used(run, folder, tmp_path):
    done = run("reconstruct", folder, "-o", tmp_path / "out")
    assert done.out == ""
    for word in ("least-squares", "poisson", "saturation gate", "shadow gate", "expected error", "flag SHADOWED"):
        assert word in done.text
    assert f"The result is in {tmp_path / 'out'}." in done.err


def test_normals_only_leaves_depth_and_mesh_out(run, folder, tmp_path):
    run("reconstruct", folder, "-o", tmp_path / "all")
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--normals-only", "--json")
    assert {p.name for p in (tmp_path / "out").iterdir()} == ARRAYS | PICTURES | {"run.json"}
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


def write_capture(folder: Path, width: int, height: int, lights: int = 24) -> Path:
    """Write a colour capture without noise."""
    from psstereo.io import write_diligent
    from psstereo_synth import checker, lambertian_capture, spiral

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


def test_a_run_that_did_not_converge_ends_with_4_and_keeps_its_result(run, folder, tmp_path, monkeypatch):
    monkeypatch.setitem(INTEGRATORS, "poisson", partial(Poisson, max_iterations=1))
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--json")
    assert done.code == 4
    assert done.record["depth"]["outcome"] == "not_converged"
    assert done.record["depth"]["iterations"] == 1
    assert {p.name for p in (tmp_path / "out").iterdir()} == ARRAYS | PICTURES | DEPTH | {"run.json"}
    told = run("reconstruct", folder, "-o", tmp_path / "out2")
    assert told.code == 4
    assert "stopped at its limit" in told.text
    assert run("reconstruct", folder, "-o", tmp_path / "out3", "--normals-only").code == 0


# --- options ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def plain(run, folder, tmp_path):
    """Return the default result of the capture."""
    assert run("reconstruct", folder, "-o", tmp_path / "plain").code == 0
    return tmp_path / "plain"


@pytest.mark.parametrize(
    ("options", "fact", "value"),
    [
        (("--gray", "bt601"), "gray", "bt601"),
        (("--gray", "r"), "gray", "r"),
        (("--gray", "0.5,0.25,0.25"), "gray", "0.5,0.25,0.25"),
        (("--clip", "0.2"), "clip", 0.2),
        (("--gate", "none"), "gate", "none"),
        (("--gate", "shadow"), "gate", "shadow"),
        (("--gate", "saturation"), "gate", "saturation"),
        (("--valid-range", "0.1,0.9"), "valid_range", [0.1, 0.9]),
    ],
)
def test_an_option_changes_the_normals_and_the_record(run, folder, tmp_path, plain, options, fact, value):  # noqa: PLR0917
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--json", *options)
    assert done.code == 0
    assert done.record["normals"][fact] == (pytest.approx(value) if isinstance(value, list) else value)
    assert (tmp_path / "out" / "normals.npy").read_bytes() != (plain / "normals.npy").read_bytes()


def test_gates_decide_which_observations_count(run, folder, tmp_path):
    counted = {}
    for gate in ("none", "shadow", "saturation", "auto"):
        flags = run("reconstruct", folder, "-o", tmp_path / gate, "--gate", gate, "--normals-only", "--json").record
        flags = flags["normals"]["flags"]
        counted[gate] = (flags.get("SHADOWED", 0) > 0, flags.get("UNUSABLE_SAMPLE", 0) > 0)
    assert counted == {
        "none": (False, False),
        "shadow": (True, False),
        "saturation": (False, True),
        "auto": (True, True),
    }


def test_values_beyond_the_valid_range_are_left_out(run, folder, tmp_path):
    out = tmp_path / "out"
    run("reconstruct", folder, "-o", out, "--gate", "none", "--valid-range", "0.2,0.6", "--normals-only")
    images = np.stack([read_png(p) for p in sorted(folder.glob("0*.png"))]) / 65535.0
    mask = read_png(folder / "mask.png") > 0
    beyond = ((images <= 0.2) | (images >= 0.6)).any(axis=(0, 3))
    flags = np.load(out / "flags.npy")
    assert np.array_equal((flags & Flag.UNUSABLE_SAMPLE) > 0, beyond & mask)
    left = ((images > 0.2) & (images < 0.6)).all(axis=3).sum(axis=0)
    assert np.array_equal((flags & Flag.TOO_FEW_LIGHTS) > 0, (left < 3) & mask)


def test_per_channel_gives_coloured_albedo(run, folder, tmp_path, plain):
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--gray", "per-channel", "--json")
    albedo = np.load(tmp_path / "out" / "albedo.npy")
    assert albedo.shape == (40, 48, 3)
    assert albedo.dtype == np.float32
    assert done.record["normals"]["gray"] == "per-channel"
    ratio = np.nanmedian(albedo / albedo[..., :1], axis=(0, 1))
    assert np.allclose(ratio, [1.0, 0.85, 0.7], atol=0.01)  # the tint of the painted hills
    assert read_png(tmp_path / "out" / "albedo.png").shape == (40, 48, 3)
    difference = np.degrees(angular_error(np.load(tmp_path / "out" / "normals.npy"), np.load(plain / "normals.npy")))
    assert np.nanmedian(difference) < 1


def test_masks_of_all_kinds(run, folder, tmp_path):
    mask = read_png(folder / "mask.png") > 0
    small = np.zeros_like(mask)
    small[15:25, 20:30] = True
    save_png(tmp_path / "small.png", small.astype(np.uint8) * 255)
    pixels = {}
    for choice in (None, "none", "auto", tmp_path / "small.png"):
        out = tmp_path / f"out{len(pixels)}"
        words = () if choice is None else ("--mask", choice)
        done = run("reconstruct", folder, "-o", out, "--normals-only", "--json", *words)
        assert done.code == 0
        inside = (np.load(out / "flags.npy") & Flag.OUTSIDE_MASK) == 0
        assert done.record["normals"]["pixels"] == inside.sum()
        pixels[str(choice)] = inside, done.record["capture"]["notes"]
    assert np.array_equal(pixels["None"][0], mask)
    assert pixels["none"][0].all()
    assert np.array_equal(pixels[str(tmp_path / "small.png")][0], small)
    found, notes = pixels["auto"]
    assert (found & mask).sum() / mask.sum() > 0.97
    assert (found & ~mask).sum() == 0
    assert any("found from brightness" in note for note in notes)


def test_other_lights_replace_the_folders_own(run, folder, tmp_path, plain):
    turned = lights_of(folder) * [-1, -1, 1]  # the same rig seen upside down
    write_lights(tmp_path, turned, "turned.txt")
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--lights", tmp_path / "turned.txt", "--json")
    assert done.record["normals"]["light_source"] == "turned.txt"
    assert done.record["capture"]["lights"] == "turned.txt"
    normals = np.load(tmp_path / "out" / "normals.npy")
    expected = np.load(plain / "normals.npy") * np.array([-1, -1, 1], np.float32)
    assert np.nanmax(angular_error(normals, expected)) < 1e-4
    np.save(tmp_path / "turned.npy", turned.T)
    again = run("reconstruct", folder, "-o", tmp_path / "again", "--lights", tmp_path / "turned.npy")
    assert again.code == 0
    assert (tmp_path / "again" / "normals.npy").read_bytes() == (tmp_path / "out" / "normals.npy").read_bytes()


def test_bare_images_with_lights_of_elsewhere(run, folder, tmp_path, plain):
    (tmp_path / "elsewhere.txt").write_bytes((folder / "light_directions.txt").read_bytes())
    for name in ("light_directions.txt", "light_intensities.txt", "filenames.txt", "Normal_gt.mat", "depth_gt.npz"):
        (folder / name).unlink()
    assert run("reconstruct", folder, "-o", tmp_path / "out").code == 3
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--lights", tmp_path / "elsewhere.txt")
    assert done.code == 0


def test_format_forces_a_reader(run, folder, tmp_path):
    rows = "\n".join(f"{i + 1:03d}.png " + " ".join(map(str, v)) for i, v in enumerate(lights_of(folder)))
    (folder / "lights.lp").write_text(f"8\n{rows}\n")
    normal = run("reconstruct", folder, "-o", tmp_path / "a", "--normals-only", "--json")
    forced = run("reconstruct", folder, "-o", tmp_path / "b", "--normals-only", "--json", "--format", "lp")
    assert normal.record["normals"]["light_source"] == "light_directions.txt"
    assert forced.record["normals"]["light_source"] == "lights.lp"


def test_three_times_three_lights_need_a_word(run, folder, tmp_path):
    keep_images(folder, 3)
    refused = run("reconstruct", folder, "-o", tmp_path / "out")
    assert refused.code == 3
    assert "--lights-layout" in refused.err
    rows = run("reconstruct", folder, "-o", tmp_path / "rows", "--lights-layout", "rows")
    assert rows.code == 0
    write_lights(folder, lights_of(folder).T)
    columns = run("reconstruct", folder, "-o", tmp_path / "columns", "--lights-layout", "columns")
    assert columns.code == 0
    assert results(tmp_path / "rows") == results(tmp_path / "columns")
    mixed = run("reconstruct", folder, "-o", tmp_path / "mixed", "--lights-layout", "rows")
    assert mixed.code == 3 or results(tmp_path / "mixed") != results(tmp_path / "rows")


def test_names_with_blanks_and_accents(run, folder, tmp_path, plain):
    moved = folder.rename(tmp_path / "Ein schöner Käfer (2)")
    out = tmp_path / "Ergebnis für Ä"
    assert run("reconstruct", moved, "-o", out).code == 0
    assert results(out) == results(plain)


def test_a_written_result_may_be_linked_to(run, folder, tmp_path):
    real = tmp_path / "elsewhere" / "real"
    assert run("reconstruct", folder, "-o", real).code == 0
    link = tmp_path / "link"
    try:
        link.symlink_to(real, target_is_directory=True)
    except OSError:
        pytest.skip("this system makes no links")
    assert run("reconstruct", folder, "-o", link, "--overwrite", "--gate", "none").code == 0
    assert link.is_symlink()
    assert record_of(real)["normals"]["gate"] == "none"


def test_overwriting_replaces_the_whole_result(run, folder, tmp_path, plain):
    out = tmp_path / "out"
    shutil.copytree(plain, out)
    refused = run("reconstruct", folder, "-o", out, "--normals-only")
    assert refused.code == 3
    assert "--overwrite" in refused.err
    assert everything(out) == everything(plain)
    assert run("reconstruct", folder, "-o", out, "--normals-only", "--overwrite").code == 0
    assert {p.name for p in out.iterdir()} == ARRAYS | PICTURES | {"run.json"}  # no depth of the earlier run stays
    assert run("reconstruct", folder, "-o", out, "--overwrite").code == 0
    assert results(out) == results(plain)


def test_an_empty_folder_may_be_filled(run, folder, tmp_path):
    (tmp_path / "out").mkdir()
    assert run("reconstruct", folder, "-o", tmp_path / "out").code == 0
    assert (tmp_path / "out" / "run.json").is_file()


# --- names and numbers that nobody knows ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--solver", "least-sqares"), ("least-sqares", "Did you mean least-squares?")),
        (("--integrator", "poison"), ("poison", "Did you mean poisson?")),
        (("--integrator", "poison", "--normals-only"), ("poison", "Did you mean poisson?")),
        (("--gate", "shadw"), ("shadw", "none, shadow, saturation, auto", "Did you mean shadow?")),
        (("--gray", "bt602"), ("bt602", "mean, bt601, r, g, b, per-channel", "Did you mean bt601?")),
        (("--gray", "1,2"), ("1.0, 2.0", "3 channels")),
        (("--gray", "1,x,2"), ("1,x,2",)),
        (("--gray", "0,0,0"), ("not all zero",)),
        (("--format", "dilignt"), ("dilignt", "capture, diligent", "Did you mean diligent?")),
        (("--lights-layout", "row"), ("row", "rows (one light a row) or columns")),
        (("--lights", "no such file.txt"), ("no such file.txt",)),
        (("--mask", "no such mask.png"), ("no such mask.png",)),
        (("--clip", "0"), ("clip is 0", "above zero")),
        (("--clip", "nan"), ("clip is nan", "above zero")),
        (("--valid-range", "0.9,0.1"), ("0.9 to 0.1", "below")),
        (("--valid-range", "nan,1"), ("nan",)),
        (("--valid-range", "0.1"), ("0.1", "2 numbers")),
        (("--max-memory", "plenty"), ("plenty", "500MB")),
        (("--max-memory", "-3MB"), ("-3MB", "500MB")),
        (("--max-memory", "1kB"), ("memory limit", "MB even in tiles")),
    ],
)
def test_unknown_words_are_told_with_the_known_ones(run, folder, tmp_path, options, words):
    before = everything(tmp_path)
    done = run("reconstruct", folder, "-o", tmp_path / "out", *options)
    assert_one_message(done, words)
    assert everything(tmp_path) == before


# --- input that cannot be used ----------------------------------------------------------------------------------------


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


def missing_image(folder):
    (folder / "003.png").unlink()


def truncated_image(folder):
    data = (folder / "003.png").read_bytes()
    (folder / "003.png").write_bytes(data[: len(data) // 2])


def truncated_by_a_little(folder):
    data = (folder / "003.png").read_bytes()
    (folder / "003.png").write_bytes(data[:-6])


def corrupt_image(folder):
    data = bytearray((folder / "003.png").read_bytes())
    middle = len(data) // 2
    data[middle : middle + 16] = bytes(b ^ 0xFF for b in data[middle : middle + 16])
    (folder / "003.png").write_bytes(bytes(data))


def corrupt_first_image(folder):
    corrupt_image_data = bytearray((folder / "001.png").read_bytes())
    corrupt_image_data[200:216] = bytes(16)
    (folder / "001.png").write_bytes(bytes(corrupt_image_data))


def empty_image(folder):
    (folder / "003.png").write_bytes(b"")


def text_as_image(folder):
    (folder / "003.png").write_text("This is no picture.")


def other_size(folder):
    save_png(folder / "003.png", read_png(folder / "003.png")[:-1])


def other_depth(folder):
    save_png(folder / "003.png", (read_png(folder / "003.png") // 257).astype(np.uint8))


def other_channels(folder):
    save_png(folder / "003.png", read_png(folder / "003.png")[..., 0])


def two_lights(folder):
    keep_images(folder, 2)


def one_light(folder):
    keep_images(folder, 1)


def coplanar_lights(folder):
    rows = lights_of(folder)
    rows[:, 1] = 0.25 * rows[:, 0]
    write_lights(folder, rows)


def equal_lights(folder):
    write_lights(folder, np.repeat(lights_of(folder)[:1], 8, axis=0))


def zero_light(folder):
    rows = lights_of(folder)
    rows[4] = 0
    write_lights(folder, rows)


def nan_light(folder):
    rows = lights_of(folder)
    rows[4, 1] = np.nan
    write_lights(folder, rows)


def infinite_light(folder):
    rows = lights_of(folder)
    rows[4, 1] = np.inf
    write_lights(folder, rows)


def zero_strength(folder):
    rows = np.loadtxt(folder / "light_intensities.txt")
    rows[4] = 0
    write_lights(folder, rows, "light_intensities.txt")


def black_images(folder):
    for path in folder.glob("0*.png"):
        save_png(path, np.zeros((40, 48, 3), np.uint16))


def one_black_image(folder):
    save_png(folder / "003.png", np.zeros((40, 48, 3), np.uint16))


def empty_mask(folder):
    save_png(folder / "mask.png", np.zeros((40, 48), np.uint8))


def other_mask(folder):
    save_png(folder / "mask.png", np.full((48, 40), 255, np.uint8))


def damaged_mask(folder):
    (folder / "mask.png").write_bytes((folder / "mask.png").read_bytes()[:60])


def too_few_lights(folder):
    write_lights(folder, lights_of(folder)[:7])


def too_many_lights(folder):
    write_lights(folder, np.vstack([lights_of(folder), [[0, 0, 1]]]))


def too_few_strengths(folder):
    write_lights(folder, np.loadtxt(folder / "light_intensities.txt")[:7], "light_intensities.txt")


def name_taken_out(folder):
    names = (folder / "filenames.txt").read_text().split()
    (folder / "filenames.txt").write_text("\n".join(names[:-1]) + "\n")


def binary_lights(folder):
    (folder / "light_directions.txt").write_bytes(bytes(range(256)) * 4)


def word_in_lights(folder):
    lines = (folder / "light_directions.txt").read_text().splitlines()
    lines[5] = "0.1 oops 0.9"
    (folder / "light_directions.txt").write_text("\n".join(lines) + "\n")


def short_row(folder):
    lines = (folder / "light_directions.txt").read_text().splitlines()
    lines[5] = "0.1 0.9"
    (folder / "light_directions.txt").write_text("\n".join(lines) + "\n")


def empty_lights(folder):
    (folder / "light_directions.txt").write_text("")


def no_lights(folder):
    for name in ("light_directions.txt", "light_intensities.txt", "filenames.txt"):
        (folder / name).unlink()


def empty_folder(folder):
    shutil.rmtree(folder)
    folder.mkdir()


def no_folder(folder):
    shutil.rmtree(folder)


def file_as_folder(folder):
    shutil.rmtree(folder)
    folder.write_text("just a file")


def folder_of_captures(folder):
    inner = folder / "inner"
    inner.mkdir()
    for path in [p for p in folder.iterdir() if p.is_file()]:
        path.rename(inner / path.name)


def toml(text):
    def spoil(folder):
        (folder / "capture.toml").write_text(text)

    return spoil


BAD = {
    "missing image": (missing_image, ("003.png",)),
    "truncated image": (truncated_image, ("003.png",)),
    "image without its end": (truncated_by_a_little, ("003.png",)),
    "corrupt image": (corrupt_image, ("003.png",)),
    "corrupt first image": (corrupt_first_image, ("001.png",)),
    "empty image": (empty_image, ("003.png", "empty")),
    "text as image": (text_as_image, ("003.png",)),
    "other size": (other_size, ("003.png", "48 × 39", "48 × 40", "001.png")),
    "other depth": (other_depth, ("003.png", "8 bit", "16 bit")),
    "other channels": (other_channels, ("003.png", "1 channel", "3 channels")),
    "two lights": (two_lights, ("2 lights", "Three or more")),
    "one light": (one_light, ("1 light", "Three or more")),
    "coplanar lights": (coplanar_lights, ("one plane",)),
    "equal lights": (equal_lights, ("one plane",)),
    "zero light": (zero_light, ("light_directions.txt", "Light 5", "zero")),
    "nan light": (nan_light, ("light_directions.txt", "Light 5", "nan")),
    "infinite light": (infinite_light, ("light_directions.txt", "Light 5", "inf")),
    "zero strength": (zero_strength, ("light_intensities.txt", "Light 5")),
    "black images": (black_images, ("All images are black",)),
    "one black image": (one_black_image, ("003.png", "black")),
    "empty mask": (empty_mask, ("mask.png", "empty")),
    "other mask": (other_mask, ("mask.png", "40 × 48", "48 × 40")),
    "damaged mask": (damaged_mask, ("mask.png",)),
    "too few lights": (too_few_lights, ("light_directions.txt", "7", "8 images")),
    "too many lights": (too_many_lights, ("light_directions.txt", "9", "8 images")),
    "too few strengths": (too_few_strengths, ("light_intensities.txt", "7", "8 images")),
    "too few names": (name_taken_out, ("8", "7 images")),
    "binary lights": (binary_lights, ("light_directions.txt",)),
    "word in the lights": (word_in_lights, ("Line 6", "light_directions.txt", "oops")),
    "short row of lights": (short_row, ("Line 6", "light_directions.txt", "0.1 0.9")),
    "empty lights": (empty_lights, ("light_directions.txt",)),
    "no lights": (no_lights, ("light directions", "capture.toml")),
    "empty folder": (empty_folder, ("0 images", "no file of lights")),
    "no folder": (no_folder, ("does not exist",)),
    "file as folder": (file_as_folder, ("file",)),
    "folder of captures": (folder_of_captures, ("inner",)),
    "unknown key": (
        toml('[images]\npattern = "0*.png"\n[lights]\ndirectons = "light_directions.txt"\n'),
        ("directons", "directions", "capture.toml"),
    ),
    "no toml": (toml("[images\n"), ("capture.toml", "TOML")),
    "toml without lights": (toml('[images]\npattern = "0*.png"\n'), ("no lights",)),
    "toml with a wrong type": (toml("[images]\npattern = 7\n[lights]\nangles = [[0, 60]]\n"), ("pattern",)),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_told_once_and_leaves_nothing(run, folder, tmp_path, case):
    spoil, words = BAD[case]
    spoil(folder)
    before = everything(tmp_path)
    assert_one_message(run("reconstruct", folder, "-o", tmp_path / "out"), words)
    assert everything(tmp_path) == before


@pytest.mark.parametrize("case", BAD)
def test_an_earlier_result_survives_bad_input(run, folder, tmp_path, plain, case):
    BAD[case][0](folder)
    before = everything(tmp_path)
    assert_one_message(run("reconstruct", folder, "-o", plain, "--overwrite"))
    assert everything(tmp_path) == before


@pytest.mark.parametrize("case", ["two lights", "corrupt image", "no folder"])
def test_machines_are_told_too(run, folder, tmp_path, case):
    BAD[case][0](folder)
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--json")
    assert done.code == 3
    error = done.record["error"]
    assert set(error) == {"kind", "given", "needed", "remedy"}
    assert done.err.endswith(f"psstereo: {error['given']}\n  {error['needed']}\n  {error['remedy']}\n")


def test_bad_input_is_told_on_many_threads_and_in_tiles(run, folder, tmp_path):
    corrupt_image(folder)
    before = everything(tmp_path)
    for options in (("--threads", "4"), ("--max-memory", "9MB"), ("--mask", "auto")):
        assert_one_message(run("reconstruct", folder, "-o", tmp_path / "out", *options), ("003.png",))
    assert everything(tmp_path) == before


# --- places where no result can go ------------------------------------------------------------------------------------


@pytest.mark.parametrize("overwrite", [(), ("--overwrite",)])
@pytest.mark.parametrize(
    "place", ["notes", "photos with run.json", "result with more in it", "capture", "file", "in a file"]
)
def test_what_is_no_result_is_never_replaced(run, folder, tmp_path, plain, overwrite, place):  # noqa: PLR0917
    out = tmp_path / "precious"
    if place == "notes":
        out.mkdir()
        (out / "notes.txt").write_text("ten years of work")
    elif place == "photos with run.json":
        out.mkdir()
        (out / "run.json").write_text("{}")
        (out / "model.bin").write_bytes(b"ten years of work")
    elif place == "result with more in it":
        shutil.copytree(plain, out)
        (out / "thesis").mkdir()
        (out / "thesis" / "chapter 1.txt").write_text("ten years of work")
    elif place == "capture":
        out = folder
    else:
        out.write_text("ten years of work")
        out = out / "below" / "out" if place == "in a file" else out
    before = everything(tmp_path)
    assert_one_message(
        run("reconstruct", folder, "-o", out, *overwrite), ("-o", "precious" if out != folder else "capture")
    )
    assert everything(tmp_path) == before


def test_a_place_that_cannot_be_written_to(run, folder, tmp_path, monkeypatch):
    from psstereo.io import atomic

    def refuse(**_keywords):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(atomic.tempfile, "mkdtemp", refuse)
    done = run("reconstruct", folder, "-o", tmp_path / "out")
    assert_one_message(done, (str(tmp_path), "Permission denied", "-o"))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_disk_that_is_full_leaves_nothing_and_takes_nothing(run, folder, tmp_path, monkeypatch, plain, overwrite):  # noqa: PLR0917
    from psstereo.io import result_folder

    def full(*_arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(result_folder, "write_mesh", full)
    before = everything(tmp_path)
    out, more = (plain, ("--overwrite",)) if overwrite else (tmp_path / "out", ())
    assert_one_message(run("reconstruct", folder, "-o", out, *more), ("No space left on device",))
    assert everything(tmp_path) == before


def test_the_photographs_stay_as_they_are(run, folder, tmp_path):
    before = everything(folder)
    assert run("reconstruct", folder, "-o", tmp_path / "out").code == 0
    assert run("reconstruct", folder, "-o", folder / "out").code == 0
    after = {k: v for k, v in everything(folder).items() if not k.startswith("out")}
    assert after == before


def test_options_of_the_library_default_to_those_of_the_command(folder, tmp_path, plain):
    from psstereo.pipeline import reconstruct

    capture, _ = read_capture(folder)
    result = reconstruct(capture)
    assert np.array_equal(np.load(plain / "normals.npy"), result.normals.normals.astype(np.float32), equal_nan=True)
    assert result.depth is not None
    assert np.array_equal(np.load(plain / "depth.npy"), result.depth.depth.astype(np.float32), equal_nan=True)
    assert replace(result, depth=None).converged
