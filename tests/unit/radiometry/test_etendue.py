import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.errors import InputError
from psstereo.radiometry import disc_etendue, thin_etendue, tube_power, tube_solid_angle

length = st.floats(1e-4, 1e4)


@settings(deadline=None)
@given(length, length, length)
def test_etendue_is_the_same_from_both_ends_and_below_its_limits(a, b, d):
    exact = disc_etendue(a, b, d)
    assert exact == pytest.approx(disc_etendue(b, a, d), rel=1e-14, abs=0.0)
    assert exact <= thin_etendue(np.pi * a * a, np.pi * b * b, d) * (1 + 1e-14)
    assert exact <= np.pi**2 * min(a, b) ** 2 * (1 + 1e-14)


def test_thin_tube():
    assert disc_etendue(1e-3, 2e-3, 1e6) == pytest.approx(np.pi**2 * 4e-24, rel=1e-13, abs=0.0)
    opening = np.pi * 1e-6
    assert tube_power(5.0, opening, tube_solid_angle(2e-3, 1e3)) == pytest.approx(5 * disc_etendue(1e-3, 2e-3, 1e3))


def test_wrong_input_raises():
    with pytest.raises(InputError, match="length"):
        thin_etendue(1.0, 1.0, 0.0)
    with pytest.raises(InputError, match="far radius"):
        disc_etendue(1.0, -1.0, 1.0)


def test_nothing_has_no_etendue_to_speak_of():
    assert np.isnan(disc_etendue([0.0], 0.0, 0.0)).all()
    assert disc_etendue(0.0, 1.0, 1.0) == 0.0
