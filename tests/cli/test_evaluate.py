"""``psstereo evaluate``: a result against truth of every kind."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import scipy.io

from psstereo.io import read_capture, write_normal_map
from psstereo.metrics import height_error, summarise_angles


@pytest.fixture
def result(plain, tmp_path):
    """Return the default result of the capture."""
    return plain.rename(tmp_path / "result")


@pytest.fixture
def truth(folder):
    """Return the truth of the capture."""
    return read_capture(folder)[1]


def test_against_the_capture(run, folder, result, truth):
    done = run("evaluate", result, folder, "--json")
    assert done.code == 0
    assert done.err == ""
    mask = read_capture(folder)[0].mask
    expected = summarise_angles(np.load(result / "normals.npy"), truth.normals, mask)
    scores = done.record["normals"]
    assert scores["mean_deg"] == pytest.approx(expected.mean_deg, rel=1e-12)
    assert scores["max_deg"] == pytest.approx(expected.max_deg, rel=1e-12)
    assert scores["count"] == expected.count > 900
    assert 0 < scores["mean_deg"] < 2
    depth = height_error(np.load(result / "depth.npy"), truth.depth, mask)
    assert done.record["depth"]["rmse"] == pytest.approx(depth.rmse, rel=1e-12)
    assert done.record["depth"]["alignment"] == "offset"
    assert done.record["depth"]["unit"] == "px"


@pytest.mark.parametrize("suffix", [".npy", ".mat", ".png", ".exr", ".tif"])
def test_against_a_file(run, folder, result, truth, tmp_path, suffix):  # noqa: PLR0917
    path = tmp_path / f"wahre Normalen{suffix}"
    if suffix == ".mat":
        scipy.io.savemat(path, {"Normal_gt": np.nan_to_num(truth.normals)})
    else:
        write_normal_map(truth.normals, path)
    if suffix == ".png":
        image = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
        assert image is not None
        assert image.dtype == np.uint16
    whole = run("evaluate", result, folder, "--json").record["normals"]
    done = run("evaluate", result, path, "--json")
    assert done.code == 0
    assert done.record["depth"] is None
    assert done.record["normals"]["mean_deg"] == pytest.approx(whole["mean_deg"], abs=2e-4)
    assert done.record["normals"]["count"] == whole["count"]


def test_a_file_of_another_convention(run, result, truth, tmp_path):
    for name in ("opengl", "directx", "opencv", "bini"):
        write_normal_map(truth.normals, tmp_path / f"{name}.png", convention=name)
    right = run("evaluate", result, tmp_path / "opengl.png", "--json")
    assert right.err == ""
    for name in ("directx", "opencv", "bini"):
        done = run("evaluate", result, tmp_path / f"{name}.png", "--convention", name, "--json")
        assert done.record["normals"]["mean_deg"] == pytest.approx(right.record["normals"]["mean_deg"], abs=1e-4)
    wrong = run("evaluate", result, tmp_path / "directx.png", "--json")
    assert wrong.record["normals"]["mean_deg"] > 10
    assert "--convention directx" in wrong.err


def test_a_normal_map_may_stand_for_the_result(run, result, folder):
    whole = run("evaluate", result, folder, "--json").record
    done = run("evaluate", result / "normals.npy", folder, "--json")
    for key, value in whole["normals"].items():
        expected = value if isinstance(value, str) else pytest.approx(value, rel=1e-4)  # float64 scaled anew
        assert done.record["normals"][key] == expected
    assert done.record["depth"] is None
    itself = run("evaluate", result, result / "normals.npy", "--json")
    assert itself.record["normals"]["max_deg"] < 1e-4


def test_the_table_says_the_same_as_the_record(run, result, folder):
    record = run("evaluate", result, folder, "--json").record
    done = run("evaluate", result, folder)
    assert done.out == ""
    table = {" ".join(line.split()[:-1]): line.split()[-1] for line in done.err.splitlines() if len(line.split()) > 1}
    angles, depth = record["normals"], record["depth"]
    assert table["mean"] == f"{angles['mean_deg']:.4g}°"
    assert table["median"] == f"{angles['median_deg']:.4g}°"
    assert table["25 % below"] == f"{angles['p25_deg']:.4g}°"
    assert table["99 % below"] == f"{angles['p99_deg']:.4g}°"
    assert table["within 5°"] == f"{angles['share_under_5_deg']:.2%}"
    assert f"{angles['count']} scored, {angles['missing']} without an answer" in done.text
    assert f"mean absolute {depth['mean_abs']:.4g} px" in done.text
    assert f"largest {depth['max_abs']:.4g} px" in done.text


def test_short_truth_is_skipped_or_counted(run, result, folder, truth):
    holed = np.nan_to_num(truth.normals)
    holed[18:22, 20:28] = 0
    mask = read_capture(folder)[0].mask
    assert mask[18:22, 20:28].all()
    scipy.io.savemat(folder / "Normal_gt.mat", {"Normal_gt": holed})
    skipped = run("evaluate", result, folder, "--json").record["normals"]
    counted = run("evaluate", result, folder, "--json", "--short-truth", "count-90").record["normals"]
    plain = run("evaluate", result, folder, "--json", "--short-truth", "skip").record["normals"]
    assert plain == skipped
    assert counted["count"] - skipped["count"] == 32
    total = skipped["mean_deg"] * skipped["count"] + 32 * 90
    assert counted["mean_deg"] == pytest.approx(total / counted["count"])
    assert counted["short_truth_rule"] == "count-90"


@pytest.mark.parametrize("align", ["none", "offset", "median-offset", "scale", "affine"])
def test_depth_is_aligned_as_asked(run, result, folder, truth, align):
    np.savez_compressed(folder / "depth_gt.npz", depth_gt=3 * truth.depth + 100)
    done = run("evaluate", result, folder, "--json", "--align", align).record["depth"]
    expected = height_error(
        np.load(result / "depth.npy"), 3 * truth.depth + 100, read_capture(folder)[0].mask, alignment=align
    )
    assert done["alignment"] == align
    assert (done["scale"], done["offset"]) == pytest.approx((expected.scale, expected.offset))
    assert done["rmse"] == pytest.approx(expected.rmse)
    assert done["unit"] == ("(unit of the truth)" if align in ("scale", "affine") else "px")
    if align == "affine":
        assert done["scale"] == pytest.approx(3, rel=0.02)
        assert done["rmse"] < 1


def test_without_depth_only_normals_are_scored(run, folder, tmp_path):
    run("reconstruct", folder, "-o", tmp_path / "n", "--normals-only")
    done = run("evaluate", tmp_path / "n", folder, "--json")
    assert done.record["depth"] is None
    assert done.record["normals"]["count"] > 900
    told = run("evaluate", tmp_path / "n", folder)
    assert "angular error" in told.err
    assert "depth error" not in told.err


def test_only_depth_known(run, folder, result):
    (folder / "Normal_gt.mat").unlink()
    done = run("evaluate", result, folder, "--json")
    assert done.record["normals"] is None
    assert done.record["depth"]["count"] > 900


def test_missing_answers_are_counted(run, folder, result):
    normals = np.load(result / "normals.npy")
    normals[20, 20:25] = np.nan
    np.save(result / "normals.npy", normals)
    done = run("evaluate", result, folder, "--json").record["normals"]
    assert done["missing"] == 5
    assert done["coverage"] == pytest.approx(1 - 5 / (done["count"] + 5))


def no_truth(folder: Path, result: Path) -> tuple[Path, ...]:
    (folder / "Normal_gt.mat").unlink()
    (folder / "depth_gt.npz").unlink()
    return result, folder


def other_size(_folder: Path, result: Path) -> tuple[Path, ...]:
    np.save(result / "normals.npy", np.load(result / "normals.npy")[:-1])
    return result, _folder


def other_depth_size(_folder: Path, result: Path) -> tuple[Path, ...]:
    np.save(result / "depth.npy", np.load(result / "depth.npy")[:, :-1])
    return result, _folder


def other_map(_folder: Path, result: Path) -> tuple[Path, ...]:
    path = result.parent / "small.npy"
    write_normal_map(np.load(result / "normals.npy")[5:30], path)
    return result, path


def damaged(name: str, data: bytes):
    def spoil(folder: Path, result: Path) -> tuple[Path, ...]:
        (result / name).write_bytes(data)
        return result, folder

    return spoil


def flat_normals(folder: Path, result: Path) -> tuple[Path, ...]:
    np.save(result / "normals.npy", np.zeros((40, 48), np.float32))
    return result, folder


def text_as_truth(folder: Path, result: Path) -> tuple[Path, ...]:
    (folder.parent / "truth.png").write_text("no picture")
    return result, folder.parent / "truth.png"


BAD = {
    "capture without truth": (no_truth, ("without truth",)),
    "other size": (other_size, ("48 × 39", "48 × 40")),
    "other size of the depth": (other_depth_size, ("47 × 40", "48 × 40")),
    "other size of a map": (other_map, ("48 × 40", "48 × 25")),
    "no record": (damaged("run.json", b"{"), ("run.json",)),
    "record of another kind": (damaged("run.json", b"[1]"), ("run.json",)),
    "record that is no text": (damaged("run.json", bytes(range(128, 256))), ("run.json",)),
    "damaged normals": (damaged("normals.npy", b"\x93NUMPY"), ("normals.npy",)),
    "empty normals": (damaged("normals.npy", b""), ("normals.npy",)),
    "damaged depth": (damaged("depth.npy", b"rubbish"), ("depth.npy",)),
    "flat normals": (flat_normals, ("normals.npy", "(40, 48)")),
    "capture as result": (lambda folder, _result: (folder, folder), ("not a result folder",)),
    "no result": (lambda folder, result: (result.parent / "nothing", folder), ("nothing",)),
    "no truth": (lambda folder, result: (result, folder.parent / "nothing.mat"), ("nothing.mat",)),
    "text as truth": (text_as_truth, ("truth.png",)),
    "text as result": (lambda folder, result: (folder / "filenames.txt", folder), ("filenames.txt",)),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_compared_is_told_once(run, folder, result, case):
    spoil, words = BAD[case]
    where = spoil(folder, result)
    done = run("evaluate", *where, "--json")
    assert done.code == 3
    error = done.record["error"]
    assert done.err == f"psstereo: {error['given']}\n  {error['needed']}\n  {error['remedy']}\n"
    for word in words:
        assert word in done.err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--convention", "directxx"), ("directxx", "opengl, directx, opencv", "Did you mean directx?")),
        (("--short-truth", "skp"), ("skp", "skip, count-90", "Did you mean skip?")),
        (("--align", "affin"), ("affin", "none, offset, median-offset, scale, affine", "Did you mean affine?")),
        (("--format", "dilignt"), ("dilignt", "Did you mean diligent?")),
        (("--convention", "directx"), ("directx", "capture")),
    ],
)
@pytest.mark.parametrize("depth", [True, False])
def test_unknown_words_are_told_whatever_is_scored(run, folder, tmp_path, options, words, depth):  # noqa: PLR0917
    run("reconstruct", folder, "-o", tmp_path / "r", *(() if depth else ("--normals-only",)))
    done = run("evaluate", tmp_path / "r", folder, *options)
    assert done.code == 3
    assert done.out == ""
    assert len(done.err.splitlines()) == 3
    for word in words:
        assert word in done.err


def test_numbers_that_json_lacks_become_null(run, folder, result):
    scipy.io.savemat(folder / "Normal_gt.mat", {"Normal_gt": np.tile(np.eye(40, 48)[..., None] * [0, 0, 1], (1, 1, 1))})
    normals = np.load(result / "normals.npy")
    normals[:] = np.nan
    np.save(result / "normals.npy", normals)
    done = run("evaluate", result, folder, "--json")
    assert done.code == 0
    assert json.loads(done.out, parse_constant=pytest.fail)["normals"]["mean_deg"] is None
    assert run("evaluate", result, folder).code == 0
