"""The bent fit and its compiled twin: the same numbers, at extremes too; and against an independent minimum."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from psstereo.kernels.response_bend import MAD, BendFit, Settings, design, response_bend
from psstereo.kernels.response_bend_compiled import response_bend as compiled
from psstereo.lights import Rig
from psstereo.normals.response_bend import ResponseBend
from psstereo_synth import spiral

DIRECTIONS = spiral(48)
Q, R = np.linalg.qr(DIRECTIONS)
R_INVERSE = np.linalg.inv(R)
STATE = ResponseBend().prepare(Rig.distant(DIRECTIONS))


def settings(**changes) -> Settings:
    return STATE.settings._replace(**changes)


def pixels(count=400, *, seed=0, noise=0.003, outliers=0.05, missing=0.05, power=1.3):
    """Pixels with a curved response, shadows, noise, highlights and missing values, (m, p), and their unit normals."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3)) * [0.4, 0.4, 0] + [0, 0, 1]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    values = np.maximum(DIRECTIONS @ normals.T, 0) ** power * rng.uniform(0.2, 0.9, count)
    values += noise * rng.normal(size=values.shape)
    values += (rng.random(values.shape) < outliers) * rng.uniform(0.1, 0.5, values.shape)
    values[rng.random(values.shape) < missing] = np.nan
    return values, normals


def both(values, chosen, weights=None):
    return [f(values, weights, Q, R_INVERSE, STATE.pairs, chosen) for f in (response_bend, compiled)]


def angle(fit, normals):
    b = fit.solution[:, -3:] @ R_INVERSE.T
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(b, normals), axis=1), (b * normals).sum(axis=1)))


def assert_same(one: BendFit, other: BendFit, share):
    """Sums run in another order, and a decision near a threshold may fall the other way, at few pixels."""
    for name, a, b in zip(BendFit._fields, one, other, strict=True):
        same = np.isclose(a, b, rtol=1e-6, atol=1e-9, equal_nan=True)
        assert same.reshape(len(a), -1).all(axis=1).mean() >= share, name


@pytest.mark.parametrize("power", [1.0, 0.7, 1.4])
@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("segments", [2, 3, 6])
def test_the_twins_agree(power, weighted, segments):
    values, _ = pixels(power=power)
    weights = None
    if weighted:
        weights = np.random.default_rng(5).uniform(0.2, 3.0, values.shape)
        weights[:3] = 0.0
    plain, fast = both(values, settings(segments=segments), weights)
    assert (plain.share > 0).mean() > (0.7 if power != 1 else 0.0)
    assert_same(plain, fast, 0.985)


@pytest.mark.parametrize("factor", [1e-150, 1e-30, 1e-6, 1e6, 1e30, 1e150])
def test_the_scale_of_the_images_does_not_matter(factor):
    values, _ = pixels(150)
    for fit in (response_bend, compiled):
        one, other = (fit(v, None, Q, R_INVERSE, STATE.pairs, settings()) for v in (values, values * factor))
        np.testing.assert_allclose(other.top / factor, one.top, rtol=1e-12)
        assert_same(one._replace(top=other.top), other, 0.99)


def test_single_precision_images_give_nearly_the_same():
    values, normals = pixels(150, outliers=0.0)
    block = np.hstack([values, values]).astype(np.float32)[:, :150]  # part of a tile, as solvers get it
    for fit in (response_bend, compiled):
        one, other = (fit(v, None, Q, R_INVERSE, STATE.pairs, settings()) for v in (values, block))
        assert np.quantile(np.abs(angle(one, normals) - angle(other, normals)), 0.97) < 1e-3


def test_pixels_that_cannot_be_fitted_are_left_to_others():
    values, _ = pixels(8, outliers=0, missing=0)
    values[:, 0] = 0.0  # black
    values[:, 1] = np.nan  # nothing known
    values[8:, 2] = np.nan  # eight observations for six unknowns
    values[:, 3] = -1.0
    values[:, 4] = np.inf
    values[:, 5] = 0.0
    values[7, 5] = 1.0  # one light reaches it
    values[:4, 6] = np.inf
    for fit in both(values, settings()):
        assert (fit.share[:6] == 0).all()
        assert np.isnan(fit.solution[:6]).all()
        assert (fit.lit[:6] == 0).all()
        assert (fit.share[6:] > 0).all()
        assert np.isfinite(fit.solution[6:]).all()


@pytest.mark.parametrize("count", [0, 1, 15, 17, 257])
def test_any_number_of_pixels(count):
    values, _ = pixels(count)
    for fit in both(values, settings()):
        assert fit.solution.shape == (count, 6)
        assert fit.matrix.shape == (count, 6)
        assert fit.share.shape == (count,)


def test_a_pixel_does_not_depend_on_its_company():
    values, _ = pixels(300)
    for fit in (response_bend, compiled):
        whole = fit(values, None, Q, R_INVERSE, STATE.pairs, settings())
        order = np.random.default_rng(2).permutation(300)
        shuffled = fit(np.ascontiguousarray(values[:, order]), None, Q, R_INVERSE, STATE.pairs, settings())
        for a, b in zip(whole, shuffled, strict=True):
            np.testing.assert_allclose(b, a[order], rtol=1e-9, atol=1e-12)


def test_what_is_left_out_has_no_say():
    values, _ = pixels(150, missing=0.0)
    weights = np.ones(values.shape)
    weights[::5] = 0.0
    other = values.copy()
    other[::5] = 1e3
    for fit in (response_bend, compiled):
        one, two = (fit(v, weights, Q, R_INVERSE, STATE.pairs, settings()) for v in (values, other))
        for a, b in zip(one, two, strict=True):
            np.testing.assert_array_equal(a, b)


def test_the_answer_is_the_minimum_for_its_own_weights():
    """One linear problem, with the ties as rows of their own, by an independent solver."""
    values, _ = pixels(40, missing=0.0)
    chosen = settings(rounds=200, tolerance=1e-12)
    for fit in both(values, chosen):
        for j in np.flatnonzero(fit.share > 0)[:20]:
            y = values[:, j] / fit.top[j]
            columns = design(y[None], Q, chosen.segments)[0].T
            solution = fit.solution[j]
            front = Q @ solution[-3:]
            lit = (y > chosen.level) & (front > chosen.dark * np.linalg.norm(R_INVERSE @ solution[-3:]))
            w = lit / (1 + ((y - columns @ solution) / fit.scale[j]) ** 2) ** 2
            ties = np.sqrt(w.sum() * np.array([chosen.tie, chosen.tie, chosen.offset_tie, 0, 0, 0]))
            rows = np.vstack([columns * np.sqrt(w)[:, None], np.diag(ties)])
            best = lsq_linear(rows, np.concatenate([y * np.sqrt(w), np.zeros(6)]), tol=1e-14).x
            np.testing.assert_allclose(solution, best, rtol=0, atol=1e-6)


def test_tents_vanish_at_the_ends_and_peak_at_their_knots():
    y = np.array([[0.0, 0.25, 0.5, 0.75, 1.0, 1.5]])
    columns = design(y, np.ones((6, 3)), 4)
    np.testing.assert_allclose(-columns[0, 0], [0, 1, 2 / 3, 1 / 3, 0, -2 / 3], atol=1e-15)
    np.testing.assert_allclose(-columns[0, 1], [0, 0.5, 1, 0.5, 0, -1], atol=1e-15)
    np.testing.assert_allclose(-columns[0, 2], [0, 1 / 3, 2 / 3, 1, 0, -2], atol=1e-15)
    np.testing.assert_array_equal(columns[0, 3], -1.0)
    np.testing.assert_array_equal(columns[0, 4:], 1.0)


def test_noise_is_not_taken_for_a_bend_and_a_bend_is_not_taken_for_noise():
    for power, low, high in ((1.0, 0.0, 0.02), (0.8, 0.95, 1.0), (1.25, 0.95, 1.0)):
        values, _ = pixels(600, noise=0.004, outliers=0.0, missing=0.0, power=power)
        for fit in both(values, settings()):
            assert low <= fit.share.mean() <= high, power


def test_the_scale_is_that_of_gaussian_noise():
    from scipy.stats import norm

    assert pytest.approx(1 / norm.ppf(0.75), rel=1e-12) == MAD
