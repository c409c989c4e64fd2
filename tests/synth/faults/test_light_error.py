"""Errors of calibration."""

from dataclasses import dataclass

import numpy as np
import pytest

from psstereo.errors import OptionError, UnsupportedError
from psstereo.lights import Led, Rig
from psstereo.lights.disc import Disc
from psstereo.lights.harmonics import Harmonics
from psstereo.lights.sun import Sun
from psstereo_synth import spiral
from psstereo_synth.faults import Draws, LightError

MANY = np.concatenate([spiral(4000), -np.eye(3), np.eye(3)])


def angles(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))


@pytest.mark.parametrize("rms", [1e-9, 0.01, 0.2])
def test_directions_turn_by_the_angle_that_was_asked_for(rms):
    true = Rig.distant(MANY, np.full(len(MANY), 3.0))
    rig = LightError(direction=rms).rig(true, Draws(1))
    turned = angles(true.directions, rig.directions)
    assert np.sqrt((turned**2).mean()) == pytest.approx(rms, rel=0.03)
    assert np.median(turned) == pytest.approx(rms * np.sqrt(np.log(2)), rel=0.04)  # Rayleigh
    np.testing.assert_array_equal(rig.strengths(1), 3.0)


def test_directions_turn_to_all_sides():
    true = Rig.distant(np.tile([0.3, -0.2, 0.9], (5000, 1)))
    off = LightError(direction=0.01).rig(true, Draws(3)).directions - true.directions
    spread = np.linalg.eigvalsh(off.T @ off / len(off))
    assert spread[0] < 1e-8  # none along the light
    np.testing.assert_allclose(spread[1:], 0.5e-4, rtol=0.06)
    assert np.abs(off.mean(axis=0)).max() < 4 * 0.01 / np.sqrt(2 * 5000)


def lamps(count, position=(10.0, 20.0, 30.0)):
    axis = np.array([0.0, 0.1, -1.0])
    return tuple(Led(position=np.array(position), axis=axis, mu=2.0, flux=[1.0, 2.0]) for _ in range(count))


def test_lamps_are_displaced_by_the_distance_that_was_asked_for():
    rig = LightError(position=0.5).rig(Rig(lamps(4000)), Draws(2))
    off = np.array([light.position for light in rig.lights]) - [10.0, 20.0, 30.0]
    assert np.sqrt((off**2).sum(axis=1).mean()) == pytest.approx(0.5, rel=0.02)
    np.testing.assert_allclose(np.cov(off.T), np.eye(3) * 0.25 / 3, atol=0.006)
    for light in rig.lights[:5]:
        np.testing.assert_allclose(light.axis, lamps(1)[0].axis, atol=1e-15)
        assert light.mu == 2.0
        np.testing.assert_array_equal(light.flux, [1.0, 2.0])


@pytest.mark.parametrize("spread", [0.01, 0.5])
def test_strengths_are_off_by_what_was_asked_for(spread):
    true = Rig.distant(np.tile([0, 0, 1.0], (8000, 1)), np.tile([2.0, 5.0], (8000, 1)))
    rig = LightError(strength=spread).rig(true, Draws(4))
    factors = rig.strengths(2) / [2.0, 5.0]
    np.testing.assert_allclose(factors[:, 0], factors[:, 1], rtol=1e-14)  # the same for all channels
    assert factors[:, 0].mean() == pytest.approx(1.0, abs=4 * spread / np.sqrt(8000))
    assert factors[:, 0].std() == pytest.approx(spread, rel=0.05)
    assert (factors > 0).all()
    np.testing.assert_array_equal(rig.directions, true.directions)
    dimmed = LightError(strength=spread).rig(Rig(lamps(3)), Draws(4))
    np.testing.assert_allclose(dimmed.lights[1].flux, np.array([1.0, 2.0]) * factors[1, 0], rtol=1e-14)


def test_one_error_leaves_the_draws_of_another_as_they_are():
    true = Rig.distant(spiral(5))
    alone, both = (LightError(direction=0.1, strength=s).rig(true, Draws(0)) for s in (0.0, 0.2))
    np.testing.assert_allclose(alone.directions, both.directions, rtol=0, atol=1e-15)
    fewer = LightError(direction=0.1).rig(true.select([0, 1]), Draws(0))
    np.testing.assert_array_equal(fewer.directions, alone.directions[:2])


def test_a_mixed_rig_takes_each_error_where_it_belongs():
    true = Rig((*lamps(2), *Rig.distant(spiral(2)).lights))
    rig = LightError(direction=0.1, position=0.5).rig(true, Draws(0))
    assert 0.01 < np.linalg.norm(rig.lights[0].position - true.lights[0].position) < 3
    assert 0.001 < np.linalg.norm(rig.lights[2].direction - true.lights[2].direction) < 1


def test_errors_that_meet_no_light_are_refused():
    with pytest.raises(UnsupportedError, match="2 lights with a position and 0 without"):
        LightError(direction=0.1).rig(Rig(lamps(2)), Draws(0))
    with pytest.raises(UnsupportedError, match="0 lights with a position and 3 without"):
        LightError(position=0.1).rig(Rig.distant(spiral(3)), Draws(0))


@pytest.mark.parametrize(
    "light",
    [
        Sun.of_irradiance([0.1, 0.2, 0.9], [3.0, 4.0]),
        Disc(centre=np.array([0.0, 1.0, 8.0]), axis=np.array([0.0, 0, -1]), radius=0.5, radiance=[2.0, 5.0]),
        Harmonics(coefficients=np.array([3.0, 0.1, 0.2, 0.3, 0, 0, 0, 0, 0]).reshape(9, 1)),
    ],
    ids=lambda light: light.name,
)
def test_lights_of_other_kinds_get_their_factor(light):
    points, normals = np.zeros((2, 3)), np.array([[0, 0, 1.0], [0.6, 0, 0.8]])
    (wrong,) = LightError(strength=0.3).rig(Rig((light,)), Draws(0)).lights
    ratio = wrong.irradiance(points, normals) / light.irradiance(points, normals)
    assert abs(ratio[0, 0] - 1) > 0.01
    np.testing.assert_allclose(ratio, ratio[0, 0], rtol=1e-13)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Torch(Led):
    """A lamp with a second number that a factor could go to."""

    radiance: float = 1.0


class _Sky:
    """Light from everywhere, as far as this fault looks at it."""

    positional = False

    def __init__(self):
        self.turns = []

    def directions(self, points):
        return np.full(points.shape, np.nan)

    def moved(self, rotation, translation):
        assert (translation == 0).all()
        self.turns.append(rotation)
        return self


def test_a_light_with_two_strengths_is_refused():
    led = lamps(1)[0]
    torch = _Torch(position=led.position, axis=led.axis, mu=led.mu, flux=led.flux)
    with pytest.raises(UnsupportedError, match="has 2 strengths"):
        LightError(strength=0.1).rig(Rig((torch,)), Draws(0))


def test_light_from_everywhere_is_turned():
    sky = _Sky()
    LightError(direction=0.1).rig(Rig((sky,)), Draws(0))
    (turn,) = sky.turns
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    assert 1e-4 < np.arccos((np.trace(turn) - 1) / 2) < 0.5


@pytest.mark.parametrize("options", [{"direction": np.pi}, {"direction": 4.0}, {"position": -1.0}], ids=str)
def test_bad_sizes_are_refused(options):
    with pytest.raises(OptionError):
        LightError(**options)
