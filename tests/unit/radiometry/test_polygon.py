import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.errors import InputError
from psstereo.radiometry import polygon_solid_angle, spherical_polygon_solid_angle, triangle_solid_angle

seeds = st.integers(0, 2**32 - 1)


def star(rng, count, spread):
    """Directions of a non-convex polygon that winds once around +z, counter-clockwise seen from outside."""
    azimuth = 2 * np.pi * (np.arange(count) + 0.4 * rng.random(count)) / count
    polar = spread * rng.uniform(0.4, 1.0, count)
    return np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)


def turned(rng, vectors):
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return vectors @ (turn * np.linalg.det(turn)).T


def flat(rng, count):
    """Vertices of a non-convex polygon in the plane z = 1, around the axis."""
    azimuth = 2 * np.pi * (np.arange(count) + 0.4 * rng.random(count)) / count
    radius = rng.uniform(0.3, 2.0, count)
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), np.ones(count)], axis=-1)


@settings(deadline=None)
@given(seeds, st.integers(5, 12))
def test_flat_polygon_is_any_of_its_triangulations(seed, count):
    rng = np.random.default_rng(seed)
    corners = flat(rng, count)
    centre = np.broadcast_to([0.0, 0.0, 1.0], corners.shape)
    fan = np.stack([centre, corners, np.roll(corners, -1, axis=0)], axis=-2)
    expected = triangle_solid_angle(fan).sum()
    assert polygon_solid_angle(corners) == pytest.approx(expected, rel=1e-12, abs=0.0)
    assert polygon_solid_angle(np.roll(corners, 2, axis=0)) == pytest.approx(expected, rel=1e-12, abs=0.0)
    assert polygon_solid_angle(turned(rng, corners)) == pytest.approx(expected, rel=1e-11, abs=0.0)
    assert polygon_solid_angle(corners[::-1]) == pytest.approx(-expected, rel=1e-12, abs=0.0)
    assert spherical_polygon_solid_angle(corners) == pytest.approx(expected, rel=1e-12, abs=0.0)


@settings(deadline=None)
@given(seeds, st.integers(5, 12), st.floats(1e-6, 3.0))
def test_spherical_polygon_of_any_size(seed, count, spread):
    rng = np.random.default_rng(seed)
    corners = star(rng, count, spread)
    fan = np.stack([np.broadcast_to([0.0, 0.0, 1.0], corners.shape), corners, np.roll(corners, -1, axis=0)], axis=-2)
    expected = np.sum(triangle_solid_angle(fan) % (4 * np.pi))
    assert spherical_polygon_solid_angle(corners) == pytest.approx(expected, rel=1e-8, abs=0.0)
    assert spherical_polygon_solid_angle(turned(rng, corners)) == pytest.approx(expected, rel=1e-8, abs=0.0)
    assert spherical_polygon_solid_angle(corners[::-1]) == pytest.approx(4 * np.pi - expected, rel=1e-10, abs=1e-10)


def test_hemisphere_and_more():
    azimuth = 2 * np.pi * np.arange(6) / 6
    equator = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(6)], axis=-1)
    assert spherical_polygon_solid_angle(equator) == pytest.approx(2 * np.pi, rel=1e-14, abs=0.0)
    lune = np.array([[0, 0, 1], [1, 0, 0], [0, 0, -1], [np.cos(5), np.sin(5), 0]], float)
    assert spherical_polygon_solid_angle(lune) == pytest.approx(2 * 5, rel=1e-13, abs=0.0)


def test_opposite_neighbours_are_not_known():
    assert np.isnan(spherical_polygon_solid_angle([[1, 0, 0], [-1, 0, 0], [0, 1, 0]]))


def test_many_polygons_and_observers_at_once():
    face = np.array([[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]], float)
    solid = polygon_solid_angle(np.stack([face, 2 * face]), np.zeros((5, 1, 3)))
    np.testing.assert_allclose(solid, np.full((5, 2), 4 * np.pi / 6), rtol=1e-14)
    assert spherical_polygon_solid_angle(np.stack([face, face[::-1]])).shape == (2,)


def test_too_few_vertices_raise():
    with pytest.raises(InputError, match="n ≥ 3"):
        polygon_solid_angle(np.zeros((2, 3)))
    with pytest.raises(InputError, match="polygon"):
        spherical_polygon_solid_angle(np.zeros((2, 3)))
