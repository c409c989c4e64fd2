import math

import numpy as np
import pytest

from psstereo.errors import RigError
from psstereo.lights import Directional, Disc, Led, Sun

TOWARD = np.array([2.0, -1.0, 2.0]) / 3.0


def scene(seed=0, count=400):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    return rng.uniform(-1, 1, (count, 3)), normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def beam_sum(light, points, normals, count):
    return sum(
        b.irradiance * np.maximum((normals * b.directions).sum(-1), 0.0)[..., None] for b in light.beams(points, count)
    )


def test_on_the_axis_it_is_the_sine_squared():
    for distance in (1e-3, 0.5, 3.0, 1e6):
        disc = Disc(centre=[0, 0, distance], axis=[0, 0, -4], radius=2.0, radiance=[1.0, 5.0])
        want = math.pi * (2.0 / math.hypot(2.0, distance)) ** 2 * np.array([1.0, 5.0])
        np.testing.assert_allclose(disc.irradiance(np.zeros(3), np.array([0, 0, 1.0])), want, rtol=1e-14)


def test_receding_at_the_same_angle_it_tends_to_a_sun_at_first_order():
    """Over a scene of size 1 its angle and direction change by 1 / distance, under the horizon, too."""
    points, normals = scene(count=3000)
    sun = Sun(direction=TOWARD, radiance=2.0, angular_radius=0.2)
    errors = []
    for distance in (1e2, 1e3, 1e4, 1e5):
        disc = Disc(centre=distance * TOWARD, axis=-TOWARD, radius=distance * math.tan(0.2), radiance=2.0)
        errors.append(np.abs(disc.irradiance(points, normals) - sun.irradiance(points, normals)).max())
    np.testing.assert_allclose(-np.diff(np.log10(errors)), 1.0, rtol=0, atol=0.05)


def test_at_one_point_it_is_a_sun_of_the_same_outline():
    _, normals = scene(count=3000)
    sun = Sun(direction=TOWARD, radiance=2.0, angular_radius=0.2)
    disc = Disc(centre=7 * TOWARD, axis=-TOWARD, radius=7 * math.tan(0.2), radiance=2.0)
    gap = disc.irradiance(np.zeros_like(normals), normals) - sun.irradiance(normals, normals)
    assert np.abs(gap).max() < 1e-13


def test_shrinking_it_tends_to_its_lamp_at_second_order():
    points, normals = scene()
    errors = []
    for radius in (0.4, 0.2, 0.1, 0.05):
        disc = Disc(centre=4 * TOWARD, axis=[-1, 0.2, -0.8], radius=radius, radiance=1 / radius**2)
        lamp = disc.idealised()
        assert isinstance(lamp, Led)
        assert lamp.mu == 1.0
        up = ((disc.centre - points) * normals).sum(-1) > radius  # cut by the horizon it is another matter
        assert np.count_nonzero(up) > 150
        errors.append(np.abs(disc.irradiance(points, normals) - lamp.irradiance(points, normals))[up].max())
    np.testing.assert_allclose(-np.diff(np.log2(errors)), 2.0, rtol=0, atol=0.1)


def test_receding_of_the_same_power_it_tends_to_a_directional_light_at_first_order():
    points, normals = scene(count=3000)
    far = Directional(direction=TOWARD, strength=math.pi)
    errors = []
    for distance in (1e2, 1e3, 1e4):
        disc = Disc(centre=distance * TOWARD, axis=-TOWARD, radius=1.0, radiance=distance**2)
        errors.append(np.abs(disc.irradiance(points, normals) - far.irradiance(points, normals)).max())
    np.testing.assert_allclose(-np.diff(np.log10(errors)), 1.0, rtol=0, atol=0.05)


@pytest.mark.parametrize(("count", "tolerance"), [(4, 3e-2), (16, 1e-4), (64, 1e-6), (256, 1e-12)])
def test_beams_converge_fast_while_it_is_up(count, tolerance):
    points, normals = scene()
    disc = Disc(centre=4 * TOWARD, axis=[-1, 0.2, -0.8], radius=0.8, radiance=[1.0, 3.0])
    up = ((disc.centre - points) * normals).sum(-1) > 0.8
    want = disc.irradiance(points[up], normals[up])
    error = np.abs(beam_sum(disc, points[up], normals[up], count) - want).max() / want.max()
    assert error < tolerance


def test_one_beam_is_the_lamp():
    points, _ = scene()
    disc = Disc(centre=4 * TOWARD, axis=-TOWARD, radius=0.8, radiance=[1.0, 3.0])
    (beam,) = disc.beams(points, 1)
    lamp = next(disc.idealised().beams(points, 1))
    np.testing.assert_allclose(beam.irradiance, lamp.irradiance, rtol=1e-13)
    np.testing.assert_allclose(beam.distances, lamp.distances, rtol=1e-14)


def test_behind_it_and_on_it():
    disc = Disc(centre=[0, 0, 1], axis=[0, 0, -1], radius=1.0, radiance=1.0)
    up = np.array([0.0, 0.0, 1.0])
    points = np.array([[0, 0, 2.0], [3, 0, 1], [0.5, 0, 1], [0, 0, 1]])
    np.testing.assert_array_equal(disc.irradiance(points, up)[:, 0], [0.0, 0.0, np.nan, np.nan])
    np.testing.assert_array_equal(disc.irradiance(points, -up)[:, 0], [0.0, 0.0, np.nan, np.nan])
    assert np.isnan(disc.directions(points)[3]).all()
    assert all((b.irradiance[0] == 0).all() for b in disc.beams(points, 16))


@pytest.mark.parametrize(
    "change",
    [
        {"centre": [0.0, np.nan, 1.0]},
        {"centre": [0.0, 1.0]},
        {"axis": [0.0, 0.0, 0.0]},
        {"radius": 0.0},
        {"radius": -1.0},
        {"radius": np.nan},
        {"radius": np.inf},
        {"radius": np.array([1.0])},
        {"radiance": 0.0},
        {"radiance": [1.0, -1.0]},
        {"radiance": np.nan},
    ],
)
def test_numbers_that_mean_nothing_are_refused(change):
    with pytest.raises(RigError):
        Disc(**({"centre": [0, 0, 1], "axis": [0, 0, -1], "radius": 1.0, "radiance": 1.0} | change))
