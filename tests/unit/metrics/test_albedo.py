import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from psstereo.errors import InputError
from psstereo.metrics import albedo_error

truth = np.random.default_rng(7).uniform(0.1, 0.9, (10, 12, 3))


@given(st.floats(1e-3, 1e3))
def test_scale_does_not_matter(scale):
    error = albedo_error(scale * truth, truth)
    assert error.rms < 1e-12
    assert error.scale == pytest.approx(1 / scale)


def test_known_errors():
    error = albedo_error(np.array([[1.0, 1.0, 1.5]]), np.ones((1, 3)))
    assert (error.scale, error.median, error.count) == (1.0, 0.0, 3)
    assert error.mean == pytest.approx(0.5 / 3)
    assert error.rms == pytest.approx(0.5 / np.sqrt(3))


def test_scale_can_be_kept():
    assert albedo_error(2 * truth, truth, fit_scale=False).mean == pytest.approx(1)


def test_colour_cast_is_an_error():
    assert albedo_error(truth * [1, 1, 1.3], truth).mean == pytest.approx(0.1)


def test_missing_and_masked_values():
    guess = truth.copy()
    guess[0, 0] = np.nan
    mask = np.ones(truth.shape[:2], dtype=bool)
    mask[1] = False
    dark = truth.copy()
    dark[2, 2, 0] = 0
    error = albedo_error(guess, dark, mask)
    assert (error.count, error.missing) == (360 - 36 - 3 - 1, 3)
    assert error.coverage == pytest.approx(320 / 323)


def test_bad_input_is_refused():
    with pytest.raises(InputError, match="shape"):
        albedo_error(truth, truth[..., 0])
    with pytest.raises(InputError, match="No pixel"):
        albedo_error(truth, 0 * truth)
    with pytest.raises(InputError, match="nowhere positive"):
        albedo_error(-truth, truth)
