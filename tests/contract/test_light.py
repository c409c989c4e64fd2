"""What every light promises; a new one is tested by being listed in the catalogue."""

import dataclasses
import itertools
import pickle

import numpy as np
import pytest

from psstereo.errors import PsstereoError, RigError, UnsupportedError
from psstereo.lights import (
    LIGHTS,
    Ambient,
    Directional,
    Disc,
    Environment,
    Harmonics,
    Led,
    Polygon,
    Sun,
    Total,
)

DIRECTION = np.array([0.3, -0.5, 0.9])
PANEL = 10 * DIRECTION + np.array([[1.0, 0.8, 0.0], [1.2, -0.7, 0.1], [-1.0, -0.8, 0.0], [-1.2, 0.7, -0.1]])
FIELD = np.array([1.0, -0.2, 0.3, 0.1, 0.05, -0.1, 0.1, 0.02, 0.08])
ROWS, COLUMNS = np.mgrid[0.5:32, 0.5:64]
SKY = 1.7 + np.cos(ROWS * np.pi / 32) + 0.5 * np.sin(2 * np.pi * COLUMNS / 64)

# One maker a light: a light of any channels whose irradiance is in proportion to its strength (c,).
MAKERS = {
    "directional": lambda strength: Directional(direction=DIRECTION, strength=strength),
    "led": lambda strength: Led(position=10 * DIRECTION, axis=-DIRECTION + [0.1, 0, 0], mu=1.5, flux=strength),
    "sun": lambda strength: Sun(direction=DIRECTION, radiance=strength, angular_radius=0.15),
    "disc": lambda strength: Disc(centre=10 * DIRECTION, axis=[-0.4, 0.5, -0.9], radius=1.5, radiance=strength),
    "polygon": lambda strength: Polygon(vertices=PANEL, radiance=strength),
    "ambient": lambda strength: Ambient(radiance=strength),
    "harmonics": lambda strength: Harmonics(coefficients=np.multiply.outer(FIELD, strength)),
    "environment": lambda strength: Environment(radiance=np.multiply.outer(SKY, strength)),
    "sum": lambda strength: Total(
        lights=(Directional(direction=DIRECTION, strength=strength), Ambient(radiance=strength))
    ),
}
EVERYWHERE = ["ambient", "environment", "harmonics", "sum"]
"""Lights from all around, which have no direction and which every horizon cuts."""
BOUNDED = sorted(set(LIGHTS) - set(EVERYWHERE))
NARROW = [name for name in BOUNDED if not LIGHTS[name].extended]
"""Lights from one direction at each point, to which max(0, n·l) applies."""


def maker(name):
    assert name in MAKERS, "say how to make one"
    return MAKERS[name]


@pytest.fixture(params=sorted(LIGHTS))
def make(request):
    return maker(request.param)


@pytest.fixture(params=BOUNDED)
def make_bounded(request):
    return maker(request.param)


@pytest.fixture(params=NARROW)
def make_narrow(request):
    return maker(request.param)


def scene(shape=(7, 5), seed=0):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(*shape, 3))
    return rng.uniform(-1, 1, (*shape, 3)), normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def rounding(light):
    """Return how close results that are equal on paper must be: one product, or the sums over an extent."""
    return 1e-13 if light.extended else 1e-15


def cosines(beam, normals):
    return (np.broadcast_to(beam.directions, normals.shape) * normals).sum(axis=-1)


def beam_sum(light, points, normals, count):
    beams = light.beams(points, count)
    return sum(beam.irradiance * np.maximum(cosines(beam, normals), 0.0)[..., None] for beam in beams)


def wholly_up(light, points, normals):
    """Return where all of a light is above the surface's horizon, with a margin for what is between the beams."""
    return np.min([cosines(beam, normals) for beam in light.beams(points, 1024)], axis=0) > 0.05


def rotation(seed):
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return turn * np.linalg.det(turn)


def outcome(call):
    """Return what a call returns or, if it refuses, the error."""
    try:
        return call()
    except PsstereoError as error:
        return error


def test_directions_are_of_unit_length_and_one_a_point(make_bounded):
    points, _ = scene()
    directions = make_bounded(1.0).directions(points)
    assert directions.shape == points.shape
    assert directions.dtype == np.float64
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1.0, rtol=0, atol=4e-16)


@pytest.mark.parametrize("name", EVERYWHERE)
def test_light_from_everywhere_has_no_direction(name):
    points, _ = scene()
    directions = maker(name)(1.0).directions(points)
    assert directions.shape == points.shape
    assert np.isnan(directions).all()


def test_irradiance_has_one_value_a_channel_and_none_from_behind(make_narrow):
    points, normals = scene()
    light = make_narrow(np.array([1.0, 2.0, 5.0]))
    irradiance = light.irradiance(points, normals)
    facing = (light.directions(points) * normals).sum(axis=-1)
    assert irradiance.shape == (7, 5, 3)
    assert (irradiance >= 0).all()
    np.testing.assert_array_equal(irradiance[..., 0] > 0, facing > 0)
    assert 5 < np.count_nonzero(facing > 0) < 30
    np.testing.assert_allclose(irradiance, irradiance[..., :1] * [1.0, 2.0, 5.0], rtol=1e-15)


@pytest.mark.parametrize("strength", [2.0, [2.0], [1.0, 2.0, 5.0]])
def test_irradiance_has_as_many_channels_as_the_light(make, strength):
    points, normals = scene()
    light = make(np.array(strength))
    irradiance = light.irradiance(points, normals)
    assert light.channels == np.size(strength)
    assert irradiance.shape == (7, 5, light.channels)
    assert irradiance.dtype == np.float64
    one = make(1.0).irradiance(points, normals)
    np.testing.assert_allclose(irradiance, one * strength, rtol=rounding(light))


def test_irradiance_is_positive_where_a_beam_arrives_and_nearly_none_where_none_does(make):
    points, normals = scene((40, 25))
    light = make(np.array([1.0, 2.0]))
    irradiance = light.irradiance(points, normals)
    reached = np.max([(b.irradiance[..., 0] > 0) * cosines(b, normals) for b in light.beams(points, 256)], axis=0) > 0
    assert (irradiance >= 0).all()
    assert (irradiance[reached] > 0).all()
    assert np.count_nonzero(reached) > 300
    assert (irradiance[~reached] < 1e-3 * irradiance.max(axis=(0, 1))).all()


def test_irradiance_is_linear_in_strength(make):
    points, normals = scene()
    one, two, both = (make(s).irradiance(points, normals) for s in (0.3, 1.9, 0.3 + 1.9))
    np.testing.assert_allclose(one + two, both, rtol=rounding(make(1.0)))


def test_irradiance_follows_the_cosine(make_narrow):
    """The largest irradiance is that of a surface that faces the light; tilted by t it is cos t times as much."""
    point = np.array([0.2, 0.1, -0.3])
    light = make_narrow(3.0)
    toward = light.directions(point)
    side = np.cross(toward, [0, 0, 1.0])
    side /= np.linalg.norm(side)
    full = light.irradiance(point, toward)
    for tilt in (0.3, 1.0, 1.5):
        tilted = np.cos(tilt) * toward + np.sin(tilt) * side
        np.testing.assert_allclose(light.irradiance(point, tilted), full * np.cos(tilt), rtol=1e-14)


def test_irradiance_is_linear_in_the_normal_while_the_light_is_up(make_bounded):
    """E = n · F with one vector F a point, for whatever is wholly above the horizon."""
    light = make_bounded(3.0)
    point = np.array([0.2, 0.1, -0.3])
    _, normals = scene((3000,))
    points = np.broadcast_to(point, normals.shape)
    up = wholly_up(light, points, normals)
    irradiance = light.irradiance(points[up], normals[up])[:, 0]
    vector = np.linalg.lstsq(normals[up], irradiance, rcond=None)[0]
    assert np.count_nonzero(up) > 800
    np.testing.assert_allclose(normals[up] @ vector, irradiance, rtol=0, atol=1e-13 * irradiance.max())


def test_any_shape_of_points(make):
    light = make(np.array([1.0, 2.0]))
    points, normals = scene()
    whole = light.irradiance(points, normals)
    np.testing.assert_allclose(light.irradiance(points[2, 3], normals[2, 3]), whole[2, 3], rtol=rounding(light))
    np.testing.assert_allclose(light.irradiance(points[2], normals[2]), whole[2], rtol=rounding(light))
    assert light.directions(points[0, 0]).shape == (3,)


def test_what_is_not_known_stays_so(make):
    light = make(np.array([1.0, 2.0]))
    points, normals = scene()
    want = light.irradiance(points, normals)
    normals[2, 3] = want[2, 3] = np.nan
    np.testing.assert_allclose(light.irradiance(points, normals), want, rtol=rounding(light))
    assert np.isnan(light.irradiance(points[2, 3], normals[2, 3])).all()


def test_light_that_is_not_positional_is_the_same_everywhere(make):
    light = make(1.0)
    points, normals = scene()
    here, there = light.irradiance(points, normals), light.irradiance(points + 3.0, normals)
    if light.positional:
        assert np.abs(here - there).max() > 1e-3 * here.max()
    else:
        np.testing.assert_array_equal(here, there)
    assert not (light.distant and light.positional)


# ---- beams ---------------------------------------------------------------------------------------------------------


def test_beams_are_directions_with_an_irradiance_and_always_the_same(make):
    points, _ = scene()
    light = make(np.array([1.0, 2.0, 5.0]))
    beams, again = (list(light.beams(points, 64)) for _ in range(2))
    assert len(beams) == len(again)
    assert len(beams) == 1 if not light.extended else 32 <= len(beams) <= 140
    for beam, same in zip(beams, again, strict=True):
        assert beam.directions.shape in {(3,), points.shape}
        assert beam.irradiance.shape in {(3,), points.shape}
        assert np.ndim(beam.distances) == 0 or np.shape(beam.distances) == points.shape[:-1]
        np.testing.assert_allclose(np.linalg.norm(beam.directions, axis=-1), 1.0, rtol=0, atol=5e-16)
        assert (beam.irradiance >= 0).all()
        assert (np.asarray(beam.distances) > 0).all()
        assert beam.parallel or light.positional
        np.testing.assert_array_equal(beam.directions, same.directions)
        np.testing.assert_array_equal(beam.irradiance, same.irradiance)
        np.testing.assert_array_equal(beam.distances, same.distances)


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_few_beams_still_carry_the_light(make, count):
    points, normals = scene()
    light = make(1.0)
    want = light.irradiance(points, normals)
    assert np.abs(beam_sum(light, points, normals, count) - want).max() < 0.5 * want.max()


def test_beams_add_up_to_the_irradiance_while_the_light_is_up(make_bounded):
    points, normals = scene((40, 25))
    light = make_bounded(np.array([1.0, 2.0]))
    up = wholly_up(light, points, normals)
    assert np.count_nonzero(up) > 250
    want = light.irradiance(points[up], normals[up])
    errors = [np.abs(beam_sum(light, points[up], normals[up], n) / want - 1).max() for n in (4, 16, 64, 256)]
    assert errors[-1] < 1e-9
    assert all(fine <= max(coarse, 1e-13) for coarse, fine in itertools.pairwise(errors))


def test_beams_tend_to_the_irradiance_also_where_the_horizon_cuts_the_light(make):
    points, normals = scene((40, 25))
    light = make(np.array([1.0, 2.0]))
    want = light.irradiance(points, normals)
    sums = [beam_sum(light, points, normals, count) for count in (16, 128, 1024)]
    errors = [np.sqrt(((s - want) ** 2).mean()) / want.max() for s in sums]
    if light.extended:
        assert errors[0] > errors[1] > errors[2]
        assert errors[1] < 1e-2
        assert errors[2] < 1e-3
    else:
        assert max(errors) < 1e-15


# ---- motions -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_moved_light_does_to_a_moved_scene_what_it_did(make, seed):
    points, normals = scene((40, 25))
    light, turn, shift = make(np.array([1.0, 2.0])), rotation(seed), np.array([3.0, -20.0, 7.0])
    moved = light.moved(turn, shift)
    assert type(moved) is type(light)
    want = light.irradiance(points, normals)
    got = moved.irradiance(points @ turn.T + shift, normals @ turn.T)
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-12 * want.max())
    turned = moved.directions(points @ turn.T + shift)
    np.testing.assert_allclose(turned, light.directions(points) @ turn.T, rtol=0, atol=1e-14)


def test_a_mirrored_light_is_refused_or_right(make):
    """Never a light whose lit side has turned over."""
    points, normals = scene()
    light, mirror = make(1.0), np.diag([1.0, 1.0, -1.0])
    moved = outcome(lambda: light.moved(mirror, np.zeros(3)))
    if isinstance(moved, PsstereoError):
        assert "rotation" in moved.needed
        return
    np.testing.assert_allclose(
        moved.irradiance(points @ mirror, normals @ mirror), light.irradiance(points, normals), rtol=1e-13
    )


def test_idealised_is_a_sun_or_lamp_or_refused(make):
    points, normals = scene((40, 25))
    light = make(np.array([1.0, 2.0]))
    ideal = outcome(light.idealised)
    if isinstance(ideal, UnsupportedError):
        assert light.name in ideal.given
        assert light.name in EVERYWHERE
        return
    assert isinstance(ideal, Directional | Led)
    assert ideal.distant == light.distant
    assert ideal.channels == light.channels
    up = wholly_up(light, points, normals)
    want = light.irradiance(points, normals)[up]
    np.testing.assert_allclose(ideal.irradiance(points, normals)[up], want, rtol=0, atol=0.05 * want.max())


# ---- values --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf, [1.0, 0.0, 1.0], [[1.0]]])
def test_strengths_that_mean_nothing_are_refused(make, bad):
    with pytest.raises(RigError) as caught:
        make(bad)
    assert caught.value.given
    assert caught.value.remedy


def own_arrays(light):
    """Return the arrays that a light is made of, those of its parts included."""
    for field in dataclasses.fields(light):
        value = getattr(light, field.name)
        if isinstance(value, np.ndarray):
            yield value
        elif isinstance(value, tuple):
            for part in value:
                yield from own_arrays(part)


def test_lights_pickle_and_cannot_be_changed(make):
    light = make(np.array([1.0, 2.0]))
    points, normals = scene()
    again = pickle.loads(pickle.dumps(light))
    np.testing.assert_array_equal(again.irradiance(points, normals), light.irradiance(points, normals))
    arrays = list(own_arrays(light))
    assert len(arrays) >= (1 if light.extended else 2)
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
