"""``psstereo reconstruct --lights unknown`` and ``--lights refine``: lights that are not known, or not well."""

import numpy as np
import pytest

from psstereo.io import write_capture
from psstereo.metrics import angular_error
from psstereo_synth import hills, lambertian_capture, spiral
from tests.cli.capture_files import assert_one_message, results

_WORDS = ("--solver", "least-squares", "--normals-only", "--json")


@pytest.fixture
def photos(tmp_path):
    """Return a folder of matte hills under twelve lights, and their truth."""
    surface = hills(64, 64, steepness=1.5)
    capture, truth = lambertian_capture(surface, np.full((64, 64), 0.6), spiral(12))
    write_capture(capture, tmp_path / "photos", layout="diligent")
    return tmp_path / "photos", truth


def error(folder, truth):
    found = np.load(folder / "normals.npy")
    known = np.isfinite(found).all(axis=-1)
    return np.degrees(angular_error(found[known], truth.normals[known]).mean())


def test_unknown_lights_are_found_without_any_file_of_lights(run, photos, tmp_path):
    folder, truth = photos
    for name in ("light_directions.txt", "light_intensities.txt", "filenames.txt"):
        (folder / name).unlink()
    words = (*_WORDS, "--lights", "unknown")
    one = run("reconstruct", folder, "-o", tmp_path / "convex", *words)
    two = run("reconstruct", folder, "-o", tmp_path / "concave", *words, "--relief", "concave")
    assert one.code == two.code == 0
    errors = error(tmp_path / "convex", truth), error(tmp_path / "concave", truth)
    assert min(errors) < 1  # hills have no middle: either may be the true one
    assert max(errors) > 20
    facts = one.record["normals"]["lights_found"]
    assert facts["relief"] == "convex"
    assert np.allclose(facts["alternative_directions"], two.record["normals"]["lights_found"]["directions"])
    assert [step["done"] for step in one.record["steps"] if step["name"] == "lights from the images"] == [True]
    assert "found from the images" in one.record["normals"]["light_source"]


def test_wrong_lights_are_refined(run, photos, tmp_path):
    folder, truth = photos
    path = folder / "light_directions.txt"
    directions = np.loadtxt(path)
    np.savetxt(path, directions + 0.04 * np.random.default_rng(0).normal(size=directions.shape))
    plain = run("reconstruct", folder, "-o", tmp_path / "plain", *_WORDS)
    refined = run("reconstruct", folder, "-o", tmp_path / "refined", *_WORDS, "--lights", "refine")
    assert plain.code == refined.code == 0
    assert error(tmp_path / "refined", truth) < error(tmp_path / "plain", truth)
    facts = refined.record["normals"]["lights_refined"]
    assert facts["changed"]
    assert len(facts["moved_deg"]) == 12
    said = run("reconstruct", folder, "-o", tmp_path / "said", *_WORDS[:-1], "--lights", "refine", "--light-doubt", "3")
    assert "refined lights" in said.text
    assert results(tmp_path / "said") == results(tmp_path / "refined")


def test_entropy_and_strengths_resolve_too_and_threads_do_not_matter(run, photos, tmp_path):
    folder, _ = photos
    for way in ("entropy", "strengths"):
        words = (*_WORDS, "--lights", "unknown", "--ambiguity", way)
        one = run("reconstruct", folder, "-o", tmp_path / f"{way}1", *words, "--threads", 1)
        two = run("reconstruct", folder, "-o", tmp_path / f"{way}2", *words, "--threads", 3)
        assert one.code == two.code == 0
        assert one.record["normals"]["lights_found"]["ambiguity"] == way
        assert results(tmp_path / f"{way}1") == results(tmp_path / f"{way}2")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--relief", "convex"), "belongs to lights that are unknown"),
        (("--lights", "refine", "--ambiguity", "maxima"), "belongs to lights that are unknown"),
        (("--lights", "unknown", "--light-doubt", "2"), "belongs to lights that are refine"),
        (("--lights", "unknown", "--ambiguity", "maximum"), "Did you mean maxima"),
        (("--lights", "unknown", "--relief", "konvex"), "Did you mean convex"),
        (("--lights", "refine", "--light-doubt", "-1"), "doubt in directions"),
    ],
)
def test_options_are_checked_before_images_are_read(run, photos, tmp_path, words, message):
    done = run("reconstruct", photos[0], "-o", tmp_path / "out", *words)
    assert_one_message(done)
    assert message in done.text
    assert not (tmp_path / "out").exists()


def test_a_flat_object_is_refused_with_its_reason(run, tmp_path):
    flat, _ = lambertian_capture(hills(32, 32, count=0), np.full((32, 32), 0.6), spiral(12))
    write_capture(flat, tmp_path / "flat", layout="diligent")
    done = run("reconstruct", tmp_path / "flat", "-o", tmp_path / "out", "--lights", "unknown")
    assert_one_message(done, ("flat",))
