"""The robust loop and its compiled twin: the same numbers, at extremes too; constants against integrals."""

import numpy as np
import pytest
from scipy.integrate import quad

from psstereo.kernels.robust import robust_fit
from psstereo.kernels.robust_compiled import robust_fit as compiled
from psstereo.kernels.robust_losses import weight
from psstereo.kernels.robust_settings import ADAPTIVE, CONSISTENCY, LOSSES, MAD, QUARTILE, Kind, Settings
from psstereo.lights import Rig
from psstereo.normals.robust import Robust, _neighbours
from psstereo.verdict import Verdict
from psstereo_synth import spiral

DIRECTIONS = spiral(48)
Q, R = np.linalg.qr(DIRECTIONS)
R_INVERSE = np.linalg.inv(R)


def settings(loss="auto", **changes) -> Settings:
    chosen = Robust(loss=loss).prepare(Rig.distant(DIRECTIONS)).settings
    return chosen._replace(**changes)


def pixels(count=500, seed=0, noise=0.01, outliers=0.1, missing=0.05):
    """Matte pixels with shadows, noise, highlights and missing values, float64 (m, p), and their scaled normals."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3)) * [0.5, 0.5, 0] + [0, 0, 1]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    b = normals * rng.uniform(0.1, 0.9, (count, 1))
    values = np.maximum(DIRECTIONS @ b.T, 0) + noise * rng.normal(size=(48, count))
    values += (rng.random(values.shape) < outliers) * rng.uniform(0.1, 0.5, values.shape)
    values[rng.random(values.shape) < missing] = np.nan
    return values, b


def both(values, chosen, weights=None):
    around = _neighbours(DIRECTIONS)
    return [f(values, weights, Q, R_INVERSE, around, chosen, True) for f in (robust_fit, compiled)]


def angle(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1)))


@pytest.mark.parametrize("loss", ["auto", *LOSSES])
@pytest.mark.parametrize("weighted", [False, True])
def test_the_twins_agree(loss, weighted):
    values, _ = pixels()
    weights = np.random.default_rng(5).uniform(0.2, 3.0, values.shape) if weighted else None
    if weights is not None:
        weights[:3] = 0.0
    plain, fast = both(values, settings(loss), weights)
    # Rounds run in single precision in the twin, so that what is decided near a threshold may differ.
    off = angle(plain.x @ R_INVERSE.T, fast.x @ R_INVERSE.T)
    assert np.quantile(off, 0.99) < 0.02
    assert (plain.kind == fast.kind).mean() > 0.99
    assert (plain.verdicts != fast.verdicts).mean() < 2e-3
    same = off < 1e-3
    assert same.mean() > 0.9
    np.testing.assert_allclose(np.median(plain.variance[same] / fast.variance[same]), 1, atol=1e-3)
    np.testing.assert_allclose(plain.matrix[same], fast.matrix[same], rtol=0, atol=0.05)


@pytest.mark.parametrize("factor", [1e-150, 1e-30, 1e-6, 1e6, 1e30, 1e150])
def test_the_scale_of_the_images_does_not_matter(factor):
    values, _ = pixels(200)
    for fit in (robust_fit, compiled):
        one = fit(values, None, Q, R_INVERSE, _neighbours(DIRECTIONS), settings(), False)
        other = fit(values * factor, None, Q, R_INVERSE, _neighbours(DIRECTIONS), settings(), False)
        np.testing.assert_allclose(other.x / factor, one.x, rtol=0, atol=1e-6)
        np.testing.assert_array_equal(other.kind, one.kind)


def test_pixels_that_cannot_be_fitted_are_left_to_others():
    values, _ = pixels(6, outliers=0, missing=0)
    values[:, 0] = 0.0  # black
    values[:, 1] = np.nan  # nothing known
    values[5:, 2] = np.nan  # five observations
    values[:, 3] = -1.0
    values[:40, 4] = np.inf
    for fit in both(values, settings()):
        assert fit.kind[:4].tolist() == [Kind.UNSOLVED, Kind.UNSOLVED, Kind.PLAIN, Kind.UNSOLVED]
        assert np.isnan(fit.x[:4]).all()
        assert np.isfinite(fit.x[4:]).all()
        assert (fit.verdicts[:, 1] == Verdict.UNUSABLE).all()
        assert (fit.verdicts[:40, 4] == Verdict.UNUSABLE).all()


def test_no_pixels_are_no_pixels():
    for fit in both(np.zeros((48, 0)), settings()):
        assert fit.x.shape == (0, 3)
        assert fit.verdicts.shape == (48, 0)


def test_verdicts_name_what_was_done_to_each_observation():
    """Highlights put in by hand are found, shadows are shadows, and the rest is used."""
    values, b = pixels(300, noise=0.001, outliers=0, missing=0)
    rng = np.random.default_rng(1)
    lit = 0.05 * np.linalg.norm(b, axis=1) < DIRECTIONS @ b.T
    hit = (rng.random(values.shape) < 0.1) & lit
    values[hit] += 0.3
    for fit in both(values, settings()):
        assert (fit.verdicts[hit] == Verdict.HIGHLIGHT).mean() > 0.99
        assert (fit.verdicts[DIRECTIONS @ b.T < -0.05] == Verdict.SHADOW).mean() > 0.99
        assert (fit.verdicts[lit & ~hit] == Verdict.USED).mean() > 0.97


def test_white_structured_and_piled_up_residuals_are_told_apart():
    rng = np.random.default_rng(2)
    _, b = pixels(400, outliers=0)
    shading = np.maximum(DIRECTIONS @ b.T, 0)
    length = np.linalg.norm(b, axis=1)
    noisy = shading + 0.02 * length * rng.normal(size=shading.shape)
    bent = (shading / length) ** 0.7 * length
    half = (np.array([0, 0, 1.0]) + DIRECTIONS) / np.linalg.norm(np.array([0, 0, 1.0]) + DIRECTIONS, axis=1)[:, None]
    shiny = shading + 0.4 * np.maximum(half @ (b / length[:, None]).T, 0) ** 80
    for values, kind in ((noisy, Kind.WHITE), (bent, Kind.STRUCTURED)):
        for fit in both(values, settings()):
            assert (fit.kind == kind).mean() > 0.9
    for fit in both(shiny, settings()):
        assert (fit.kind == Kind.STRUCTURED).mean() < 0.2
        assert np.median(angle(fit.x @ R_INVERSE.T, b)) < 0.1


def test_constants_are_those_of_gaussian_noise():
    from scipy.stats import norm

    assert pytest.approx(1 / norm.ppf(0.75), rel=1e-12) == MAD
    assert pytest.approx(1 / norm.ppf(0.625), rel=1e-12) == QUARTILE
    for number, (name, tuning) in enumerate(LOSSES.items()):
        cuts = [1e-3, 1.345, 4.685]

        def total(power, number=number, tuning=tuning, cuts=cuts):
            def density(r):
                w = float(weight(number, np.array([r / tuning]))[0])
                return 2 * w * r**power * np.exp(-r * r / 2)

            return sum(
                quad(density, low, high, limit=200)[0] for low, high in zip([0, *cuts], [*cuts, 40.0], strict=True)
            )

        assert total(2) / total(0) == pytest.approx(CONSISTENCY[number], rel=1e-6), name
    assert CONSISTENCY[ADAPTIVE] == 1.0
