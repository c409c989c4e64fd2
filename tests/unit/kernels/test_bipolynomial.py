"""The bi-polynomial loop and its compiled twin: the same numbers, exact on its own model, spread as predicted."""

import numpy as np
import pytest

from psstereo.kernels import bipolynomial, bipolynomial_compiled
from psstereo.kernels.bipolynomial import FAILED, SETTLED, SHORT, Settings, across, tangents
from psstereo.lights import Rig
from psstereo.normals.bipolynomial import BiPolynomial
from psstereo_synth import spiral

DIRECTIONS = spiral(60)
STATE = BiPolynomial().prepare(Rig.distant(DIRECTIONS))
NONE = np.zeros((0, 0))
TWINS = (bipolynomial.fit_pixels, bipolynomial_compiled.fit_pixels)


def settings(**changes) -> Settings:
    return STATE.settings._replace(**changes)


def tilted(count, seed, most=0.5):
    rng = np.random.default_rng(seed)
    normals = np.concatenate([rng.uniform(-most, most, (count, 2)), np.ones((count, 1))], axis=1)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def shown(normals, coefficients):
    """Brightness of the model itself, by its formula, (p, m)."""
    half = DIRECTIONS + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    x = (normals @ half.T - 0.8) / 0.2
    z = STATE.powers[:, 1]
    f = sum(coefficients[j, k] * x**j * z**k for j in range(3) for k in range(3))
    return np.maximum(normals @ DIRECTIONS.T, 0) * f


def pixels(count=120, seed=0, noise=0.005, missing=0.05):
    rng = np.random.default_rng(seed)
    normals = tilted(count, seed)
    coefficients = np.array([[1.0, 0.1, 0.02], [0.15, 0.05, 0.0], [0.1, 0.0, 0.02]])
    values = shown(normals, coefficients) * rng.uniform(0.2, 2.0, (count, 1))
    values += noise * rng.normal(size=values.shape) + 0.5 * (rng.random(values.shape) < 0.05)
    values[rng.random(values.shape) < missing] = np.nan
    start = tilted(count, seed) + 0.05 * rng.normal(size=(count, 3))
    return values, start * np.nanquantile(values, 0.9, axis=1)[:, None]


def angle(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1)))


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("degree", [1, 2, 3])
def test_the_twins_agree(weighted, degree):
    values, start = pixels()
    values[0], values[1, 10:], start[2], start[3] = np.nan, 0.0, np.nan, 0.0
    weights = np.random.default_rng(5).uniform(0.2, 3.0, values.shape) if weighted else NONE
    powers = STATE.powers[:, 1:2] ** np.arange(degree + 1.0)
    plain, fast = (f(values, weights, start, STATE.geometry, powers, STATE.settings) for f in TWINS)
    np.testing.assert_array_equal(plain.outcome, fast.outcome)
    assert (plain.outcome[:4] == SHORT).all()
    assert (plain.outcome[4:] == SETTLED).mean() > 0.95
    np.testing.assert_allclose(plain.normal, fast.normal, rtol=0, atol=1e-9)
    np.testing.assert_allclose(plain.brightness, fast.brightness, rtol=1e-8)
    np.testing.assert_allclose(plain.spread, fast.spread, rtol=1e-5, atol=1e-12)
    told = (start * start).sum(axis=1) > 0
    np.testing.assert_allclose(plain.share[told], fast.share[told], rtol=0, atol=1e-6)


@pytest.mark.parametrize("fit", TWINS)
def test_a_surface_like_the_model_is_found_exactly(fit):
    normals = tilted(50, 3)
    coefficients = np.array([[1.0, 0.05, 0.0], [0.3, 0.04, 0.0], [0.1, 0.0, 0.03]])
    off = normals + 0.02 * np.random.default_rng(4).normal(size=normals.shape)
    free = settings(share=1.0, ridge=0.0, noise_ridge=0.0, rounds=200)
    found = fit(shown(normals, coefficients), NONE, off, STATE.geometry, STATE.powers, free)
    assert (found.outcome < FAILED).all()
    off_by = angle(found.normal, normals)
    assert (off_by < 1e-6).mean() > 0.8  # the sum of squares has other minima, and a start may fall for one
    assert off_by.max() < 1.5
    np.testing.assert_allclose(found.brightness[off_by < 1e-6], 1.0, rtol=1e-6)


def test_the_spread_is_that_of_repeated_trials():
    normal = np.array([[0.3, -0.2, 0.93]]) / np.linalg.norm([0.3, -0.2, 0.93])
    coefficients = np.array([[1.0, 0.1, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.0]])
    rng = np.random.default_rng(6)
    values = shown(normal, coefficients) + 0.003 * rng.normal(size=(1500, 60))
    start = np.repeat(normal, 1500, axis=0)
    free = settings(share=1.0, ridge=1e-8, noise_ridge=0.0, dark=0.01)
    found = bipolynomial_compiled.fit_pixels(
        values, NONE, start, STATE.geometry, np.ascontiguousarray(STATE.powers[:, :2]), free
    )
    good = found.outcome == SETTLED
    assert good.mean() > 0.9
    along = found.normal[good] @ tangents(normal)[0].T
    predicted = np.nanmedian(found.spread[good], axis=0)
    measured = np.cov(along.T)
    np.testing.assert_allclose(np.trace(measured), predicted[0] + predicted[2], rtol=0.25)


@pytest.mark.parametrize("factor", [1e-120, 1e-6, 1e6, 1e120])
def test_the_scale_of_the_images_does_not_matter(factor):
    values, start = pixels(30)
    for fit in TWINS:
        one, other = (
            fit(values * s, NONE, start * s, STATE.geometry, STATE.powers, STATE.settings) for s in (1.0, factor)
        )
        np.testing.assert_allclose(other.normal, one.normal, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(other.outcome, one.outcome)


def test_tangents_lie_across_and_covariances_too():
    normals = np.concatenate([tilted(20, 7), np.eye(3), -np.eye(3)])
    turn = tangents(normals)
    np.testing.assert_allclose(turn @ turn.transpose(0, 2, 1), np.broadcast_to(np.eye(2), (26, 2, 2)), atol=1e-15)
    np.testing.assert_allclose((turn @ normals[..., None]), 0, atol=1e-15)
    spread = np.random.default_rng(8).uniform(0.5, 1.0, (26, 3)) * [1.0, 0.2, 1.0]
    full = across(normals, spread)[:, [0, 1, 3, 1, 2, 4, 3, 4, 5]].reshape(-1, 3, 3)
    np.testing.assert_allclose(full @ normals[..., None], 0, atol=1e-15)
    back = turn @ full @ turn.transpose(0, 2, 1)
    np.testing.assert_allclose(back[:, [0, 0, 1], [0, 1, 1]], spread, rtol=1e-12)


def test_no_pixels_are_no_pixels():
    for fit in TWINS:
        found = fit(np.zeros((0, 60)), NONE, np.zeros((0, 3)), STATE.geometry, STATE.powers, STATE.settings)
        assert found.normal.shape == (0, 3)
        assert found.share.shape == (0, 60)
