"""The error region against SciPy's F distribution, against sampled errors, and against a solver's own promises."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from psstereo.errors import InputError, OptionError
from psstereo.metrics import confidence_angle, coverage
from psstereo.normals import LeastSquares, estimate_normals
from psstereo_synth import spiral
from psstereo_synth.caps import cap_capture


def six(matrix):
    matrix = np.asarray(matrix, float)
    return np.stack([matrix[..., i, j] for i, j in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))], axis=-1)


def rotation(seed):
    return stats.special_ortho_group(3, seed=seed).rvs()


@pytest.mark.parametrize("level", [0.5, 0.95, 0.999])
@pytest.mark.parametrize("used", [4, 4.5, 5, 9, 96, 1e6])
def test_the_semi_axis_is_that_of_hotelling(used, level):
    turn = rotation(3)
    matrix = turn @ np.diag([4e-6, 1e-6, 0.0]) @ turn.T
    expected = np.sqrt(2 * stats.f.ppf(level, 2, used - 3) * 4e-6)
    found = confidence_angle(six(matrix), used, level=level)
    assert found == pytest.approx(min(expected, np.pi), rel=1e-9)


def test_many_observations_are_the_normal_distribution():
    found = confidence_angle(np.array([1e-4, 0, 1e-4, 0, 0, 0]), 1e12)
    assert found == pytest.approx(0.01 * np.sqrt(stats.chi2.ppf(0.95, 2)), rel=1e-9)


@pytest.mark.parametrize("used", [0, 2, 3, np.nan])
def test_nothing_is_promised_without_a_degree_of_freedom(used):
    c, up = np.array([[1e-4, 0, 1e-4, 0, 0, 0]]), np.array([[0.0, 0.0, 1.0]])
    assert np.isnan(confidence_angle(c[0], used))
    found = coverage(up, c, up, used)
    assert (found.count, found.untold) == (0, 1)
    assert np.isnan(found.share)


def test_wider_than_all_is_all():
    assert confidence_angle(np.array([9.0, 0, 9.0, 0, 0, 0]), 4) == np.pi


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**31 - 1), ratio=st.floats(1e-3, 1.0), size=st.floats(1e-8, 1e-1))
def test_the_region_ends_where_its_axes_end(seed, ratio, size):
    """Along either axis, a truth just inside counts and one just outside does not."""
    turn = rotation(seed)
    axes = size * np.array([1.0, ratio])
    c = six(turn @ np.diag([*(axes / 4) ** 2, 0.0]) @ turn.T)
    bound = np.sqrt(2 * stats.f.ppf(0.95, 2, 7)) / 4
    normal = turn[:, 2]
    for axis in range(2):
        for factor, inside in ((0.999, 1.0), (1.001, 0.0)):
            angle = factor * bound * axes[axis]
            truth = np.cos(angle) * normal + np.sin(angle) * turn[:, axis]
            assert coverage(normal, c, 3.0 * truth, 10).share == inside
    assert confidence_angle(c, 10) == pytest.approx(bound * axes[0], rel=1e-6)


@pytest.mark.parametrize("used", [4, 6, 20])
@pytest.mark.parametrize("level", [0.5, 0.95])
def test_sampled_errors_are_covered_as_promised(used, level):
    """Errors from a Gaussian, their scale estimated from as many other numbers as a fit leaves."""
    rng, count = np.random.default_rng(7), 40_000
    turn = rotation(1)
    normal = turn[:, 2]
    spread = np.array([[2e-3, 0.0], [1.2e-3, 7e-4]])
    error = rng.normal(size=(count, 2)) @ spread.T
    scale = rng.chisquare(used - 3, count) / (used - 3)
    angle = np.hypot(*error.T)
    truth = np.cos(angle)[:, None] * normal + np.sinc(angle / np.pi)[:, None] * (error @ turn[:, :2].T)
    matrix = turn[:, :2] @ spread @ spread.T @ turn[:, :2].T
    found = coverage(
        np.tile(normal, (count, 1)), six(matrix) * scale[:, None], truth, np.full(count, used), level=level
    )
    assert found.count == count
    assert found.share == pytest.approx(level, abs=4 * np.sqrt(level * (1 - level) / count))


def test_what_cannot_be_judged_is_counted_apart():
    up = np.tile([0.0, 0.0, 1.0], (6, 1))
    truth, normals = up.copy(), up.copy()
    c = np.tile([1e-4, 0, 1e-4, 0, 0, 0], (6, 1))
    truth[0], truth[1], normals[2], c[3] = 0.0, np.nan, np.nan, np.nan
    found = coverage(normals, c, truth, np.full(6, 9))
    assert (found.count, found.untold, found.share, found.level) == (2, 1, 1.0, 0.95)
    assert coverage(normals, c, truth, 9, mask=np.arange(6) == 5).count == 1
    opposite = coverage(up, np.tile([1e-4, 0, 1e-4, 0, 0, 0], (6, 1)), -up * [1, 1, 0.5], 9)
    assert opposite.share in {0.0, 1.0}  # an error of π has no direction, and raises nothing
    none = coverage(up[:0], c[:0], up[:0], np.zeros(0))
    assert none.count == none.untold == 0


@pytest.mark.parametrize("level", [0.0, 1.0, -0.1, np.nan, 95])
def test_levels_that_are_no_probability(level):
    with pytest.raises(OptionError, match="level"):
        confidence_angle(np.zeros(6), 9, level=level)


@pytest.mark.parametrize(
    ("normals", "covariance", "used", "mask"),
    [
        ((4, 3), (4, 5), (4,), None),
        ((4, 3), (4, 6), (3,), None),
        ((3, 3), (4, 6), (4,), None),
        ((4, 3), (4, 6), (4,), (3,)),
        ((4, 2), (4, 6), (4,), None),
    ],
)
def test_shapes_that_do_not_fit(normals, covariance, used, mask):
    with pytest.raises(InputError, match="shape"):
        coverage(
            np.ones(normals),
            np.ones(covariance),
            np.ones(normals),
            np.ones(used),
            mask=None if mask is None else np.ones(mask, bool),
        )


@pytest.mark.parametrize("gray", ["mean", "per-channel"])
@pytest.mark.parametrize("noise", [0.002, 0.03])
@pytest.mark.parametrize("lights", [4, 8, 32, 96])
@pytest.mark.parametrize("scene", [(40, 35), (60, 70)])
def test_least_squares_keeps_its_promise(scene, lights, noise, gray):
    """The same as `psstereo bench coverage`, in the small: with and without shadows, 4 to 96 lights."""
    lights_tilt, tilt = np.radians(scene)
    capture, truth = cap_capture(spiral(lights, max_tilt=lights_tilt), (96, 96), tilt=tilt, noise=noise)
    result = estimate_normals(capture, LeastSquares(), covariance=True, gray=gray)
    found = coverage(result.normals, result.covariance, truth.normals, result.used)
    assert found.count > 4000
    assert 0.93 < found.share < 0.97


@pytest.mark.parametrize("lights", [4, 12])
def test_several_channels_share_their_degrees_of_freedom(lights):
    """Three channels with errors of their own: the sum of their variances is better known than each of them."""
    from psstereo.capture import Capture
    from psstereo.stack import MemoryStack

    parts = [cap_capture(spiral(lights, max_tilt=0.6), (80, 80), tilt=0.5, noise=0.0, seed=1) for _ in range(3)]
    truth = parts[0][1]
    clean = np.concatenate([part[0].stack.read() for part in parts], axis=3) * [0.9, 0.7, 0.8]
    noisy = clean + np.random.default_rng(5).normal(0, 0.01, clean.shape)
    capture = Capture(stack=MemoryStack(noisy), rig=parts[0][0].rig)
    result = estimate_normals(capture, LeastSquares(), covariance=True, gray="per-channel")
    assert np.nanmin(result.used) >= lights
    assert lights < np.nanmedian(result.used) < 3 + 3 * (lights - 3)
    trace = result.covariance[..., [0, 2, 5]].sum(axis=2)
    np.testing.assert_allclose(trace, result.uncertainty**2, rtol=0.02)
    found = coverage(result.normals, result.covariance, truth.normals, result.used)
    assert found.count == 6400
    assert 0.93 < found.share < 0.985  # Satterthwaite's number is on the careful side for one degree a channel
