"""``psstereo integrate``: normal maps of any origin to depth, with or without a prior."""

import cv2
import numpy as np
import pytest

from psstereo.camera import Pinhole
from psstereo.depth import INTEGRATORS
from psstereo.flags import Flag
from psstereo.io import read_elevation, write_normal_map
from psstereo.io.mat_file import write_mat
from psstereo.io.result_folder import read_result
from psstereo_synth import hills
from tests.cli.capture_files import DEPTH, assert_one_message, everything, record_of, results, save_png

FILES = DEPTH | {"normals.npy", "normals.png", "flags.npy", "elevation.tif", "run.json", "report.html"}
SURFACE = hills(48, 40, steepness=1.0)
HEIGHT = np.where(SURFACE.mask, SURFACE.height, np.nan)
NORMALS = np.where(SURFACE.mask[..., None], SURFACE.normals, np.nan)
K = np.array([[300.0, 0.0, 23.5], [0.0, 310.0, 19.5], [0.0, 0.0, 1.0]])


@pytest.fixture
def given(tmp_path):
    """Normals of hills, their mask, and a plane before a pinhole 500 mm away with its K."""
    write_normal_map(NORMALS, tmp_path / "n é.png")
    save_png(tmp_path / "mask.png", SURFACE.mask.astype(np.uint8) * 255)
    np.savetxt(tmp_path / "K.txt", K)
    rays = Pinhole.from_matrix(K).rays(HEIGHT.shape)
    tilt = np.array([0.2, -0.1, 1.0])
    np.save(tmp_path / "plane.npy", np.broadcast_to(tilt, rays.shape).astype(np.float32))
    np.save(tmp_path / "distance.npy", -500.0 / (rays @ tilt))
    return tmp_path


def depth_of(out):
    return np.load(out / "depth.npy").astype(float)


# --- what comes out ---------------------------------------------------------------------------------------------------


def test_a_result_holds_what_the_contract_says(run, given):
    out = given / "deep" / "out"
    done = run("integrate", given / "n é.png", "-o", out, "--mask", given / "mask.png", "--pixel-size", 0.1, "--json")
    assert done.code == 0
    assert done.err == ""
    assert {p.name for p in out.iterdir()} == FILES
    assert [p.name for p in out.parent.iterdir()] == ["out"]
    assert done.record == {**record_of(out), "out": str(out)}
    depth = depth_of(out)
    assert np.array_equal(np.isfinite(depth), SURFACE.mask)
    assert np.nanmax(np.abs(depth - 0.1 * (HEIGHT - np.nanmean(HEIGHT)))) < 0.02  # upright, in mm
    saved = read_result(out)
    assert np.array_equal(np.isnan(saved.normals).any(axis=2), ~SURFACE.mask)
    flags = np.load(out / "flags.npy")
    assert flags.dtype == np.uint16
    assert np.array_equal(flags, np.where(SURFACE.mask, 0, Flag.OUTSIDE_MASK))
    record = done.record
    assert record["command"] == "integrate"
    assert record["input"]["camera"] == {"name": "orthographic", "pixel_size": 0.1, "unit": "mm"}
    assert record["input"]["warnings"] == []
    assert record["depth"]["unit"] == "mm"
    assert record["depth"]["free_constants"]["kind"] == "offset"
    assert record["mesh"]["vertices"] == SURFACE.mask.sum()
    assert {step["name"]: step["done"] for step in record["steps"]} == {
        "reading": True,
        "weights": False,
        "prior": False,
        "depth (poisson)": True,
        "mesh": True,
    }


def test_the_report_has_pictures_and_says_what_stays_free(run, given):
    words = ("integrate", given / "n é.png", "--mask", given / "mask.png", "--relief", "0,4", "--curvature", 1)
    done = run(*words, "-o", given / "reported", "--convention", "directx")
    assert done.code == 0
    page = (given / "reported" / "report.html").read_text(encoding="utf-8")
    for key in ("normals", "depth", "relief", "curvature", "flags"):
        assert f'id="picture-{key}"' in page
    assert 'id="picture-albedo"' not in page  # nobody knows it, and the canvas says so
    assert "the albedo being unknown" in page
    assert "depth (poisson)" in page
    assert record_of(given / "reported")["depth"]["free_constants"]["sentence"] in page
    assert "Green seems to run the other way" in page
    assert "http" not in page
    assert run(*words, "-o", given / "bare", "--no-report").code == 0
    assert not (given / "bare" / "report.html").exists()


def test_a_person_is_told_what_was_used_and_what_stays_free(run, given):
    done = run("integrate", given / "n é.png", "-o", given / "out")
    assert (done.code, done.out) == (0, "")
    for word in ("n é.png", "poisson", "The height offset of the component is free", "height [px]", "flag NO_DEPTH"):
        assert word in done.text
    assert "warning" not in done.text
    relative = run("integrate", given / "plane.npy", "-o", given / "relative", "--K", given / "K.txt")
    assert "The distance scale of the component is free" in relative.text
    assert f"The result is in {given / 'relative'}." in relative.err


def test_every_kind_of_file_and_frame_gives_the_same(run, given):
    assert run("integrate", given / "n é.png", "-o", given / "png").code == 0
    write_normal_map(NORMALS, given / "n.exr", convention="directx")
    write_normal_map(NORMALS, given / "n.tif", convention="opencv")
    np.savez(given / "two.npz", n=NORMALS, other=NORMALS[..., ::-1])
    write_mat(given / "gt.mat", {"Normal_gt": np.nan_to_num(NORMALS), "other": np.nan_to_num(NORMALS)})
    bytes_ = np.where(SURFACE.mask[..., None], np.round((SURFACE.normals + 1) * 127.5), 0).astype(np.uint8)
    save_png(given / "eight.png", bytes_[..., ::-1])
    for name, words in (
        ("n.exr", ("--convention", "directx")),
        ("n.tif", ("--convention", "opencv")),
        ("two.npz", ("--variable", "n")),
        ("gt.mat", ()),
        ("eight.png", ()),
    ):
        done = run("integrate", given / name, "-o", given / f"out {name}", *words, "--json")
        assert done.code == 0, name
        assert done.record["input"]["warnings"] == [], name
        off = np.nanmax(np.abs(depth_of(given / f"out {name}") - depth_of(given / "png")))
        assert off < (0.1 if name == "eight.png" else 2e-3), name


@pytest.mark.parametrize("convention", ["opengl", "directx"])
def test_a_map_of_the_other_green_convention_is_told_and_not_flipped(run, given, convention):
    other = {"opengl": "directx", "directx": "opengl"}[convention]
    write_normal_map(NORMALS, given / "n.exr", convention=other)
    done = run("integrate", given / "n.exr", "-o", given / "out", "--convention", convention)
    assert done.code == 0
    assert f"try --convention {other}" in done.text
    (warning,) = record_of(given / "out")["input"]["warnings"]
    assert "Nothing was flipped" in warning
    assert "curl falls from" in warning
    saved = np.load(given / "out" / "normals.npy")
    np.testing.assert_allclose(saved, NORMALS * [1, -1, 1], atol=1e-6)


def test_a_matrix_of_another_crop_is_told(run, given):
    done = run("integrate", given / "plane.npy", "-o", given / "out", "--K", "300,310,100,19.5")
    assert done.code == 0
    assert "principal point (100.0, 19.5) lies outside the 48 × 40 pixels" in done.text
    assert len(record_of(given / "out")["input"]["warnings"]) == 1


def test_a_pinhole_with_its_distance(run, given):
    truth = np.load(given / "distance.npy")
    matrices = {"file": given / "K.txt", "words": "300,310,23.5,19.5"}
    for name, matrix in matrices.items():
        words = ("--K", matrix, "--distance", float(np.median(truth)), "--json")
        done = run("integrate", given / "plane.npy", "-o", given / name, *words)
        assert done.code == 0
        assert np.abs(depth_of(given / name) / truth - 1).max() < 1e-6
        assert done.record["input"]["camera"] == {"name": "pinhole", "K": K.tolist()}
        assert done.record["depth"]["kind"] == "distance"
        assert done.record["depth"]["unit"] == "mm"
        assert done.record["depth"]["free_constants"]["kind"] == "none"
    picture = cv2.imdecode(np.fromfile(given / "file" / "depth.png", np.uint8), cv2.IMREAD_UNCHANGED)
    assert picture[np.unravel_index(truth.argmin(), truth.shape)] == 65535  # near is bright


def test_priors_of_all_kinds_settle_the_scale(run, given):
    truth = np.load(given / "distance.npy")
    np.save(given / "map.npy", truth.astype(np.float32))
    cv2.imencode(".png", np.round(truth * 100).astype(np.uint16))[1].tofile(given / "steps.png")
    (given / "points.txt").write_text(f"row col depth\n5 7 {truth[5, 7]:.9f}\n30 40 {truth[30, 40]:.9f}\n")
    for name, words in (
        ("map.npy", ("--prior-sigma", 0.5)),
        ("steps.png", ("--prior-unit", "0.01mm")),
        ("points.txt", ("--prior-unit", "mm", "--prior-sigma", 0.1)),
    ):
        out = given / f"out {name}"
        more = ("--K", given / "K.txt", "--prior", given / name, *words, "--json")
        done = run("integrate", given / "plane.npy", "-o", out, *more)
        assert done.code == 0, done.err
        assert np.abs(depth_of(out) - truth).max() < 0.003, name
        assert done.record["depth"]["unit"] == "mm"
        assert "prior settles" in done.record["depth"]["free_constants"]["sentence"]
        assert any(name in note for note in done.record["input"]["notes"])
        assert [s["done"] for s in done.record["steps"] if s["name"] == "prior"] == [True]


def test_weights_change_the_depth_and_infinite_ones_leave_out(run, given):
    degrees = np.linspace(0.1, 20.0, HEIGHT.size).reshape(HEIGHT.shape)
    degrees[20, 24] = np.inf
    np.save(given / "u.npy", degrees)
    write_normal_map(NORMALS + np.random.default_rng(2).normal(0, 0.1, NORMALS.shape), given / "noisy.npy")
    plain = run("integrate", given / "noisy.npy", "-o", given / "plain")
    done = run("integrate", given / "noisy.npy", "-o", given / "out", "--weights", given / "u.npy", "--json")
    assert plain.code == done.code == 0
    assert np.nanmax(np.abs(depth_of(given / "out") - depth_of(given / "plain"))) > 0.05
    assert done.record["depth"]["left_out"]["zero_weight"] == 1
    assert np.load(given / "out" / "flags.npy")[20, 24] == Flag.NO_DEPTH
    assert np.isfinite(np.load(given / "out" / "normals.npy")[20, 24]).all()


def test_holes_are_counted_and_flagged(run, given):
    holes = NORMALS.copy()
    holes[18:20, 20:23], holes[25, 25] = 0.0, np.nan
    np.save(given / "holes.npy", holes)
    done = run("integrate", given / "holes.npy", "-o", given / "out", "--mask", given / "mask.png")
    assert done.code == 0
    assert "left out: no normal 7 pixels" in done.text
    assert "flag NO_DEPTH 7 pixels" in done.text
    assert record_of(given / "out")["depth"]["left_out"]["no_normal"] == 7
    flags = np.load(given / "out" / "flags.npy")
    assert np.array_equal((flags & Flag.NO_DEPTH) > 0, SURFACE.mask & ~(np.abs(holes).sum(axis=2) > 0))
    assert np.array_equal(np.isnan(depth_of(given / "out")), flags != 0)


def test_integrators_and_their_options(run, given):
    told = run("integrate", "--help").out
    assert all(name in told for name in INTEGRATORS)
    done = run(
        "integrate", given / "n é.png", "-o", given / "out", "--integrator", "discontinuity", "--option", "rounds=2",
        "--threads", "1", "--json",
    )  # fmt: skip
    assert done.code == 0
    assert done.record["depth"]["method"] == "discontinuity"
    assert done.record["depth"]["options"]["rounds"] == 2
    assert done.record["depth"]["options"]["threads"] == 1


def test_threads_do_not_change_a_byte_and_results_are_replaced_when_asked(run, given):
    for name, threads in (("one", 1), ("two", 3), ("two", 2)):
        words = ("--threads", threads, *(("--overwrite",) if (given / name).exists() else ()))
        assert run("integrate", given / "n é.png", "-o", given / name, *words).code == 0
    assert results(given / "one") == results(given / "two")
    again = run("integrate", given / "n é.png", "-o", given / "one")
    assert_one_message(again, ("--overwrite",))


def test_a_run_that_did_not_converge_ends_with_4_and_keeps_its_result(run, given):
    done = run("integrate", given / "n é.png", "-o", given / "out", "--option", "max_iterations=1", "--json")
    assert done.code == 4
    assert done.record["depth"]["outcome"] == "not_converged"
    assert {p.name for p in (given / "out").iterdir()} == FILES


def test_relief_and_curvature_are_written_when_asked_for(run, given):
    out = given / "derived"
    words = ("--mask", given / "mask.png", "--pixel-size", 0.5, "--relief", "0,4", "--curvature", 1)
    done = run("integrate", given / "n é.png", "-o", out, *words)
    assert done.code == 0
    assert {p.name for p in out.iterdir()} == FILES | {"relief.tif", "relief.png", "curvature.npz", "curvature.png"}
    relief, elevation = read_elevation(out / "relief.tif"), read_elevation(out / "elevation.tif")
    assert (relief.unit, relief.pixel_size) == ("mm", 0.5)
    np.testing.assert_array_equal(elevation.depth, np.load(out / "depth.npy"))
    assert np.nanstd(relief.depth) < 0.5 * np.nanstd(elevation.depth)  # the coarse shape is gone
    with np.load(out / "curvature.npz", allow_pickle=False) as bent:
        assert str(bent["unit"]) == "1/mm"
        assert np.isfinite(bent["mean"]).sum() > 0.9 * SURFACE.mask.sum()
        assert (bent["largest"] >= bent["smallest"])[np.isfinite(bent["mean"])].all()


def test_a_map_beyond_the_bound_of_memory_is_integrated_in_tiles(run, tmp_path):
    surface = hills(700, 500, steepness=1.0)
    np.save(tmp_path / "n.npy", np.where(surface.mask[..., None], surface.normals, np.nan))
    done = run("integrate", tmp_path / "n.npy", "-o", tmp_path / "out", "--max-memory", "25MB", "--json")
    assert done.code == 0
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"depth.npy", "components.npy", "run.json"}
    error = (depth_of(tmp_path / "out") - surface.height)[surface.mask]
    assert np.std(error) < 0.02
    assert "tiles" in done.record["steps"][0]["reason"]
    for words, told in (
        (("--integrator", "l1"), ("l1", "Poisson")),
        (("--convention", "directx"), ("directx",)),
        (("--mask", tmp_path / "m.png"), ("--mask",)),
    ):
        assert_one_message(
            run("integrate", tmp_path / "n.npy", "-o", tmp_path / "x", "--max-memory", "25MB", *words), told
        )
    assert_one_message(run("integrate", tmp_path / "n.png", "-o", tmp_path / "x", "--max-memory", "1MB"), (".npy",))


# --- what cannot be used ----------------------------------------------------------------------------------------------


def spoil(folder):
    """Write all kinds of unusable files."""
    np.save(folder / "away.npy", NORMALS * [1, 1, -1])
    np.save(folder / "zero.npy", np.zeros_like(NORMALS))
    save_png(folder / "small.png", np.full((10, 12), 255, np.uint8))
    np.savetxt(folder / "singular.txt", np.diag([300.0, 0.0, 1.0]))
    np.savetxt(folder / "flat.txt", K[:2])
    np.savetxt(folder / "nan.txt", np.where(K == 300, np.nan, K))
    np.savetxt(folder / "mirrored.txt", K * [-1, 1, 1])
    np.save(folder / "small.npy", np.ones((10, 12)))
    np.save(folder / "negative.npy", np.full(HEIGHT.shape, -3.0))
    np.save(folder / "outside.npy", np.where(SURFACE.mask, np.nan, 400.0))
    for name in ("n é.png", "plane.npy"):
        (folder / f"cut {name}").write_bytes((folder / name).read_bytes()[:-400])
    write_normal_map(NORMALS, folder / "n.exr")
    (folder / "cut.exr").write_bytes((folder / "n.exr").read_bytes()[:900])


BAD = {
    "all facing away": (("away.npy",), ("face away",)),
    "all zero": (("zero.npy",), ("zero.npy",)),
    "no file": (("nothing.png",), ("nothing.png",)),
    "cut png": (("cut n é.png",), ("cut n é.png",)),
    "cut npy": (("cut plane.npy",), ("cut plane.npy",)),
    "cut exr": (("cut.exr",), ("cut.exr",)),
    "a photograph's mask": (("mask.png",), ("mask.png", "normal")),
    "unknown convention": (("n é.png", "--convention", "opengI"), ("opengI", "directx")),
    "variable of a picture": (("n é.png", "--variable", "n"), ("variable",)),
    "small mask": (("n é.png", "--mask", "small.png"), ("12 × 10", "48 × 40")),
    "singular K": (("n é.png", "--K", "singular.txt"), ("focal lengths",)),
    "K of 2 × 3": (("n é.png", "--K", "flat.txt"), ("(2, 3)",)),
    "K not finite": (("n é.png", "--K", "nan.txt"), ("nan",)),
    "K mirrored": (("n é.png", "--K", "mirrored.txt"), ("focal lengths", "-300")),
    "K of three numbers": (("n é.png", "--K", "300,310,20"), ("four or five",)),
    "K and pixel size": (("n é.png", "--K", "K.txt", "--pixel-size", "0.1"), ("--K", "--pixel-size")),
    "pixel size": (("n é.png", "--pixel-size", "-1"), ("pixel size is -1",)),
    "distance of heights": (("n é.png", "--distance", "500"), ("orthographic",)),
    "distance": (("plane.npy", "--K", "K.txt", "--distance", "nan"), ("positive length",)),
    "distance and prior": (("plane.npy", "--K", "K.txt", "--distance", "5", "--prior", "distance.npy"), ("Both",)),
    "small prior": (("plane.npy", "--K", "K.txt", "--prior", "small.npy"), ("12 × 10", "48 × 40")),
    "prior without overlap": (
        ("plane.npy", "--mask", "mask.png", "--K", "K.txt", "--prior", "outside.npy"),
        ("none of which has a normal",),
    ),
    "negative prior": (("plane.npy", "--K", "K.txt", "--prior", "negative.npy"), ("negative",)),
    "prior for another integrator": (
        ("n é.png", "--prior", "negative.npy", "--integrator", "frankot-chellappa"),
        ("poisson",),
    ),
    "prior in another unit": (("n é.png", "--prior", "negative.npy", "--prior-unit", "mm"), ("mm", "px")),
    "unit without prior": (("n é.png", "--prior-unit", "mm"), ("--prior",)),
    "error without prior": (("n é.png", "--prior-sigma", "1"), ("--prior",)),
    "error of a prior": (("n é.png", "--prior", "negative.npy", "--prior-sigma", "0"), ("--prior-sigma",)),
    "small weights": (("n é.png", "--weights", "small.npy"), ("12 × 10", "48 × 40")),
    "negative weights": (("n é.png", "--weights", "negative.npy"), ("negative",)),
    "unknown integrator": (("n é.png", "--integrator", "poison"), ("Did you mean poisson?",)),
    "unknown option": (("n é.png", "--option", "tollerance=1"), ("Did you mean tolerance?",)),
    "option twice": (("n é.png", "--option", "turn=1", "--option", "turn=1"), ("given before",)),
    "a rectangle's integrator": (("n é.png", "--integrator", "frankot-chellappa"), ("rectangle",)),
}


def test_bad_input_gets_one_message_and_leaves_nothing(run, given, monkeypatch):
    spoil(given)
    monkeypatch.chdir(given)
    before = everything(given)
    for case, (words, told) in BAD.items():
        done = run("integrate", *words, "-o", "out")
        try:
            assert_one_message(done, told)
        except AssertionError as error:
            raise AssertionError(f"{case}: {error}") from error
        assert everything(given) == before, case
    error = run("integrate", "away.npy", "-o", "out", "--json").record["error"]
    assert set(error) == {"kind", "given", "needed", "remedy"}


def test_what_is_read_is_never_replaced(run, given):
    out = given / "out"
    assert run("integrate", given / "n é.png", "-o", out).code == 0
    before = everything(given)
    assert_one_message(run("integrate", out / "normals.npy", "-o", out, "--overwrite"), ("normals.npy", "-o"))
    (given / "notes").mkdir()
    (given / "notes" / "thesis.txt").write_text("ten years of work")
    assert_one_message(run("integrate", given / "n é.png", "-o", given / "notes", "--overwrite"), ("notes",))
    assert {k: v for k, v in everything(given).items() if not k.startswith("notes")} == before


def test_a_disk_that_is_full_leaves_nothing(run, given, monkeypatch):
    from psstereo.io import result_folder

    def full(*_arguments, **_words):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(result_folder, "write_mesh", full)
    before = everything(given)
    assert_one_message(run("integrate", given / "n é.png", "-o", given / "out"), ("No space left on device",))
    assert everything(given) == before
