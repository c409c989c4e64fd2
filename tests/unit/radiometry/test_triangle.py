import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.errors import InputError
from psstereo.radiometry import triangle_solid_angle

seeds = st.integers(0, 2**32 - 1)


@settings(deadline=None)
@given(seeds)
def test_turning_mirroring_and_order(seed):
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(20, 3, 3))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    solid = triangle_solid_angle(corners)
    np.testing.assert_allclose(triangle_solid_angle(corners @ turn.T), solid, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(triangle_solid_angle(-corners), -solid, rtol=1e-12)
    np.testing.assert_allclose(triangle_solid_angle(corners[:, [1, 2, 0]]), solid, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(triangle_solid_angle(corners[:, [1, 0, 2]]), -solid, rtol=1e-9, atol=1e-10)


@settings(deadline=None)
@given(seeds, st.floats(0.05, 0.95))
def test_two_parts_add_up(seed, share):
    a, b, c = np.random.default_rng(seed).normal(size=(3, 3))
    between = a + share * (b - a)
    parts = triangle_solid_angle([[a, between, c], [between, b, c]])
    np.testing.assert_allclose(parts.sum(), triangle_solid_angle([a, b, c]), rtol=1e-8, atol=1e-10)


def test_closed_surface_sums_to_the_sphere_inside_and_to_nothing_outside():
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
    faces = corners[[[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]]
    observers = np.array([[0.0, 0.0, 0.0], [0.1, -0.2, 0.15], [3.0, 1.0, -2.0]])
    sums = triangle_solid_angle(faces, observers[:, None]).sum(axis=-1)
    np.testing.assert_allclose(sums, [4 * np.pi, 4 * np.pi, 0.0], atol=1e-14)


def test_on_a_corner_or_edge_it_is_not_known():
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    assert np.isnan(triangle_solid_angle(corners, [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]])).all()


def test_unknown_corner():
    assert np.isnan(triangle_solid_angle([[np.nan, 0, 0], [0, 1, 0], [0, 0, 1]]))


def test_wrong_shape_raises():
    with pytest.raises(InputError, match="triangle"):
        triangle_solid_angle(np.zeros((4, 3)))
    with pytest.raises(InputError, match="observer"):
        triangle_solid_angle(np.eye(3), [0.0, 0.0])
