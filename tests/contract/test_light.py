"""What every light promises; a new one is tested by being listed in the catalogue."""

import pickle

import numpy as np
import pytest

from psstereo.errors import RigError
from psstereo.lights import LIGHTS, Directional, Led

DIRECTION = np.array([0.3, -0.5, 0.9])

# One maker a light: a light toward a direction with a strength (c,), as far away as it goes.
MAKERS = {
    "directional": lambda strength: Directional(direction=DIRECTION, strength=strength),
    "led": lambda strength: Led(position=10 * DIRECTION, axis=-DIRECTION + [0.1, 0, 0], mu=1.5, flux=strength),
}


@pytest.fixture(params=sorted(LIGHTS))
def make(request):
    assert request.param in MAKERS, "say how to make one"
    return MAKERS[request.param]


def scene(shape=(7, 5), seed=0):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(*shape, 3))
    return rng.uniform(-1, 1, (*shape, 3)), normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def test_directions_are_of_unit_length_and_one_a_point(make):
    points, _ = scene()
    directions = make(1.0).directions(points)
    assert directions.shape == points.shape
    assert directions.dtype == np.float64
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1.0, rtol=0, atol=4e-16)


def test_irradiance_has_one_value_a_channel_and_none_from_behind(make):
    points, normals = scene()
    light = make(np.array([1.0, 2.0, 5.0]))
    irradiance = light.irradiance(points, normals)
    facing = (light.directions(points) * normals).sum(axis=-1)
    assert irradiance.shape == (7, 5, 3)
    assert (irradiance >= 0).all()
    np.testing.assert_array_equal(irradiance[..., 0] > 0, facing > 0)
    assert 5 < np.count_nonzero(facing > 0) < 30
    np.testing.assert_allclose(irradiance, irradiance[..., :1] * [1.0, 2.0, 5.0], rtol=1e-15)


def test_irradiance_is_linear_in_strength(make):
    points, normals = scene()
    one, two, both = (make(s).irradiance(points, normals) for s in (0.3, 1.9, 0.3 + 1.9))
    np.testing.assert_allclose(one + two, both, rtol=1e-15)


def test_irradiance_follows_the_cosine(make):
    """The largest irradiance is that of a surface that faces the light; tilted by t it is cos t times as much."""
    point = np.array([0.2, 0.1, -0.3])
    light = make(3.0)
    toward = light.directions(point)
    side = np.cross(toward, [0, 0, 1.0])
    side /= np.linalg.norm(side)
    full = light.irradiance(point, toward)
    for tilt in (0.3, 1.0, 1.5):
        tilted = np.cos(tilt) * toward + np.sin(tilt) * side
        np.testing.assert_allclose(light.irradiance(point, tilted), full * np.cos(tilt), rtol=1e-14)


def test_any_shape_of_points(make):
    light = make(np.array([1.0, 2.0]))
    points, normals = scene()
    whole = light.irradiance(points, normals)
    np.testing.assert_allclose(light.irradiance(points[2, 3], normals[2, 3]), whole[2, 3], rtol=1e-15)
    np.testing.assert_allclose(light.irradiance(points[2], normals[2]), whole[2], rtol=1e-15)
    assert light.directions(points[0, 0]).shape == (3,)


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf, [1.0, 0.0, 1.0], [[1.0]]])
def test_strengths_that_mean_nothing_are_refused(make, bad):
    with pytest.raises(RigError) as caught:
        make(bad)
    assert caught.value.given
    assert caught.value.remedy


def test_lights_pickle_and_cannot_be_changed(make):
    light = make(np.array([1.0, 2.0]))
    points, normals = scene()
    again = pickle.loads(pickle.dumps(light))
    np.testing.assert_array_equal(again.irradiance(points, normals), light.irradiance(points, normals))
    arrays = [value for value in vars(light).values() if isinstance(value, np.ndarray)]
    assert len(arrays) >= 2
    for value in arrays:
        with pytest.raises(ValueError, match="read-only"):
            value[...] = 0


def test_the_caller_keeps_its_arrays(make):
    strength = np.array([1.0, 2.0])
    make(strength)
    strength[0] = 9.0  # still writeable


def test_a_name_and_a_distance(make):
    light = make(1.0)
    assert LIGHTS[light.name] is type(light)
    assert isinstance(light.distant, bool)


@pytest.mark.parametrize("mu", [0.0, 1.0, 4.0])
def test_a_far_lamp_tends_to_a_sun(mu):
    """Seen from distance d, a scene of size 1 differs from one under a sun by O(1 / d)."""
    points, normals = scene((50, 40))
    sun = Directional(direction=DIRECTION, strength=2.0)
    toward = sun.direction
    worst = []
    for distance in (1e2, 1e3, 1e4, 1e5):
        lamp = Led(position=distance * toward, axis=-toward, mu=mu, flux=2.0 * distance**2)
        gap = lamp.irradiance(points, normals) - sun.irradiance(points, normals)
        worst.append(np.abs(gap).max())
        turned = np.linalg.norm(lamp.directions(points) - sun.directions(points), axis=-1).max()
        assert turned < 2 * np.sqrt(3) / distance
    orders = -np.diff(np.log10(worst))
    np.testing.assert_allclose(orders, 1.0, rtol=0, atol=0.05)
