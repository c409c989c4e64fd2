"""What a wrong model does to a fit: dense algebra, Monte Carlo with known misfit, and the compiled twin."""

import numpy as np
import pytest

from psstereo.kernels import misfit, misfit_compiled
from psstereo.kernels.misfit import CERTAIN, CHANCE, FAR, LENGTH, misfit_spread, sky_of
from psstereo_synth import spiral

SIGMA = 0.01
SKY = sky_of(spiral(60, max_tilt=0.9))


def fits(lights=60, pixels=400, unknowns=3, seed=0):
    """Return linear columns under a rig: a constant, and cosines to axes; the last two stand for turns."""
    directions = spiral(lights, max_tilt=0.9)
    rng = np.random.default_rng(seed)
    axes = np.linalg.qr(rng.normal(size=(pixels, 3, 3)))[0]
    columns = axes @ directions.T
    if unknowns > 3:
        columns = np.concatenate([np.ones((pixels, unknowns - 3, lights)) + 0.3 * columns[:, :1] ** 2, columns], axis=1)
    return directions, columns


def correlated(directions, pixels, tau, seed):
    """Return errors that go with the direction, and noise; the correlation is written out once more."""
    cosine = np.clip(directions @ directions.T, -1, 1)
    covariance = tau**2 * np.exp(-np.arccos(cosine) / LENGTH) + SIGMA**2 * np.eye(len(directions))
    rng = np.random.default_rng(seed)
    return rng.normal(size=(pixels, len(directions))) @ np.linalg.cholesky(covariance).T


def solved(columns, y, gate=None):
    """Return least squares: the last two unknowns, residuals, matrix and gate."""
    g = np.ones_like(y) if gate is None else gate
    matrix = (columns * g[:, None]) @ columns.transpose(0, 2, 1)
    x = np.linalg.solve(matrix, (columns @ (g * y)[:, :, None]))
    return x[:, -2:, 0], y - (x.transpose(0, 2, 1) @ columns)[:, 0], matrix, g


def told(columns, y, sky, gate=None, scale=np.inf):
    turns, r, matrix, g = solved(columns, y, gate)
    free = np.ones(columns.shape[:2], np.bool_)
    more = misfit_spread(columns, matrix, free, g, r, r, np.full(len(y), scale), sky)
    spare = (g > 0).sum(axis=1) - columns.shape[1]
    white = np.linalg.inv(matrix)[:, -2:, -2:] * ((g * r * r).sum(axis=1) / spare)[:, None, None]
    return turns, more, white


def share_of(rest, k, left):
    """By how many deviations the statistic is above that of noise, from the eigenvalues of R K R."""
    values = np.sort(np.linalg.eigvalsh(rest @ k @ rest))
    spare = round(np.trace(rest))
    mean = values.sum() / spare
    deviation = np.sqrt(2 * ((values[-spare:] - mean) ** 2).sum() / (spare * (spare + 2)))
    t = np.clip(((left @ k @ left) / (left @ left) - mean) / deviation, CHANCE, CERTAIN)
    t = (t - CHANCE) / (CERTAIN - CHANCE)
    return t * t * (3 - 2 * t)


def test_a_fit_is_told_as_dense_matrices_tell_it():
    """R = I − H, K written out, and the two equations solved by a library, for one pixel with weights."""
    directions, columns = fits(pixels=1)
    rng = np.random.default_rng(1)
    gate = rng.uniform(0.5, 1.5, (1, 60)) * (rng.random((1, 60)) > 0.2)
    y = correlated(directions, 1, 0.05, 2)
    _, r, matrix, g = solved(columns, y, gate)
    more = misfit_spread(columns, matrix, np.ones((1, 3), np.bool_), g, r, r, np.full(1, np.inf), sky_of(directions))

    root = np.sqrt(gate[0])
    x, left = columns[0] * root, r[0] * root
    k = root[:, None] * root * np.exp(-np.arccos(np.clip(directions @ directions.T, -1, 1)) / LENGTH)
    rest = np.diag((gate[0] > 0).astype(float)) - x.T @ np.linalg.pinv(x.T)
    equations = [[np.trace(rest), np.trace(rest @ k)], [np.trace(rest @ k), np.trace(rest @ k @ rest @ k)]]
    tau = np.linalg.solve(equations, [left @ left, left @ k @ left])[1]
    assert tau > 0
    tau *= share_of(rest, k, left)
    expected = tau * (np.linalg.pinv(x.T) @ k @ np.linalg.pinv(x.T).T)[-2:, -2:]
    np.testing.assert_allclose(more[0], [expected[0, 0], expected[0, 1], expected[1, 1]], rtol=1e-6)


def test_bars_hold_what_a_misfit_does_that_goes_with_the_direction():
    directions, columns = fits(pixels=4000)
    turns, more, white = told(columns, correlated(directions, 4000, 0.02, 3), sky_of(directions))
    actual = (turns**2).sum(axis=1).mean()
    noise = np.trace(white, axis1=1, axis2=2).mean()
    assert noise < 0.35 * actual  # what is to be mended
    assert noise + (more[:, 0] + more[:, 2]).mean() == pytest.approx(actual, rel=0.15)
    across = (turns[:, 0] ** 2).mean()
    assert white[:, 0, 0].mean() + more[:, 0].mean() == pytest.approx(across, rel=0.2)


def test_noise_alone_leaves_bars_as_they_were():
    directions, columns = fits(pixels=4000)
    turns, more, white = told(columns, SIGMA * np.random.default_rng(4).normal(size=(4000, 60)), sky_of(directions))
    before, after = np.trace(white, axis1=1, axis2=2), np.trace(white, axis1=1, axis2=2) + more[:, 0] + more[:, 2]
    assert np.sqrt(after.mean() / before.mean()) < 1.2  # a few grow much, so the mean does too
    assert np.sqrt(np.median(after) / np.median(before)) < 1.05
    whole = white + more[:, [[0, 1], [1, 2]]]
    distance = np.einsum("pi,pij,pj->p", turns, np.linalg.inv(whole), turns)
    for chance in (0.68, 0.95):
        inside = (distance < -2 * np.log(1 - chance)).mean()
        assert inside == pytest.approx(chance, abs=0.04)


def test_outliers_count_where_they_are_on_one_side_of_the_sky():
    """The same residuals that a robust fit gives no weight: all in one place, and spread at random."""
    directions, columns = fits(pixels=300)
    rng = np.random.default_rng(5)
    noise = SIGMA * rng.normal(size=(300, 60))
    _, r, matrix, g = solved(columns, noise)
    free, scale, sky = np.ones((300, 3), np.bool_), np.full(300, SIGMA), sky_of(directions)
    spread = {}
    side = np.argsort(directions[:, 0])[-10:]
    for name in ("beside", "anywhere"):
        out = r.copy()
        for row in out:
            row[side if name == "beside" else rng.choice(60, 10, replace=False)] += 8 * SIGMA * rng.choice([-1, 1])
        more = misfit_spread(columns, matrix, free, g, out, r, scale, sky)
        spread[name] = np.median(more[:, 0] + more[:, 2])
    white = np.trace(np.linalg.inv(matrix)[:, -2:, -2:], axis1=1, axis2=2).mean() * SIGMA**2
    assert spread["beside"] > 10 * white
    assert spread["anywhere"] < 0.1 * spread["beside"]


def test_what_is_far_off_is_left_out_again():
    """Outliers of one kind at two distances, the nearer of which is no farther than `FAR` scales."""
    directions, columns = fits(pixels=1)
    _, r, matrix, g = solved(columns, SIGMA * np.random.default_rng(6).normal(size=(1, 60)))
    told = {}
    for name, size in (("near", 0.5 * FAR * SIGMA), ("far", 1e6)):
        out = r.copy()
        out[0, np.argsort(directions[:, 0])[-8:]] = size
        more = misfit_spread(columns, matrix, np.ones((1, 3), np.bool_), g, out, r, np.full(1, SIGMA), SKY)
        told[name] = more[0, 0] + more[0, 2]
    assert told["near"] > 1e-3
    assert told["far"] < 0.01 * told["near"]


def test_neither_units_nor_the_scale_of_weights_matter_and_turning_does_not():
    directions, columns = fits(pixels=20)
    y = correlated(directions, 20, 0.03, 7)
    _, r, matrix, g = solved(columns, y)
    free, scale, sky = np.ones((20, 3), np.bool_), np.full(20, SIGMA), sky_of(directions)
    first = misfit_spread(columns, matrix, free, g, r, r, scale, sky)
    assert (first[:, 0] > 0).any()
    brighter = misfit_spread(7 * columns, 49 * matrix, free, g, 7 * r, 7 * r, 7 * scale, sky)
    np.testing.assert_allclose(brighter, first, rtol=1e-9, atol=1e-18)
    turn = np.linalg.qr(np.random.default_rng(8).normal(size=(3, 3)))[0]
    moved = misfit_spread(columns, matrix, free, g, r, r, scale, sky_of(directions @ turn))
    np.testing.assert_allclose(moved, first, rtol=1e-6, atol=1e-15)


def test_what_cannot_be_told_is_nothing():
    directions, columns = fits(pixels=4)
    _, r, matrix, g = solved(columns, correlated(directions, 4, 0.05, 9))
    free, scale = np.ones((4, 3), np.bool_), np.full(4, SIGMA)
    pull = r.copy()
    g[0, 10:] = 0.0  # ten observations for three unknowns
    pull[1, 3] = np.nan
    matrix[2] = np.nan
    for form in (misfit, misfit_compiled):
        more = form.misfit_spread(columns, matrix, free, g, r, pull, scale, sky_of(directions))
        assert (more[:3] == 0).all()
        assert (more[3, [0, 2]] > 0).all()


def test_correlations_are_positive_definite_and_cells_hardly_matter(monkeypatch):
    directions, columns = fits(lights=300, pixels=60)
    sky = sky_of(directions)
    assert sky.correlation.shape == (128, 128)
    assert np.unique(sky.cell).size == 128
    y = correlated(directions, 60, 0.03, 10)
    by_cells = told(columns, y, sky)[1]
    monkeypatch.setattr(misfit, "_CELLS", 300)
    whole = sky_of(directions)
    assert np.linalg.eigvalsh(whole.correlation).min() > 0
    one_by_one = told(columns, y, whole)[1]
    assert by_cells.sum() == pytest.approx(one_by_one.sum(), rel=0.12)


@pytest.mark.parametrize("lights", [40, 140])
def test_the_compiled_twin_has_the_same_numbers(lights):
    directions, columns = fits(lights=lights, pixels=30, unknowns=6)
    rng = np.random.default_rng(11)
    gate = rng.uniform(0.5, 1.5, (30, lights)) * (rng.random((30, lights)) > 0.2)
    free = rng.random((30, 6)) > 0.3
    free[:, -2:] = True
    matrix = (columns * gate[:, None]) @ columns.transpose(0, 2, 1) + 1e-3 * np.eye(6)
    r = correlated(directions, 30, 0.03, 12)
    args = (columns, matrix, free, gate, r, np.clip(r, -0.02, 0.02), np.full(30, SIGMA), sky_of(directions))
    expected = misfit_spread(*args)
    assert (expected[:, 0] > 0).mean() > 0.5
    np.testing.assert_allclose(misfit_compiled.misfit_spread(*args), expected, rtol=1e-8, atol=1e-15)
