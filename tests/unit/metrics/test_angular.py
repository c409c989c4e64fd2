import dataclasses
import math

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from psstereo.errors import InputError, OptionError
from psstereo.metrics import angular_error, summarise_angles

vectors = arrays(np.float64, 3, elements=st.floats(-1e3, 1e3)).filter(lambda v: np.linalg.norm(v) > 1e-3)


def _exact_angle(a, b):
    with mpmath.workdps(60):
        a, b = [mpmath.mpf(float(x)) for x in a], [mpmath.mpf(float(x)) for x in b]
        cross = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
        return float(
            mpmath.atan2(mpmath.sqrt(sum(x * x for x in cross)), sum(x * y for x, y in zip(a, b, strict=True)))
        )


def _rotation(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    return q * np.sign(np.linalg.det(q))


@given(vectors, vectors)
def test_agrees_with_sixty_digits(a, b):
    assert float(angular_error(a, b)) == pytest.approx(_exact_angle(a, b), abs=1e-15, rel=2e-15)


@given(vectors, vectors)
def test_is_symmetric(a, b):
    assert angular_error(a, b) == angular_error(b, a)


@given(vectors, vectors, st.integers(0, 1000))
def test_does_not_change_under_rotation(a, b, seed):
    turn = _rotation(seed)
    assert float(angular_error(turn @ a, turn @ b)) == pytest.approx(float(angular_error(a, b)), abs=3e-15)


@given(vectors, vectors, st.floats(1e-3, 1e3))
def test_does_not_depend_on_length(a, b, factor):
    assert float(angular_error(factor * a, b)) == pytest.approx(float(angular_error(a, b)), abs=2e-15)


@given(vectors, vectors, vectors)
def test_obeys_the_triangle_inequality(a, b, c):
    assert angular_error(a, c) <= angular_error(a, b) + angular_error(b, c) + 1e-14


@pytest.mark.parametrize("angle", [1e-15, 1e-9, 1e-5, 0.3, math.pi / 2, math.pi - 1e-9])
def test_small_and_flat_angles_keep_their_digits(angle):
    a, b = np.array([1.0, 0.0, 0.0]), np.array([math.cos(angle), math.sin(angle), 0.0])
    assert float(angular_error(a, b)) == pytest.approx(_exact_angle(a, b), rel=1e-15)
    assert float(angular_error(a, b)) == pytest.approx(angle, rel=1e-6 if angle > 3 else 1e-14)


def test_float32_normals_have_no_steps():
    a = np.array([0.6, 0.0, 0.8], dtype=np.float32)
    angles = np.linspace(1e-5, 1e-3, 50)
    b = np.stack([0.6 * np.cos(angles), np.sin(angles), 0.8 * np.cos(angles)], axis=-1).astype(np.float32)
    assert np.abs(angular_error(a, b) - angles).max() < 2e-7
    assert angular_error(a, b).dtype == np.float64


@pytest.mark.parametrize("scale", [1e-11, 1e-5, 1e150, 1e308])
def test_lengths_neither_overflow_nor_underflow(scale):
    assert float(angular_error(np.array([scale, 0, 0]), np.array([0, scale, 0]))) == math.pi / 2


@pytest.mark.parametrize("bad", [[0, 0, 0], [1e-13, 0, 0], [np.nan, 0, 1], [np.inf, 0, 0]])
def test_unusable_vectors_give_nan(bad):
    assert np.isnan(angular_error(np.array(bad, dtype=float), np.array([0.0, 0, 1])))
    assert np.isnan(angular_error(np.array([0.0, 0, 1]), np.array(bad, dtype=float)))


def test_broadcasts_and_keeps_leading_axes():
    assert angular_error(np.ones((4, 5, 3)), np.array([0.0, 0, 1])).shape == (4, 5)
    assert angular_error(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)


@pytest.mark.parametrize(("a", "b"), [((4, 2), (4, 2)), ((4, 3), (5, 3)), ((), (3,))])
def test_wrong_shapes_are_refused(a, b):
    with pytest.raises(InputError):
        angular_error(np.ones(a), np.ones(b))


def _tilted(degrees):
    angle = np.radians(np.asarray(degrees, dtype=float))
    return np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=-1)


def test_summary_of_known_angles():
    degrees = np.array([[1.0, 4.0], [9.0, 30.0]])
    summary = summarise_angles(_tilted(degrees), _tilted(np.zeros((2, 2))))
    assert summary.mean_deg == pytest.approx(11)
    assert summary.median_deg == pytest.approx(6.5)
    assert summary.rmse_deg == pytest.approx(math.sqrt((1 + 16 + 81 + 900) / 4))
    assert summary.max_deg == pytest.approx(30)
    assert summary.p25_deg == pytest.approx(np.percentile(degrees, 25))
    assert summary.p99_deg == pytest.approx(np.percentile(degrees, 99))
    assert (summary.share_under_5_deg, summary.share_under_10_deg, summary.share_under_20_deg) == (0.5, 0.75, 0.75)
    assert (summary.count, summary.missing, summary.coverage) == (4, 0, 1.0)


def test_missing_and_short_and_absent_pixels_are_counted():
    truth = _tilted(np.zeros((1, 6)))
    estimate = _tilted(np.full((1, 6), 10.0))
    estimate[0, 0] = np.nan
    estimate[0, 1] = 0
    truth[0, 2] = 0
    truth[0, 3] = np.nan
    mask = np.array([[True, True, True, True, True, False]])
    skipped = summarise_angles(estimate, truth, mask)
    assert (skipped.count, skipped.missing, skipped.short_truth, skipped.no_truth) == (1, 2, 1, 1)
    assert skipped.coverage == pytest.approx(1 / 3)
    assert skipped.mean_deg == pytest.approx(10)
    counted = summarise_angles(estimate, truth, mask, short_truth="count-90")
    assert (counted.count, counted.short_truth, counted.max_deg) == (2, 1, 90)
    assert counted.mean_deg == pytest.approx(50)


def test_the_two_rules_differ_by_the_published_amount():
    """DiLiGenT's pot2: 73 of 35 278 masked pixels have no truth, worth 0.186 degrees (FORMATS §3)."""
    truth = _tilted(np.zeros(35278))
    truth[:73] = 0
    counted = summarise_angles(_tilted(np.zeros(35278)), truth, np.ones(35278, dtype=bool), short_truth="count-90")
    assert counted.mean_deg == pytest.approx(0.186, abs=5e-4)


def test_nothing_to_score_is_nan_and_not_an_exception():
    summary = summarise_angles(np.full((2, 2, 3), np.nan), _tilted(np.zeros((2, 2))))
    assert (summary.count, summary.missing, summary.coverage) == (0, 4, 0.0)
    assert math.isnan(summary.mean_deg)
    assert math.isnan(summary.share_under_5_deg)
    empty = summarise_angles(np.ones((2, 2, 3)), np.full((2, 2, 3), np.nan))
    assert math.isnan(empty.coverage)


def test_summary_is_frozen():
    summary = summarise_angles(np.ones((2, 2, 3)), np.ones((2, 2, 3)))
    with pytest.raises(dataclasses.FrozenInstanceError):
        summary.mean_deg = 0.0


def test_bad_input_is_refused():
    ones = np.ones((2, 2, 3))
    with pytest.raises(InputError, match="same shape"):
        summarise_angles(ones, np.ones((2, 3, 3)))
    with pytest.raises(InputError, match="mask"):
        summarise_angles(ones, ones, np.ones((3, 2), dtype=bool))
    with pytest.raises(InputError, match="mask"):
        summarise_angles(ones, ones, short_truth="count-90")
    with pytest.raises(OptionError, match="skip"):
        summarise_angles(ones, ones, short_truth="ignore")
