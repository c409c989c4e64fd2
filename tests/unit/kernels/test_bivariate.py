"""The bivariate regression and its compiled twin: the same numbers, exact on its own model, the programme optimal."""

import numpy as np
import pytest
from scipy.special import binom

from psstereo.kernels import bivariate, bivariate_compiled
from psstereo.kernels.bipolynomial import FAILED, SETTLED, SHORT, tangents
from psstereo.kernels.bivariate import cumulative_bernstein
from psstereo.lights import Rig
from psstereo.normals.bivariate import Bivariate
from psstereo_synth import spiral

DIRECTIONS = spiral(60)
STATE = Bivariate().prepare(Rig.distant(DIRECTIONS))
NONE = np.zeros((0, 0))
TWINS = (bivariate.fit_pixels, bivariate_compiled.fit_pixels)


def tilted(count, seed, most=0.5):
    rng = np.random.default_rng(seed)
    normals = np.concatenate([rng.uniform(-most, most, (count, 2)), np.ones((count, 1))], axis=1)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def shown(normals, a, b, t):
    """Brightness z with ``g(z, t) = n·l``, by bisection of the polynomial in its plain form, (p, m)."""
    order = len(a)
    j = np.arange(order + 1)
    controls = np.cumsum(np.concatenate([[0.0], a]))[:, None] + np.cumsum(np.concatenate([[0.0], b]))[:, None] * t
    wanted = np.maximum(normals @ DIRECTIONS.T, 0.0)
    low, high = np.zeros_like(wanted), np.full_like(wanted, 2.0)
    for _ in range(100):
        z = (low + high) / 2
        basis = binom(order, j) * z[..., None] ** j * (1 - z[..., None]) ** (order - j)
        below = np.einsum("pmj,jm->pm", basis, controls) < wanted
        low, high = np.where(below, z, low), np.where(below, high, z)
    return (low + high) / 2


def angle(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1)))


def fit_with(fit, values, start, weights=NONE, **changes):
    return fit(values, weights, start, STATE.directions, STATE.heights, STATE.settings._replace(**changes))


@pytest.mark.parametrize("order", [1, 2, 5, 8])
def test_the_basis_is_that_of_bernstein(order):
    z = np.linspace(0, 1, 11)
    j = np.arange(order + 1)
    plain = binom(order, j) * z[:, None] ** j * (1 - z[:, None]) ** (order - j)
    sums = np.stack([plain[:, k:].sum(axis=1) for k in range(1, order + 1)], axis=1)
    np.testing.assert_allclose(cumulative_bernstein(z, order), sums, atol=1e-14)
    np.testing.assert_allclose(cumulative_bernstein(z, order).mean(axis=1), z, atol=1e-14)  # equal steps: Lambert


def test_the_programme_meets_its_optimality_conditions():
    rng = np.random.default_rng(0)
    p, k = 200, 10
    root = rng.normal(size=(p, k, k))
    m = root @ root.transpose(0, 2, 1) + 1e-3 * np.eye(k)
    b, c = rng.normal(size=(p, k)), rng.uniform(0.5, 2.0, (p, k))
    start = 1 / c / k
    d, free = start.copy(), np.ones((p, k), np.bool_)
    assert bivariate.programme(m, b, c, d, free).all()
    assert 0.1 < (d == 0).mean() < 0.9
    assert (d >= 0).all()
    np.testing.assert_allclose((c * d).sum(axis=1), 1, rtol=1e-10)
    slope = ((m @ d[..., None])[..., 0] - b) / c
    held = np.where(d > 0, slope, np.nan)
    level = np.nanmean(held, axis=1, keepdims=True)
    np.testing.assert_allclose(np.where(d > 0, slope - level, 0), 0, atol=1e-7)
    assert (np.where(d > 0, np.inf, slope - level) > -1e-6).all()
    for i in range(20):
        at, open_ = start[i].copy(), np.ones(k, np.bool_)
        work = np.zeros((k, k)), np.zeros(k), np.zeros(k), np.zeros(k, np.int64)
        assert bivariate_compiled.programme(m[i], b[i], c[i], at, open_, *work)
        np.testing.assert_allclose(at, d[i], rtol=0, atol=1e-9)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("order", [1, 5])
def test_the_twins_agree(weighted, order):
    rng = np.random.default_rng(1)
    normals = tilted(100, 2)
    values = shown(normals, [0.5, 0.2, 0.3], [0.1, 0.05, 0.0], STATE.heights)
    values += 0.005 * rng.normal(size=values.shape) + 0.4 * (rng.random(values.shape) < 0.05)
    values[rng.random(values.shape) < 0.05] = np.nan
    start = normals + 0.03 * rng.normal(size=normals.shape)
    values[0], values[1, 10:], start[2], start[3] = np.nan, 0.0, np.nan, 0.0
    weights = rng.uniform(0.2, 3.0, values.shape) if weighted else NONE
    plain, fast = (fit_with(f, values, start, weights, order=order) for f in TWINS)
    np.testing.assert_array_equal(plain.outcome, fast.outcome)
    assert (plain.outcome[:4] == SHORT).all()
    assert (plain.outcome[4:] == SETTLED).mean() > 0.95
    np.testing.assert_allclose(plain.normal, fast.normal, rtol=0, atol=1e-8)
    np.testing.assert_allclose(plain.brightness, fast.brightness, rtol=1e-7)
    np.testing.assert_allclose(plain.spread, fast.spread, rtol=1e-4, atol=1e-12)
    told = (start * start).sum(axis=1) > 0
    np.testing.assert_allclose(plain.share[told], fast.share[told], rtol=0, atol=1e-5)


@pytest.mark.parametrize("fit", TWINS)
@pytest.mark.parametrize("rising", [True, False])
def test_a_surface_like_the_model_is_found(fit, rising):
    normals = tilted(40, 3)
    t = STATE.heights if rising else 1 - STATE.heights
    values = shown(normals, [0.7, 0.3, 0.2], [0.05, 0.1, 0.15], t)
    start = normals + 0.03 * np.random.default_rng(4).normal(size=normals.shape)
    loose = fit_with(fit, values, start, share=1.0, ridge=1e-10, noise_ridge=0.0, order=5)
    tied = fit_with(fit, values, start, share=1.0, ridge=1e3, noise_ridge=0.0, order=5)
    assert (loose.outcome < FAILED).all()
    assert np.median(angle(loose.normal, normals)) < 0.02
    assert np.median(angle(tied.normal, normals)) > 0.5  # Lambert's law does not do


def test_the_spread_is_that_of_repeated_trials():
    normal = np.array([[0.3, -0.2, 0.93]]) / np.linalg.norm([0.3, -0.2, 0.93])
    rng = np.random.default_rng(6)
    values = np.maximum(normal @ DIRECTIONS.T, 0.0) + 0.002 * rng.normal(size=(1500, 60))
    start = np.repeat(normal, 1500, axis=0)
    found = fit_with(bivariate_compiled.fit_pixels, values, start, share=1.0, order=2, dark=0.01)
    good = found.outcome == SETTLED
    assert good.mean() > 0.95
    measured = np.cov((found.normal[good] @ tangents(normal)[0].T).T)
    predicted = np.nanmedian(found.spread[good], axis=0)
    np.testing.assert_allclose(np.trace(measured), predicted[0] + predicted[2], rtol=0.35)


@pytest.mark.parametrize("factor", [1e-120, 1e-6, 1e6, 1e120])
def test_the_scale_of_the_images_does_not_matter(factor):
    normals = tilted(30, 5)
    values = shown(normals, [0.7, 0.3, 0.2], [0.05, 0.1, 0.15], STATE.heights)
    for fit in TWINS:
        one, other = (fit_with(fit, values * s, normals * s) for s in (1.0, factor))
        np.testing.assert_allclose(other.normal, one.normal, rtol=0, atol=1e-8)
        np.testing.assert_array_equal(other.outcome, one.outcome)


def test_no_pixels_are_no_pixels():
    for fit in TWINS:
        found = fit_with(fit, np.zeros((0, 60)), np.zeros((0, 3)))
        assert found.normal.shape == (0, 3)
        assert found.share.shape == (0, 60)
