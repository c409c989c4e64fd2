"""The predicted error of a normal against what noise really does: Monte Carlo and the Cramér–Rao bound."""

import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.flags import Flag
from psstereo.lights import Rig
from psstereo.metrics import coverage
from psstereo.normals import GATES, LeastSquares, Robust, estimate_normals
from psstereo.stack import MemoryStack
from psstereo_synth import ring, spiral
from psstereo_synth.caps import cap_capture

NONE = LeastSquares(gate=GATES["none"])


def measure(directions, normal, *, noise, trials, gate="none", channels=1, seed=0):
    """Root-mean-square angle and root-mean-square prediction over many pixels of one normal."""
    normal = np.asarray(normal) / np.linalg.norm(normal)
    rng = np.random.default_rng(seed)
    clean = np.maximum(directions @ normal, 0.0)
    images = clean[:, None, None, None] + rng.normal(0, noise, (len(directions), 1, trials, channels))
    capture = Capture(stack=MemoryStack(images), rig=Rig.distant(directions))
    gray = "mean" if channels == 1 else "per-channel"
    result = estimate_normals(capture, LeastSquares(gate=GATES[gate]), gray=gray)
    found = result.normals[0]
    angle = np.arctan2(np.linalg.norm(np.cross(found, normal), axis=1), found @ normal)
    return np.sqrt(np.mean(angle**2)), np.sqrt(np.mean(result.uncertainty[0] ** 2)), result


def bound(directions, normal, noise):
    """Cramér–Rao: σ/ρ √tr(P A⁻¹ P), albedo unknown, ρ = 1."""
    n = np.asarray(normal) / np.linalg.norm(normal)
    lit = directions[directions @ n > 0]
    across = np.eye(3) - np.outer(n, n)
    return noise * np.sqrt(np.trace(across @ np.linalg.inv(lit.T @ lit) @ across))


@pytest.mark.parametrize("gate", ["none", "auto"])
@pytest.mark.parametrize("lights", [8, 96])
@pytest.mark.parametrize("normal", [(0, 0, 1), (0.3, -0.2, 1)])
def test_the_prediction_is_what_happens(lights, normal, gate):
    directions, noise, trials = spiral(lights, max_tilt=0.9), 0.01, 40_000
    actual, predicted, _ = measure(directions, normal, noise=noise, trials=trials, gate=gate)
    # Two degrees of freedom an angle: the measured rms scatters by 1 / (2 √trials), 0.25 %; three of that.
    assert predicted / actual == pytest.approx(1.0, abs=0.01)
    assert actual / bound(directions, normal, noise) == pytest.approx(1.0, abs=0.01)


def test_the_prediction_holds_in_shadow_too():
    """Where shadows are told from light, nothing is lost but the shadowed observations."""
    directions, normal, noise = spiral(96, max_tilt=1.3), (0.8, 0.1, 0.6), 0.01
    shade = directions @ (np.asarray(normal) / np.linalg.norm(normal))
    assert 10 < (shade < 0).sum() < 50
    actual, predicted, result = measure(directions, normal, noise=noise, trials=20_000, gate="auto")
    assert (result.flags & Flag.SHADOWED).all()
    assert predicted / actual == pytest.approx(1.0, abs=0.03)
    assert actual / bound(directions, normal, noise) == pytest.approx(1.0, abs=0.03)


def test_the_prediction_holds_for_combined_channels():
    directions = spiral(24, max_tilt=0.9)
    actual, predicted, _ = measure(directions, (0.2, 0.1, 1), noise=0.01, trials=40_000, channels=3)
    assert predicted / actual == pytest.approx(1.0, abs=0.01)
    assert actual / bound(directions, (0.2, 0.1, 1), 0.01) == pytest.approx(3**-0.5, rel=0.01)


def test_the_optimal_ring_reaches_the_closed_form():
    """A = (m/3) I at tan² tilt = 2, so the rms angle is σ/ρ √(6/m)."""
    actual, predicted, _ = measure(ring(12), (0, 0, 1), noise=0.01, trials=40_000)
    assert actual == pytest.approx(0.01 * np.sqrt(6 / 12), rel=0.01)
    assert predicted == pytest.approx(actual, rel=0.01)


@pytest.mark.parametrize("gate", ["none", "auto"])
def test_three_observations_tell_nothing_about_their_error(gate):
    _, _, result = measure(ring(3), (0.1, 0.1, 1), noise=0.01, trials=50, gate=gate)
    assert np.isnan(result.uncertainty).all()
    assert np.isfinite(result.normals).all()
    assert (result.flags == Flag.NO_REDUNDANCY).all()


def test_weights_are_inverse_variances():
    """With the right weights the prediction holds; a common factor changes nothing."""
    directions = spiral(20, max_tilt=0.9)
    normal = np.array([0.0, 0.0, 1.0])
    rng = np.random.default_rng(1)
    sigma = np.where(np.arange(20) % 2, 0.002, 0.02)
    trials = 40_000
    images = (directions @ normal)[:, None, None] + rng.normal(size=(20, 1, trials)) * sigma[:, None, None]
    weights = np.broadcast_to(1 / sigma[:, None, None] ** 2, images.shape)
    capture = Capture(stack=MemoryStack(images), rig=Rig.distant(directions))
    first, second = (estimate_normals(capture, NONE, weights=weights * factor) for factor in (1.0, 1e-6))
    found = first.normals[0]
    actual = np.sqrt(np.mean(np.arctan2(np.hypot(found[:, 0], found[:, 1]), found[:, 2]) ** 2))
    assert np.sqrt(np.mean(first.uncertainty**2)) / actual == pytest.approx(1.0, abs=0.01)
    np.testing.assert_allclose(second.uncertainty, first.uncertainty, rtol=1e-9)
    covariance = np.linalg.inv((directions.T / sigma**2) @ directions)
    assert actual == pytest.approx(np.sqrt(covariance[0, 0] + covariance[1, 1]), rel=0.01)


@pytest.mark.parametrize(("lights", "noise"), [(6, 0.01), (8, 0.001), (12, 0.03), (16, 0.01), (32, 0.1), (96, 0.01)])
def test_the_robust_region_holds_the_truth_as_often_as_it_says_from_few_lights_on(lights, noise):
    directions = spiral(lights, max_tilt=np.radians(60.0))
    capture, truth = cap_capture(directions, (64, 64), tilt=np.radians(70.0), noise=noise, seed=7)
    result = estimate_normals(capture, Robust(), covariance=True)
    assert 0.92 < coverage(result.normals, result.covariance, truth.normals, result.used).share < 0.98
