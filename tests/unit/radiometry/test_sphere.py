import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.errors import InputError
from psstereo.radiometry import cap_solid_angle, disc_solid_angle, sphere_irradiance, sphere_solid_angle


@settings(deadline=None)
@given(st.floats(1e-9, 0.99))
def test_is_a_cap_and_larger_than_its_disc(ratio):
    assert sphere_solid_angle(ratio, 1.0) == pytest.approx(cap_solid_angle(np.arcsin(ratio)), rel=1e-12, abs=0.0)
    assert sphere_solid_angle(ratio, 1.0) >= disc_solid_angle(ratio, 1.0) * (1 - 1e-14)


def test_surface_inside_and_infinitely_far():
    solid = sphere_solid_angle(1.0, [0.0, 0.5, 1.0, np.inf, np.nan])
    np.testing.assert_allclose(solid, [4 * np.pi, 4 * np.pi, 2 * np.pi, 0.0, np.nan])
    irradiance = sphere_irradiance(1.0, 1.0, [0.0, 0.5, 1.0, np.inf, np.nan], [0.0, -1.0, 0.0, 0.3, 0.0])
    np.testing.assert_allclose(irradiance, [np.pi, np.pi, np.pi / 2, 0.0, np.nan])


@settings(deadline=None)
@given(st.floats(1.0001, 1e6), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_rises_with_the_sphere(distance, one, other):
    low, high = sorted((one, other))
    rise = sphere_irradiance(1.0, 1.0, distance, high) - sphere_irradiance(1.0, 1.0, distance, low)
    assert rise >= -1e-14 * np.pi / distance**2


@settings(deadline=None)
@given(st.floats(1.0001, 1e4), st.floats(0.0, 1.0))
def test_two_opposite_surfaces_differ_by_the_vector_irradiance(distance, share):
    cosine = share / distance
    net = sphere_irradiance(1.0, 1.0, distance, cosine) - sphere_irradiance(1.0, 1.0, distance, -cosine)
    assert net == pytest.approx(np.pi * cosine / distance**2, rel=1e-10, abs=1e-13 / distance**3)


def test_falls_as_the_square_of_the_distance():
    np.testing.assert_allclose(sphere_irradiance(2.0, 0.5, [1.0, 2.0, 4.0]), 2 * np.pi * 0.25 / np.array([1, 4, 16]))


def test_wrong_input_raises():
    with pytest.raises(InputError, match="radius"):
        sphere_solid_angle(-1.0, 1.0)
    with pytest.raises(InputError, match="cosine"):
        sphere_irradiance(1.0, 1.0, 2.0, 1.5)
