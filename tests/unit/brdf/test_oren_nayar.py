import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.brdf import Lambert, OrenNayar, directional_reflectance

Z = np.array([0.0, 0.0, 1.0])
angle = st.floats(0.0, 1.57)
turn = st.floats(0.0, 2 * np.pi)


def toward(tilt, azimuth):
    return np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])


@settings(deadline=None)
@given(angle, angle, turn, st.floats(0.0, np.pi / 2))
def test_is_the_formula_in_angles(light, eye, azimuth, sigma):
    a = 1 - 0.5 * sigma**2 / (sigma**2 + 0.33)
    b = 0.45 * sigma**2 / (sigma**2 + 0.09)
    low, high = min(light, eye), max(light, eye)
    expected = 0.7 / np.pi * (a + b * max(0.0, np.cos(azimuth)) * np.sin(high) * np.tan(low))
    value = OrenNayar(albedo=0.7, roughness=sigma).evaluate(Z, toward(light, 0.3), toward(eye, 0.3 + azimuth))
    assert value.item() == pytest.approx(expected, rel=1e-12)


@settings(deadline=None)
@given(angle, angle, turn)
def test_without_roughness_it_is_lambert(light, eye, azimuth):
    scene = Z, toward(light, 0.0), toward(eye, azimuth)
    np.testing.assert_array_equal(
        OrenNayar(albedo=[0.2, 0.7], roughness=0.0).evaluate(*scene), Lambert(albedo=[0.2, 0.7]).evaluate(*scene)
    )


def test_slight_roughness_tends_to_lambert_in_the_second_order():
    scene = Z, toward(1.2, 0.0), toward(1.0, 0.4)
    matte = Lambert(albedo=0.5).evaluate(*scene)
    gaps = [np.abs(OrenNayar(albedo=0.5, roughness=s).evaluate(*scene) - matte).item() for s in (1e-2, 1e-3, 1e-4)]
    np.testing.assert_allclose(-np.diff(np.log10(gaps)), 2.0, atol=0.01)


def test_along_the_normal_every_light_shows_the_diffuse_albedo():
    brdf = OrenNayar(albedo=[0.8, 0.1], roughness=0.4)
    lights = np.stack([toward(t, t) for t in np.linspace(0.0, 1.55, 9)])
    np.testing.assert_allclose(np.pi * brdf.evaluate(Z, lights, Z), np.tile(brdf.diffuse_albedo, (9, 1)), rtol=1e-15)
    np.testing.assert_allclose(np.pi * brdf.evaluate(Z, Z, lights), np.tile(brdf.diffuse_albedo, (9, 1)), rtol=1e-15)


def test_is_flatter_than_lambert_and_brighter_toward_the_light():
    brdf = OrenNayar(albedo=0.6, roughness=0.5)
    light = toward(1.0, 0.0)
    back, side, ahead = (brdf.evaluate(Z, light, toward(1.0, a)).item() for a in (0.0, np.pi / 2, np.pi))
    assert back > 1.5 * side
    assert side == pytest.approx(ahead, rel=1e-15)


def test_no_share_exceeds_what_the_docstring_says():
    """At grazing incidence the share tends to albedo (A + B / 2); the worst roughness is 0.2, the factor 1.0152."""
    sigma = np.append(np.linspace(0.0, np.pi / 2, 60), 0.2)
    brdf = OrenNayar(albedo=1.0, roughness=sigma)
    a = 1 - 0.5 * sigma**2 / (sigma**2 + 0.33)
    b = 0.45 * sigma**2 / (sigma**2 + 0.09)
    grazing = directional_reflectance(brdf, np.radians(89.999), count=128)
    np.testing.assert_allclose(grazing, a + b / 2, rtol=3e-4)
    assert (a + b / 2).max() == pytest.approx(1.0152, abs=5e-5)
    others = directional_reflectance(brdf, np.radians([0.0, 30.0, 60.0, 80.0, 89.0]), count=128)
    assert (others <= np.maximum(a + b / 2, a) + 3e-4).all()
    safe = OrenNayar(albedo=0.985, roughness=0.2)
    assert directional_reflectance(safe, np.radians(89.9), count=200).max() <= 1.0 + 1e-6
