"""What one image tells of its light, against spheres whose light is known."""

import math

import numpy as np
import pytest
from scipy.integrate import dblquad

from psstereo.errors import InputError
from psstereo.sfs.estimators import (
    TiltRule,
    estimate_albedo_and_ambient,
    estimate_light,
    estimate_slant_and_albedo,
    estimate_tilt,
    first_moment,
    second_moment,
)


def sphere(slant, tilt, size=201, albedo=0.7, ambient=0.0):
    y, x = np.mgrid[1 : -1 : size * 1j, -1 : 1 : size * 1j]
    mask = x * x + y * y < 0.995
    z = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))
    light = math.sin(slant) * math.cos(tilt), math.sin(slant) * math.sin(tilt), math.cos(slant)
    image = albedo * np.maximum(x * light[0] + y * light[1] + z * light[2], 0.0) + ambient
    return np.where(mask, image, np.nan), mask


@pytest.mark.parametrize("slant", [0.0, 0.4, 1.2, 2.0])
def test_moments_are_those_of_the_sphere(slant):
    def integrand(power):
        # Over the hemisphere that is seen: the disc's area element is n_z times that of the sphere.
        def value(theta, phi):
            cosine = math.sin(slant) * math.sin(theta) * math.cos(phi) + math.cos(slant) * math.cos(theta)
            return max(cosine, 0.0) ** power * math.cos(theta) * math.sin(theta) / math.pi

        return dblquad(value, 0.0, 2.0 * math.pi, 0.0, math.pi / 2, epsabs=1e-6)[0]

    assert first_moment(slant) == pytest.approx(integrand(1), abs=1e-5)
    assert second_moment(slant) == pytest.approx(integrand(2), abs=1e-5)


@pytest.mark.parametrize("rule", TiltRule)
@pytest.mark.parametrize("tilt", [-2.5, 0.3, 1.9])
def test_tilt_of_a_sphere_is_found(rule, tilt):
    image, mask = sphere(0.7, tilt)
    found, clearness = estimate_tilt(image, mask, rule=rule)
    assert found == pytest.approx(tilt, abs=math.radians(1.0))
    assert 0.2 < clearness < 1.0


@pytest.mark.parametrize("slant", [0.2, 0.6, 1.0, 1.4])
def test_light_of_a_sphere_is_found(slant):
    image, mask = sphere(slant, 1.0)
    light = estimate_light(image, mask)
    truth = np.array([math.sin(slant) * math.cos(1.0), math.sin(slant) * math.sin(1.0), math.cos(slant)])
    assert math.degrees(math.acos(min(1.0, float(light.direction @ truth)))) < 3.0
    assert light.albedo == pytest.approx(0.7, rel=0.03)


def test_light_from_the_camera_has_no_tilt():
    image, mask = sphere(0.0, 0.0)
    light = estimate_light(image, mask)
    assert light.slant < 0.12  # the ratio of moments is flat there
    assert light.albedo == pytest.approx(0.7, rel=0.02)


def test_extreme_brightness_neither_overflows_nor_vanishes():
    image, mask = sphere(0.8, 0.0)
    for factor in (1e-200, 1e200):
        slant, albedo = estimate_slant_and_albedo(image * factor, mask)
        assert slant == pytest.approx(0.8, abs=0.05)
        assert albedo == pytest.approx(0.7 * factor, rel=0.03)


def test_albedo_and_ambient_come_from_the_extremes():
    image, mask = sphere(0.8, 0.0, albedo=0.6, ambient=0.1)
    albedo, ambient = estimate_albedo_and_ambient(image, mask)
    assert albedo == pytest.approx(0.6, abs=0.005)
    assert ambient == pytest.approx(0.1, abs=1e-9)


def test_images_that_say_nothing_are_refused():
    even = np.full((9, 9), 0.5)
    for estimate in (estimate_tilt, estimate_slant_and_albedo, estimate_albedo_and_ambient, estimate_light):
        with pytest.raises(InputError):
            estimate(even)
        with pytest.raises(InputError, match="None of 81 pixels"):
            estimate(even, np.zeros((9, 9), bool))
        with pytest.raises(InputError, match="shape"):
            estimate(even, np.ones((3, 3), bool))
    with pytest.raises(InputError, match="black"):
        estimate_slant_and_albedo(np.zeros((5, 5)))
    with pytest.raises(InputError, match="cancel"):
        estimate_tilt(*sphere(0.0, 0.0), rule=TiltRule.MEAN_GRADIENT)
    with pytest.raises(InputError, match="share"):
        estimate_albedo_and_ambient(even, share=0.7)
