"""``psstereo match``: pairs of files and of captures, lists of views; all or nothing; errors that name the cause."""

import cv2
import numpy as np
import pytest

from tests.unit.matching.pairs import shifted_pair, two_planes


def save(path, image):
    assert cv2.imwrite(str(path), np.rint(255 * image).astype(np.uint8))
    return path


@pytest.fixture
def pair(tmp_path):
    left, right, truth, _ = two_planes((48, 90))
    cv2.imwrite(str(tmp_path / "truth.png"), np.rint(truth * 4).astype(np.uint8))
    return save(tmp_path / "left.png", left), save(tmp_path / "right.png", right)


def test_a_pair_becomes_a_result_folder(run, pair, tmp_path):
    done = run("match", *pair, "-o", tmp_path / "out", "--disparities", "0,15", "--unchecked", "--json")
    assert done.code == 0
    record = done.record
    assert record["mode"] == "pair"
    assert record["cost"] == "photographs"
    assert record["matched"] > 0.8
    names = {"run.json", "disparity.npy", "disparity.png", "confidence.npy", "flags.npy", "constancy.png"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == names
    disparity = np.load(tmp_path / "out" / "disparity.npy")
    assert disparity.dtype == np.float32
    assert np.nanmedian(disparity[15:25, 30:40]) == pytest.approx(9, abs=0.5)


def test_truth_gives_a_score_and_a_picture(run, pair, tmp_path):
    words = ("--disparities", "0,15", "--unchecked", "--truth", tmp_path / "truth.png", "--truth-scale", 4)
    done = run("match", *pair, "-o", tmp_path / "out", *words, "--json")
    assert done.record["score"]["bad-1"] < 6
    assert done.record["constancy"]["median difference"] == "0.000 of 255"
    assert (tmp_path / "out" / "constancy.png").is_file()
    again = run("match", *pair, "-o", tmp_path / "out", *words)
    assert again.code == 3
    assert "--overwrite" in again.text
    told = run("match", *pair, "-o", tmp_path / "out", *words, "--overwrite")
    assert told.code == 0
    assert "bad-1" in told.text
    assert "brightness at the true matches" in told.text
    assert "The other view does not see the point." in told.text


def test_captures_under_many_lights_give_depth(run, tmp_path):
    made = run("synth", "two-views", "-o", tmp_path / "rig", "--size", "72", "--lights", "4")
    assert made.code == 0
    views = (tmp_path / "rig" / "view_01", tmp_path / "rig" / "view_02")
    done = run("match", *views, "-o", tmp_path / "out", "--disparities", "12,28", "--baseline", "0.8", "--json")
    assert done.code == 0
    assert done.record["cost"] == "linear"
    assert done.record["lights"] == 4
    depth = np.load(tmp_path / "out" / "depth.npy")
    assert 6.5 < np.nanmedian(depth) < 7.2
    few = run("match", *views, "-o", tmp_path / "few", "--disparities", "12,28", "--lights", "2", "--json")
    assert few.record["lights"] == 2


def test_views_of_a_list_are_swept(run, tmp_path):
    from tests.unit.matching.test_sweep import CAMERA, plane_image, standing

    flip = np.diag([1.0, -1, -1])
    lines = []
    for number, (x, y) in enumerate(((0.0, 0.0), (0.7, 0.0), (-0.7, 0.2))):
        view = standing((x, y, 5.0))
        save(tmp_path / f"v{number}.png", plane_image(view)[0])
        turn = flip @ view.pose.rotation.T
        numbers = [*CAMERA.matrix.ravel(), *turn.ravel(), *(-turn @ view.pose.position)]
        lines.append(" ".join([f"v{number}.png", *(repr(float(v)) for v in numbers)]))
    listing = tmp_path / "views.txt"
    listing.write_text("\n".join(["3", *lines]) + "\n", encoding="utf-8")
    box = "--box=-2,-2,-1,2,2,1"
    done = run("match", listing, "-o", tmp_path / "out", box, "--planes", 48, "--dark", 0.01, "--json")
    assert done.code == 0
    assert done.record["used"] == ["v0.png", "v1.png", "v2.png"]
    assert done.record["inside_box"] > 0.95
    depth = np.load(tmp_path / "out" / "depth.npy")
    assert np.nanmedian(depth) == pytest.approx(5, rel=0.01)
    assert run("match", listing, "-o", tmp_path / "o2", box, "--view", 4).code == 3
    assert run("match", listing, "-o", tmp_path / "o2", "--box=2,2,2,1,1,1").code == 3
    assert "behind" in run("match", listing, "-o", tmp_path / "o2", "--box=-1,-1,-1,1,1,9").text
    assert run("match", listing, "-o", tmp_path / "o2").code == 2


def test_a_calibration_gives_the_range_and_depth(run, pair, tmp_path):
    calibration = tmp_path / "calib.txt"
    calibration.write_text("cam0=[100 0 45; 0 100 24; 0 0 1]\nbaseline=9\nndisp=16\n", encoding="utf-8")
    done = run("match", *pair, "-o", tmp_path / "out", "--calibration", calibration, "--unchecked", "--json")
    assert done.record["count"] == 16
    depth = np.load(tmp_path / "out" / "depth.npy")
    assert np.nanmedian(depth[15:25, 30:40]) == pytest.approx(100, rel=0.05)


def test_wrong_pairs_are_named(run, tmp_path):
    left, right = shifted_pair((90, 140), disparity=5)
    good = save(tmp_path / "left.png", left)
    cases = {
        "not rectified": np.roll(right, 3, axis=0),
        "exposures differ": 0.55 * right,
        "130 × 90": right[:, :130],
        "corners": shifted_pair((90, 140), seed=8)[1],
    }
    for words, image in cases.items():
        bad = save(tmp_path / "right.png", image)
        done = run("match", good, bad, "-o", tmp_path / "out", "--disparities", "0,15")
        assert done.code == 3
        assert words in done.text
        assert not (tmp_path / "out").exists()
    dim = save(tmp_path / "dim.png", 0.55 * right)
    words = ("--disparities", "0,15", "--exposure", "estimate", "--json")
    assert run("match", good, dim, "-o", tmp_path / "out", *words).record["gain"] == pytest.approx(1 / 0.55, rel=0.03)


@pytest.mark.parametrize(
    "words",
    [
        ("--disparities", "5,2"),
        ("--disparities", "0,1.5"),
        ("--cost", "cheap"),
        ("--exposure", "other"),
        ("--response", "film"),
        ("--baseline", "2"),
        ("--calibration", "none.txt"),
        ("--truth", "none.pgm"),
    ],
)
def test_options_that_mean_nothing_are_refused(run, pair, tmp_path, words):
    done = run("match", *pair, "-o", tmp_path / "out", "--unchecked", *words)
    assert done.code == 3
    assert len(done.err.strip().splitlines()) == 3
    assert not (tmp_path / "out").exists()


def test_names_that_are_missing_are_told(run, pair, tmp_path):
    assert run("match", *pair).code == 2
    assert run("match", pair[0], "-o", tmp_path / "out").code == 2
    done = run("match", pair[0], tmp_path / "none.png", "-o", tmp_path / "out")
    assert done.code == 3
    assert "none.png" in done.text


def test_the_benchmark_tells_errors_and_times(monkeypatch):
    from psstereo.bench import summarise
    from psstereo.types import no_progress
    from psstereo_cli.suites import matching as suite

    monkeypatch.setattr(suite, "_pairs", lambda: ({}, ["Left out."]))
    records, baseline, facts = suite.matching(1, "80x80", 3, 1, map, no_progress)
    assert {s.method for s in summarise(records, baseline)} == {
        baseline,
        "psstereo, 1 thread",
        "psstereo, 1 thread, unchecked",
    }
    assert "100.00% of" in facts["notes"][0]
    assert "16: " in facts["notes"][3]
    assert facts["notes"][4] == "Left out."


def test_the_benchmark_is_square():
    from psstereo.errors import OptionError
    from psstereo.types import no_progress
    from psstereo_cli.suites.matching import matching

    with pytest.raises(OptionError, match="80x80"):
        matching(1, "80x64", 3, 1, map, no_progress)
