"""Splitting images into lights and normals: exact up to a matrix, whatever is in shadow; flat objects are refused."""

import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.normals.factorisation import factorise
from psstereo.normals.gram import weighted_gram


def random_problem(lights=14, pixels=600, seed=0, tilt=1.0):
    """Return lights with strengths, scaled normals, and their images with attached shadows."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(lights, 3)) * 0.5 + [0, 0, 1]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rows = directions * np.exp(rng.uniform(-1, 1, lights))[:, None]
    normals = rng.normal(size=(3, pixels)) * tilt
    normals[2] = 1.0
    normals *= rng.uniform(0.2, 1.0, pixels) / np.linalg.norm(normals, axis=0)
    return rows, normals, np.maximum(rows @ normals, 0.0)


def out_of_space(found, truth):
    """Return how much of the true lights is outside the span of those found, relative."""
    q, _ = np.linalg.qr(found)
    return np.linalg.norm(truth - q @ (q.T @ truth)) / np.linalg.norm(truth)


@pytest.mark.parametrize("seed", range(4))
def test_images_with_shadows_are_split_exactly(seed):
    rows, normals, values = random_problem(seed=seed)
    found = factorise(values, np.ones(values.shape, bool))
    assert found.settled
    assert out_of_space(found.lights, rows) < 1e-9
    fitted = np.isfinite(found.fit.spread)
    assert fitted.mean() > 0.9
    change = np.linalg.lstsq(found.lights, rows, rcond=None)[0]
    assert np.abs(np.linalg.solve(change, found.fit.normals) - normals)[:, fitted].max() < 1e-8


def test_lights_and_normals_multiply_to_the_images():
    rows, normals, values = random_problem(tilt=0.2)
    found = factorise(values, np.ones(values.shape, bool))
    np.testing.assert_allclose(found.lights @ found.fit.normals, rows @ normals, atol=1e-9)


def test_highlights_are_left_out():
    rows, _, values = random_problem(lights=20)
    hit = np.random.default_rng(1).random(values.shape) < 0.05
    bright = values + hit * 0.5 * values.max(axis=1, keepdims=True)
    robust = factorise(bright, np.ones(values.shape, bool))
    plain = np.linalg.svd(bright, full_matrices=False)[0][:, :3]
    assert out_of_space(robust.lights, rows) < 1e-6
    assert out_of_space(plain, rows) > 0.01


def test_unusable_observations_do_not_matter():
    rows, _, values = random_problem(lights=20)
    usable = np.random.default_rng(2).random(values.shape) > 0.1
    assert out_of_space(factorise(np.where(usable, values, 0.0), usable).lights, rows) < 1e-9


def test_strengths_of_images_do_not_matter():
    rows, _, values = random_problem()
    factors = np.geomspace(1e-3, 1e3, len(values))
    found = factorise(values * factors[:, None], np.ones(values.shape, bool))
    plain = factorise(values, np.ones(values.shape, bool))
    assert out_of_space(found.lights / factors[:, None], rows) < 1e-9
    assert found.relief_ratio == pytest.approx(plain.relief_ratio, rel=0.5)


def test_a_start_near_the_lights_leads_there():
    rows, _, values = random_problem()
    start = rows + 0.1 * np.random.default_rng(3).normal(size=rows.shape)
    assert out_of_space(factorise(values, np.ones(values.shape, bool), start).lights, rows) < 1e-9


def test_normals_in_a_plane_are_refused():
    rows, normals, _ = random_problem()
    flat = normals * np.array([1.0, 0.0, 1.0])[:, None]
    with pytest.raises(InputError, match="less than three dimensions"):
        factorise(np.maximum(rows @ flat, 0.0), np.ones((len(rows), flat.shape[1]), bool))


def test_a_noisy_plane_has_no_relief():
    rows, _, _ = random_problem(lights=24, tilt=0.2)
    rng = np.random.default_rng(4)
    values = rows @ np.repeat([[0.1], [0.0], [0.9]], 600, axis=1) * (1 + 0.01 * rng.normal(size=(len(rows), 600)))
    assert factorise(np.maximum(values, 0.0), np.ones(values.shape, bool)).relief_ratio < 2


def test_a_black_image_is_named():
    _, _, values = random_problem()
    values[4] = 0.0
    with pytest.raises(InputError, match="Image 5 is black"):
        factorise(values, np.ones(values.shape, bool))


def test_the_gram_matrix_gives_each_pixel_the_same_say_and_leaves_black_ones_out():
    rng = np.random.default_rng(5)
    values = rng.random((5, 9000))
    values[:, 17] = 0.0
    unit = np.delete(values, 17, axis=1)
    unit = unit / np.linalg.norm(unit, axis=0)
    np.testing.assert_allclose(weighted_gram(values), unit @ unit.T, rtol=1e-12)
    np.testing.assert_allclose(weighted_gram(values * rng.uniform(0.1, 9, 9000)), unit @ unit.T, rtol=1e-12)
