import numpy as np
import pytest

from psstereo.flags import Flag
from psstereo.lights import Rig
from psstereo.normals import GATES, LeastSquares, Samples
from psstereo_synth import ring, spiral


def solve(values, directions, gate="auto", weights=None):
    solver = LeastSquares(gate=GATES[gate])
    return solver.solve(solver.prepare(Rig.distant(directions)), Samples(np.asarray(values, float), weights))


def column(values):
    return np.asarray(values, float)[:, None]


@pytest.mark.parametrize("gate", ["auto", "none"])
@pytest.mark.parametrize(
    ("values", "present", "absent"),
    [
        ([0, 0, 0, 0, 0], Flag.NO_SIGNAL, Flag.UNUSABLE_SAMPLE),
        ([-1, -2, 0, -1, -1], Flag.NO_SIGNAL, Flag.UNUSABLE_SAMPLE),
        ([np.nan] * 5, Flag.TOO_FEW_LIGHTS | Flag.UNUSABLE_SAMPLE, Flag.NO_SIGNAL),
        ([1, 1, np.nan, np.inf, -np.inf], Flag.TOO_FEW_LIGHTS | Flag.UNUSABLE_SAMPLE, Flag.NO_SIGNAL),
        ([0, 0, 0, np.nan, 0], Flag.NO_SIGNAL | Flag.UNUSABLE_SAMPLE, Flag.NO_REDUNDANCY),
    ],
)
def test_pixels_without_an_answer_say_why(values, present, absent, gate):
    result = solve(column(values), ring(5), gate)
    assert np.isnan(result.scaled).all()
    assert np.isnan(result.uncertainty).all()
    assert result.flags[0] & present == present
    assert not result.flags[0] & absent


def test_all_weights_zero_is_too_few_and_not_black():
    values = np.maximum(ring(5) @ np.array([[0.1, 0.0], [0.1, 0.0], [0.9, 1.0]]), 0)
    weights = np.ones((5, 2))
    weights[:, 1] = 0.0
    for gate in GATES:
        result = solve(values, ring(5), gate, weights)
        assert np.isfinite(result.scaled[0]).all()
        assert np.isnan(result.scaled[1]).all()
        assert result.flags[1] & Flag.TOO_FEW_LIGHTS
        assert not result.flags[1] & Flag.NO_SIGNAL


def test_shadows_are_flagged_and_counted():
    normal = np.array([0.9, 0.0, np.sqrt(0.19)])
    directions = spiral(20, max_tilt=1.3)
    values = np.maximum(directions @ normal, 0)
    result = solve(column(values), directions)
    assert result.used[0] == np.count_nonzero(directions @ normal > 0.02)
    assert result.flags[0] == Flag.SHADOWED
    naive = solve(column(values), directions, "none")
    assert naive.flags[0] == 0
    assert naive.used[0] == 20


def test_a_cast_shadow_is_left_out():
    normal = np.array([0.2, 0.1, np.sqrt(0.95)])
    directions = spiral(12, max_tilt=0.7)
    values = directions @ normal
    values[[2, 7]] = 0.0  # the lights are in front; something else is in the way
    result = solve(column(values), directions)
    assert result.used[0] == 10
    np.testing.assert_allclose(result.scaled[0], normal, rtol=0, atol=1e-14)


def test_three_used_observations_are_remarked():
    normal = np.array([0.0, 0.0, 1.0])
    result = solve(column(ring(3) @ normal), ring(3))
    assert result.flags[0] == Flag.NO_REDUNDANCY
    assert result.used[0] == 3
    assert np.isnan(result.uncertainty[0])


def test_float32_samples_are_summed_in_float64():
    directions = spiral(96)
    rng = np.random.default_rng(0)
    values = rng.uniform(0.5, 1.0, (96, 100)).astype(np.float32)
    low, high = solve(values, directions, "none"), solve(values.astype(np.float64), directions, "none")
    assert low.scaled.dtype == np.float64
    np.testing.assert_array_equal(low.scaled, high.scaled)


def grazing(noise, count=4000, seed=0):
    """Many looks at one steep normal of albedo 1 under 96 lights, a third of them behind it."""
    directions, normal = spiral(96, max_tilt=1.3), np.array([0.95, 0.0, np.sqrt(1 - 0.95**2)])
    clean = np.maximum(directions @ normal, 0)[:, None]
    return directions, normal, clean + np.random.default_rng(seed).normal(0, noise, (96, count))


@pytest.mark.parametrize("scale", [None, 1.0, 400.0])
def test_noise_does_not_choose_the_observations(scale):
    """Grazing light that noise has made dark stays, as grazing light that it has made bright does: no bias."""
    directions, normal, values = grazing(0.1)
    weights = None if scale is None else np.full(values.shape, scale)
    result = solve(values, directions, weights=weights)
    mean = result.scaled.mean(axis=0)
    spread = result.scaled.std(axis=0).mean() / np.sqrt(values.shape[1])
    assert np.abs(mean - normal).max() < 0.012  # 0.076 where whatever is dark is left out, judged twice
    assert spread < 0.001
    assert np.abs(result.used.astype(float).mean() - (directions @ normal > 0.02).sum()) < 1.5


def test_a_cast_shadow_is_left_out_of_noisy_values_too():
    directions, normal, values = grazing(0.01)
    shaded = np.flatnonzero(directions @ normal > 0.5)[::3]
    values[shaded] = np.random.default_rng(1).normal(0, 0.01, (len(shaded), values.shape[1]))
    solver = LeastSquares()
    found = solver.solve(solver.prepare(Rig.distant(directions)), Samples(values, verdicts=True))
    assert (found.verdicts[shaded] == 1).mean() > 0.97
    angle = np.arccos(np.clip(found.scaled @ normal / np.linalg.norm(found.scaled, axis=1), -1, 1))
    assert np.degrees(angle).mean() < 0.6
