import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from psstereo.errors import InputError, OptionError
from psstereo.metrics import ALIGNMENTS, height_error

truth = np.random.default_rng(5).normal(10, 3, (20, 30))
scales, offsets = st.floats(0.1, 10), st.floats(-100, 100)


@given(offsets)
@pytest.mark.parametrize("alignment", ["offset", "median-offset", "affine"])
def test_offset_is_removed(alignment, offset):
    error = height_error(truth + offset, truth, alignment=alignment)
    assert error.max_abs < 1e-11
    assert error.scale == pytest.approx(1, abs=1e-12)
    assert error.offset == pytest.approx(-offset, abs=1e-11)


@given(scales)
@pytest.mark.parametrize("alignment", ["scale", "affine"])
def test_scale_is_removed(alignment, scale):
    error = height_error(scale * truth, truth, alignment=alignment)
    assert error.max_abs < 1e-11
    assert error.scale == pytest.approx(1 / scale)


@given(scales, offsets)
def test_affine_removes_both(scale, offset):
    error = height_error((truth - offset) / scale, truth, alignment="affine")
    assert error.max_abs < 1e-9
    assert (error.scale, error.offset) == (pytest.approx(scale), pytest.approx(offset, abs=1e-8))


def test_none_changes_nothing():
    error = height_error(truth + 2, truth, alignment="none", unit="mm")
    assert (error.scale, error.offset, error.unit, error.alignment) == (1.0, 0.0, "mm", "none")
    assert error.rmse == pytest.approx(2)
    assert error.mean_abs == pytest.approx(2)


def test_best_alignments_minimise_what_they_say():
    guess = truth + np.random.default_rng(6).standard_cauchy(truth.shape)
    assert height_error(guess, truth, alignment="affine").rmse <= height_error(guess, truth, alignment="offset").rmse
    assert height_error(guess, truth, alignment="offset").rmse <= height_error(guess, truth, alignment="none").rmse
    median, mean = (height_error(guess, truth, alignment=name).mean_abs for name in ("median-offset", "offset"))
    assert median <= mean


def test_statistics_of_known_differences():
    error = height_error(np.array([[0.0, 1, 2, 9]]), np.zeros((1, 4)), alignment="none")
    assert error.rmse == pytest.approx(np.sqrt(86 / 4))
    assert (error.mean_abs, error.median_abs, error.max_abs) == (3, 1.5, 9)


def test_missing_pixels_are_counted():
    guess, reference = truth.copy(), truth.copy()
    guess[0, :3] = np.nan
    reference[1, :4] = np.nan
    mask = np.ones(truth.shape, dtype=bool)
    mask[2] = False
    error = height_error(guess, reference, mask)
    assert (error.count, error.missing) == (600 - 30 - 3 - 4, 3)
    assert error.coverage == pytest.approx(563 / 566)


def test_sums_in_float64():
    heights = (1e4 + truth).astype(np.float32)
    assert height_error(heights, heights.astype(float) - 1e4).max_abs < 1e-8


def test_bad_input_is_refused():
    with pytest.raises(OptionError, match="affine"):
        height_error(truth, truth, alignment="procrustes")
    with pytest.raises(InputError, match="shape"):
        height_error(truth, truth[1:])
    with pytest.raises(InputError, match="No pixel"):
        height_error(np.full((2, 2), np.nan), np.ones((2, 2)))
    with pytest.raises(InputError, match="constant"):
        height_error(np.full((2, 2), 0.1), np.ones((2, 2)), alignment="affine")
    with pytest.raises(InputError, match="zero"):
        height_error(np.zeros((2, 2)), np.ones((2, 2)), alignment="scale")


def test_names_are_those_promised():
    assert list(ALIGNMENTS) == ["none", "offset", "median-offset", "scale", "affine"]
