import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.radiometry.checks import cosines, directions, in_range, vectors


@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf, [1.0, -1.0]])
def test_unusable_numbers_raise(value):
    with pytest.raises(InputError, match="radius") as caught:
        in_range("radius", value, unit="m")
    assert caught.value.given
    assert caught.value.needed
    assert caught.value.remedy


def test_unknown_numbers_pass_in_arrays():
    assert np.isnan(in_range("radius", [np.nan, 1.0], unit="m")).tolist() == [True, False]
    assert np.isnan(directions("normals", [[np.nan] * 3, [0, 0, 1]])).any(axis=-1).tolist() == [True, False]


def test_the_range_is_named_in_the_message():
    with pytest.raises(InputError, match="at least 0 and at most 3"):
        in_range("half-angle", 4.0, unit="rad", high=3.0)
    with pytest.raises(InputError, match="greater than 0"):
        in_range("length", 0.0, unit="m", exclude_low=True)


def test_cosines_forgive_rounding_only():
    assert cosines("cosine", 1.0 + 1e-12) == 1.0
    with pytest.raises(InputError, match="cosine"):
        cosines("cosine", 1.01)


@pytest.mark.parametrize(
    "value", [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [np.nan, 0.0, 1.0], [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]]
)
def test_directions_of_another_length_raise(value):
    with pytest.raises(InputError, match="length"):
        directions("normals", value)


def test_float32_directions_pass():
    n = np.array([1.0, 2.0, 3.0], np.float32)
    assert directions("normals", n / np.linalg.norm(n)).dtype == np.float64


@pytest.mark.parametrize("shape", [(), (2,), (4, 2)])
def test_vectors_of_another_shape_raise(shape):
    with pytest.raises(InputError, match="shape"):
        vectors("points", np.zeros(shape))
