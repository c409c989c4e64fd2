"""``psstereo reconstruct --strengths``: given, checked, equal and unknown strengths of the lights."""

import numpy as np
import pytest

from psstereo.metrics import angular_error
from tests.cli.capture_files import assert_one_message, everything, keep_images, read_png, results, save_png
from tests.unit.near.near_scenes import pinhole_sphere, ring, shoot

_WORDS = ("--solver", "least-squares", "--normals-only", "--json")


@pytest.fixture
def truth(folder):
    return np.loadtxt(folder / "light_intensities.txt")


def hide(folder, factors):
    np.savetxt(folder / "light_intensities.txt", np.loadtxt(folder / "light_intensities.txt") * factors)


def error(first, second):
    return np.degrees(np.nanmean(angular_error(np.load(first / "normals.npy"), np.load(second / "normals.npy"))))


def step_of(record):
    (step,) = [step for step in record["steps"] if step["name"] == "light strengths"]
    return step


def test_unknown_strengths_are_found_and_told(run, folder, tmp_path, truth):
    known = run("reconstruct", folder, "-o", tmp_path / "known", *_WORDS)
    assert "light_strengths" not in known.record["normals"]
    assert not step_of(known.record)["done"]
    factors = np.exp(np.random.default_rng(0).uniform(-1, 1, (8, 1)))
    hide(folder, factors)
    wrong = run("reconstruct", folder, "-o", tmp_path / "wrong", *_WORDS)
    found = run("reconstruct", folder, "-o", tmp_path / "found", *_WORDS, "--strengths", "unknown")
    assert wrong.code == found.code == 0
    assert error(tmp_path / "wrong", tmp_path / "known") > 5
    assert error(tmp_path / "found", tmp_path / "known") < 0.3
    told = found.record["normals"]["light_strengths"]
    ratio = np.array(told["factors"]) * factors[:, 0]
    assert np.allclose(ratio / ratio.mean(), 1.0, atol=0.01)
    assert 0 < told["expected_error"] < 0.05
    assert told["residual_after"] < told["residual_before"]
    assert step_of(found.record)["done"]
    assert "strengths from the images" in found.record["normals"]["light_source"]
    plain = run("reconstruct", folder, "-o", tmp_path / "text", *_WORDS[:-1], "--strengths", "unknown")
    assert "strengths told by the images" in plain.text
    assert results(tmp_path / "text") == results(tmp_path / "found")


def test_threads_and_memory_limits_give_the_same_bytes(run, folder, tmp_path):
    words = (*_WORDS, "--strengths", "unknown")
    for name, more in (("a", ("--threads", 1)), ("b", ("--threads", 3)), ("c", ("--max-memory", "6MB"))):
        assert run("reconstruct", folder, "-o", tmp_path / name, *words, *more).code == 0
    assert results(tmp_path / "a") == results(tmp_path / "b") == results(tmp_path / "c")


def test_each_channel_if_asked(run, folder, tmp_path):
    hide(folder, np.exp(np.random.default_rng(0).uniform(-0.5, 0.5, (8, 3))))
    words = (*_WORDS[:-1], "--gray", "per-channel", "--strengths", "unknown")
    done = run("reconstruct", folder, "-o", tmp_path / "out", *words, "--json")
    assert done.code == 0
    assert np.array(done.record["normals"]["light_strengths"]["factors"]).shape == (8, 3)
    assert "strengths told by the images" in run("reconstruct", folder, "-o", tmp_path / "text", *words).text


def test_equal_strengths_ignore_the_file(run, folder, tmp_path):
    equal = run("reconstruct", folder, "-o", tmp_path / "equal", *_WORDS, "--strengths", "equal")
    assert equal.code == 0
    np.savetxt(folder / "light_intensities.txt", np.ones((8, 3)))
    assert run("reconstruct", folder, "-o", tmp_path / "ones", *_WORDS).code == 0
    assert results(tmp_path / "equal") == results(tmp_path / "ones")


def test_a_check_names_the_light_and_changes_nothing(run, folder, tmp_path):
    factors = np.ones((8, 1))
    factors[2] = 0.7
    hide(folder, factors)
    given = run("reconstruct", folder, "-o", tmp_path / "given", *_WORDS)
    checked = run("reconstruct", folder, "-o", tmp_path / "checked", *_WORDS, "--strengths", "checked")
    assert given.code == checked.code == 0
    assert results(tmp_path / "given") == results(tmp_path / "checked")
    assert "light 3 by +4" in step_of(checked.record)["reason"]
    hide(folder, 1 / factors)
    again = run("reconstruct", folder, "-o", tmp_path / "again", *_WORDS, "--strengths", "checked")
    assert " agree with the images" in step_of(again.record)["reason"]


def test_strengths_that_cannot_be_told_are_refused(run, folder, tmp_path):
    before = everything(folder)
    unknown = run("reconstruct", folder, "-o", tmp_path / "out", "--strengths", "unknwon")
    assert_one_message(unknown, ("unknwon", "given, checked, equal, unknown", "Did you mean unknown?"))
    assert everything(folder) == before
    keep_images(folder, 3)
    words = (*_WORDS[:-1], "--lights-layout", "rows")
    few = run("reconstruct", folder, "-o", tmp_path / "out", *words, "--strengths", "unknown")
    assert_one_message(few, ("3 lights", "white sphere"))
    assert not (tmp_path / "out").exists()
    checked = run("reconstruct", folder, "-o", tmp_path / "out", *_WORDS, *words[-2:], "--strengths", "checked")
    assert checked.code == 0
    assert "could not be checked" in step_of(checked.record)["reason"]


def test_a_flat_object_is_refused(run, folder, tmp_path):
    rng, directions = np.random.default_rng(0), np.loadtxt(folder / "light_directions.txt")
    for i, path in enumerate(sorted(folder.glob("0*.png"))):
        shade = 30000 * max(directions[i, 2], 0) / np.linalg.norm(directions[i])
        save_png(path, np.round(shade + 100 * rng.standard_normal(read_png(path).shape)).astype(np.uint16))
    done = run("reconstruct", folder, "-o", tmp_path / "out", "--strengths", "unknown")
    assert_one_message(done, ("leave the strengths", "white sphere"))
    assert not (tmp_path / "out").exists()


def test_near_lamps_have_no_unknown_strengths(run, tmp_path):
    from psstereo.io import write_capture
    from tests.cli.test_near_lamps import sixteen_bits

    camera, depth, normals, mask = pinhole_sphere(32)
    write_capture(sixteen_bits(shoot(camera, depth, normals, mask, ring())), tmp_path / "in")
    done = run("reconstruct", tmp_path / "in", "-o", tmp_path / "out", "--strengths", "unknown")
    assert_one_message(done, ("unknown strengths", "near"))
