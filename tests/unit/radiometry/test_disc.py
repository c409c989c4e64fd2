import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.errors import InputError
from psstereo.radiometry import cap_solid_angle, disc_solid_angle, disc_solid_angle_from

length = st.floats(1e-6, 1e6)


@settings(deadline=None)
@given(length, length)
def test_on_axis_is_a_cap(radius, height):
    assert disc_solid_angle(radius, height) == pytest.approx(
        cap_solid_angle(np.arctan2(radius, height)), rel=1e-13, abs=0.0
    )


@settings(deadline=None)
@given(st.floats(1e-2, 1e2), st.floats(1e-2, 1e2), st.floats(1e-2, 1e2), st.floats(1e-3, 1e3))
def test_scale_and_side_do_not_matter(radius, height, offset, factor):
    solid = disc_solid_angle(radius, height, offset)
    assert disc_solid_angle(factor * radius, -factor * height, factor * offset) == pytest.approx(
        solid, rel=1e-9, abs=0.0
    )


@settings(deadline=None)
@given(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3), st.floats(1e-3, 1e3), st.floats(1.001, 10.0))
def test_falls_with_offset_and_grows_with_radius(radius, height, offset, factor):
    solid = disc_solid_angle(radius, height, offset)
    assert disc_solid_angle(radius, height, factor * offset) <= solid * (1 + 1e-14)
    assert disc_solid_angle(factor * radius, height, offset) >= solid * (1 - 1e-14)


def test_in_the_plane_it_is_the_limit_from_above():
    assert disc_solid_angle(1.0, 0.0, [0.5, 1.0, 1.5]).tolist() == [2 * np.pi, np.pi, 0.0]
    nearly = disc_solid_angle(1.0, [[1e-14], [1e-59], [1e-61], [1e-200]], [0.5, 1.0, 1.5])
    np.testing.assert_allclose(nearly, np.broadcast_to([2 * np.pi, np.pi, 0.0], (4, 3)), atol=2e-12)


def test_outside_it_falls_in_proportion_to_the_height_down_to_nothing():
    per_height = disc_solid_angle(1.0, [1e-20, 1e-59, 1e-61, 1e-150], 1.5) / np.array([1e-20, 1e-59, 1e-61, 1e-150])
    np.testing.assert_allclose(per_height, per_height[0], rtol=1e-13)


def test_far_away_and_foreshortened():
    assert disc_solid_angle(1.0, 3e9, 4e9) == pytest.approx(np.pi / 25e18 * 0.6, rel=1e-13, abs=0.0)


def test_nothing_and_unknown():
    solid = disc_solid_angle([0.0, 0.0, np.nan, 1.0], [1.0, 0.0, 1.0, np.nan], 0.0)
    assert solid[0] == 0.0
    assert np.isnan(solid[1:]).all()


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_in_space_it_is_the_same_however_turned(seed):
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    shift = rng.normal(size=3)
    points = rng.normal(size=(5, 3))
    solid = disc_solid_angle_from(points @ turn.T + shift, shift, turn @ [0, 0, 1], 0.8)
    expected = disc_solid_angle(0.8, points[:, 2], np.hypot(points[:, 0], points[:, 1]))
    np.testing.assert_allclose(solid, expected, rtol=1e-9, atol=1e-12)


def test_wrong_input_raises():
    with pytest.raises(InputError, match="radius"):
        disc_solid_angle(-1.0, 1.0)
    with pytest.raises(InputError, match="offset"):
        disc_solid_angle(1.0, 1.0, -1.0)
    with pytest.raises(InputError, match="height"):
        disc_solid_angle(1.0, np.nan)
    with pytest.raises(InputError, match="normal"):
        disc_solid_angle_from([0, 0, 1], [0, 0, 0], [0, 0, 2], 1.0)
    with pytest.raises(InputError, match="points"):
        disc_solid_angle_from([0, 1], [0, 0, 0], [0, 0, 1], 1.0)
