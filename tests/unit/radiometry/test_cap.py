import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.errors import InputError
from psstereo.radiometry import cap_half_angle, cap_solid_angle


@settings(deadline=None)
@given(st.floats(1e-150, 3.0))
def test_half_angle_inverts(angle):
    assert cap_half_angle(cap_solid_angle(angle)) == pytest.approx(angle, rel=1e-13, abs=0.0)


@settings(deadline=None)
@given(st.floats(0.0, np.pi), st.floats(0.0, np.pi))
def test_monotone(one, other):
    assert (cap_solid_angle(max(one, other)) >= cap_solid_angle(min(one, other))).all()


def test_shape_and_unknown():
    solid = cap_solid_angle([[0.0, np.pi / 2], [np.pi, np.nan]])
    assert solid.shape == (2, 2)
    assert solid[0, 0] == 0.0
    assert np.isnan(solid[1, 1])


@pytest.mark.parametrize("angle", [-0.1, 3.2, np.nan])
def test_impossible_angles_raise(angle):
    with pytest.raises(InputError, match="half-angle"):
        cap_solid_angle(angle)


def test_impossible_solid_angle_raises():
    with pytest.raises(InputError, match="solid angle"):
        cap_half_angle(13.0)
