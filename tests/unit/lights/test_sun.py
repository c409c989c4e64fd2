import dataclasses
import math

import numpy as np
import pytest

from psstereo.errors import InputError, RigError
from psstereo.lights import Directional, Rig, Sun
from psstereo.radiometry import SUN_ANGULAR_RADIUS, cap_solid_angle

TOWARD = np.array([2.0, -1.0, 2.0]) / 3.0
SIDE = np.array([1.0, 0.0, -1.0]) / math.sqrt(2.0)


def at_angle(angles):
    """Return normals at angles from the sun's middle."""
    angles = np.asarray(angles)[..., None]
    return np.cos(angles) * TOWARD + np.sin(angles) * SIDE


def beam_sum(light, normals, count):
    return sum(b.irradiance * np.maximum(normals @ b.directions, 0.0)[..., None] for b in light.beams(normals, count))


@pytest.mark.parametrize("radius", [1e-6, SUN_ANGULAR_RADIUS, 0.3, 1.2, math.pi / 2])
def test_irradiance_is_the_sine_squared_times_the_cosine_while_it_is_up(radius):
    sun = Sun(direction=5 * TOWARD, radiance=[2.0, 3.0], angular_radius=radius)
    angles = np.linspace(0, math.pi / 2 - radius, 7)
    want = math.pi * math.sin(radius) ** 2 * np.cos(angles)[:, None] * [2.0, 3.0]
    np.testing.assert_allclose(sun.irradiance(np.zeros(3), at_angle(angles)), want, rtol=1e-13, atol=1e-15 * want.max())
    np.testing.assert_allclose(sun.strength, want[0], rtol=1e-15)


@pytest.mark.parametrize("radius", [SUN_ANGULAR_RADIUS, 0.3, 1.2])
def test_at_the_horizon_half_of_it_is_seen(radius):
    """Half a disc on the horizon gives a − sin a cos a, and the receiver turned the other way gives the same."""
    sun = Sun(direction=TOWARD, radiance=1.0, angular_radius=radius)
    angles = math.pi / 2 + np.array([-1.01, 0.0, 0.99, 1.01]) * radius
    got = sun.irradiance(np.zeros(3), at_angle(angles))[:, 0]
    want = radius - math.sin(radius) * math.cos(radius)
    assert got[1] == pytest.approx(want, rel=1e-9)
    assert got[0] > got[1] > got[2] > 0.0
    assert got[3] == 0.0


@pytest.mark.parametrize("radius", [1e-6, SUN_ANGULAR_RADIUS, 0.3, 1.2])
@pytest.mark.parametrize("count", [1, 2, 3, 4, 16, 100, 256])
def test_beams_are_exact_while_it_is_up(radius, count):
    sun = Sun(direction=TOWARD, radiance=[2.0, 3.0], angular_radius=radius)
    normals = at_angle(np.linspace(0, math.pi / 2 - radius, 5))[:-1]
    want = sun.irradiance(normals, normals)
    np.testing.assert_allclose(beam_sum(sun, normals, count), want, rtol=2e-13)


@pytest.mark.parametrize("radius", [SUN_ANGULAR_RADIUS, 0.3, 1.2])
def test_beams_fill_the_disc(radius):
    sun = Sun(direction=TOWARD, radiance=2.0, angular_radius=radius)
    beams = list(sun.beams(np.zeros((2, 3)), 256))
    assert abs(len(beams) - 256) < 20
    assert all(b.parallel and (b.irradiance > 0).all() for b in beams)
    off = [math.atan2(np.linalg.norm(np.cross(b.directions, TOWARD)), b.directions @ TOWARD) for b in beams]
    assert 0.95 * radius < max(off) < radius
    assert sum(float(b.irradiance[0]) for b in beams) == pytest.approx(2 * float(cap_solid_angle(radius)), rel=1e-13)


def test_beams_of_a_sun_under_the_horizon_tend_to_the_irradiance():
    sun = Sun(direction=TOWARD, radiance=1.0, angular_radius=0.3)
    normals = at_angle(math.pi / 2 + np.linspace(-0.25, 0.2, 7))
    want = sun.irradiance(normals, normals)
    errors = [np.abs(beam_sum(sun, normals, count) - want).max() / sun.strength[0] for count in (16, 256, 4096)]
    assert errors[0] > errors[1] > errors[2]
    assert errors[1] < 2e-3
    assert errors[2] < 2e-4


def test_a_narrower_disc_tends_to_a_direction_at_second_order():
    """L Ω n·l is too large by a² / 4, and the sun's own disc by 5.4e-6."""
    normals = at_angle(np.linspace(0, 1.3, 9))
    radii = np.array([0.2, 0.1, 0.05, 0.025])
    errors = []
    for radius in (*radii, SUN_ANGULAR_RADIUS):
        sun = Sun(direction=TOWARD, radiance=2.0, angular_radius=radius)
        narrow = Directional.sun(TOWARD, radiance=2.0, solid_angle=float(cap_solid_angle(radius)))
        ratio = narrow.irradiance(normals, normals) / sun.irradiance(normals, normals) - 1
        assert np.ptp(ratio) < 1e-14
        errors.append(float(ratio[0, 0]))
    np.testing.assert_allclose(errors[:4], radii**2 / 4, rtol=0.02)
    np.testing.assert_allclose(-np.diff(np.log2(errors[:4])), 2.0, rtol=0, atol=0.03)
    assert errors[4] == pytest.approx(SUN_ANGULAR_RADIUS**2 / 4, rel=1e-4)


def test_of_the_same_strength_it_differs_from_a_direction_at_the_horizon_only_and_at_first_order():
    normals = at_angle(np.linspace(0, math.pi, 40001))
    errors = []
    for radius in (0.1, 0.01):
        sun = Sun.of_irradiance(TOWARD, 1.0, radius)
        gap = np.abs(sun.irradiance(normals, normals) - sun.idealised().irradiance(normals, normals))[:, 0]
        up = np.abs(normals @ TOWARD) > math.sin(radius)
        assert gap[up].max() < 1e-14
        errors.append(gap.max())
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.02)


def test_of_irradiance_and_idealised():
    sun = Sun.of_irradiance([0, 0, 2.0], [1000.0, 800.0])
    assert sun.angular_radius == SUN_ANGULAR_RADIUS
    np.testing.assert_allclose(sun.strength, [1000.0, 800.0], rtol=1e-15)
    np.testing.assert_allclose(sun.radiance, np.array([1000.0, 800.0]) / (math.pi * math.sin(SUN_ANGULAR_RADIUS) ** 2))
    narrow = sun.idealised()
    assert isinstance(narrow, Directional)
    np.testing.assert_array_equal(narrow.strength, sun.strength)
    np.testing.assert_array_equal(Rig((sun,)).strengths(2), [sun.strength])


def test_strength_follows_from_the_rest():
    with pytest.raises(TypeError):
        Sun(direction=TOWARD, radiance=1.0, strength=1.0)
    sun = dataclasses.replace(Sun(direction=TOWARD, radiance=1.0), radiance=2.0)
    assert sun.strength[0] == pytest.approx(2 * math.pi * math.sin(SUN_ANGULAR_RADIUS) ** 2, rel=1e-15)


@pytest.mark.parametrize(
    "change",
    [
        {"direction": [0.0, 0.0, 0.0]},
        {"direction": [0.0, np.nan, 1.0]},
        {"radiance": 0.0},
        {"radiance": [1.0, -1.0]},
        {"radiance": np.nan},
        {"angular_radius": 0.0},
        {"angular_radius": -0.1},
        {"angular_radius": 1.58},
        {"angular_radius": np.nan},
        {"angular_radius": np.array([0.1])},
        {"angular_radius": 1e-200},  # so narrow that nothing is left of it
    ],
)
def test_numbers_that_mean_nothing_are_refused(change):
    with pytest.raises(RigError):
        Sun(**({"direction": TOWARD, "radiance": 1.0} | change))


def test_irradiances_that_mean_nothing_are_refused():
    for irradiance, radius in [(0.0, 0.1), (np.nan, 0.1), (1.0, 0.0), (1.0, np.nan)]:
        with pytest.raises(RigError):
            Sun.of_irradiance(TOWARD, irradiance, radius)
    with pytest.raises(InputError, match="cosine"):
        Sun(direction=TOWARD, radiance=1.0).irradiance(np.zeros(3), 3 * TOWARD)
