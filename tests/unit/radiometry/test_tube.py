import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.errors import InputError
from psstereo.radiometry import disc_solid_angle, tube_half_angle, tube_power, tube_solid_angle

length = st.floats(1e-4, 1e4)


@settings(deadline=None)
@given(length, length)
def test_solid_angle_of_the_far_end(radius, d):
    assert tube_solid_angle(radius, d) == pytest.approx(disc_solid_angle(radius, d), rel=1e-13, abs=0.0)
    assert tube_half_angle(radius, d) == pytest.approx(np.arctan(radius / d), rel=1e-14, abs=0.0)


def test_power_is_linear_and_broadcasts():
    assert tube_power([[1.0], [2.0]], 3.0, [0.5, 1.0, np.nan], 0.5).shape == (2, 3)
    np.testing.assert_allclose(tube_power([1.0, 2.0], 3.0, 0.5, 0.5), [0.75, 1.5])


def test_wrong_input_raises():
    with pytest.raises(InputError, match="radiance"):
        tube_power(-1.0, 1.0, 1.0)
    with pytest.raises(InputError, match="solid angle"):
        tube_power(1.0, 1.0, 13.0)
    with pytest.raises(InputError, match="cosine"):
        tube_power(1.0, 1.0, 1.0, -0.5)
    with pytest.raises(InputError, match="length"):
        tube_half_angle(1.0, -1.0)
