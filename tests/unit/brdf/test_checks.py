import numpy as np
import pytest

from psstereo.brdf import Lambert, Phong
from psstereo.brdf.checks import common_shape, in_total, parameter, reflectance
from psstereo.errors import InputError


@pytest.mark.parametrize("bad", [np.nan, [np.nan, np.nan], -1e-9, 1 + 1e-9, [], [[0.2, 7.0]], np.inf, -np.inf])
def test_shares_outside_their_range_are_refused(bad):
    with pytest.raises(InputError, match="albedo"):
        reflectance(bad, "albedo")


def test_message_names_the_value():
    with pytest.raises(InputError, match=r"holds 7 \[1\]"):
        reflectance([0.2, 7.0], "albedo")
    with pytest.raises(InputError, match="is empty"):
        Lambert(albedo=[])


def test_ends_of_the_range():
    options = {"unit": "1", "remedy": "Correct it."}
    assert parameter(0.0, "k", low=0.0, high=1.0, **options).shape == (1,)
    with pytest.raises(InputError, match="greater than 0"):
        parameter(0.0, "k", low=0.0, high=1.0, exclude_low=True, **options)
    assert parameter(np.ones((2, 3, 1), np.float32), "k", low=0.0, high=1.0, **options).dtype == np.float64


def test_shapes_that_belong_together():
    one, three, maps = np.ones(1), np.ones(3), np.ones((4, 5, 1))
    assert common_shape(a=one) == (1,)
    assert common_shape(a=one, b=three) == (3,)
    assert common_shape(a=maps, b=three) == (4, 5, 3)
    for wrong in (
        {"a": np.ones(2), "b": three},
        {"a": maps, "b": np.ones((5, 4, 1))},
        {"a": maps, "b": np.ones((5, 1))},
    ):
        with pytest.raises(InputError, match="shapes a"):
            common_shape(**wrong)


def test_total_of_maps_and_channels():
    in_total(np.full((2, 2, 1), 0.4), np.array([0.6, 0.1]))
    with pytest.raises(InputError, match=r"1\.1"):
        in_total(np.full((2, 2, 1), 0.4), np.array([0.7, 0.1]))
    with pytest.raises(InputError, match=r"1\.4"):
        Phong(diffuse=[0.9, 0.1], specular=0.5, exponent=3)
