import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.brdf import Lambert, LunarLambert, directional_reflectance, lunar_weight
from psstereo.errors import InputError

Z = np.array([0.0, 0.0, 1.0])
LAST = 103.948  # the cubic's only real root [deg]


def toward(tilt, azimuth):
    return np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])


def test_weight_zero_is_lambert():
    scene = Z, toward(1.1, 0.0), toward(0.4, 2.0)
    np.testing.assert_array_equal(
        LunarLambert(albedo=[0.2, 0.9], weight=0.0).evaluate(*scene), Lambert(albedo=[0.2, 0.9]).evaluate(*scene)
    )


@settings(deadline=None)
@given(st.floats(0.0, 1.57), st.floats(0.0, 1.57), st.floats(0.0, 2 * np.pi), st.floats(0.0, 1.0))
def test_radiance_is_mcewens(light, eye, azimuth, weight):
    i, e = np.cos(light), np.cos(eye)
    rho = LunarLambert(albedo=0.3, weight=weight).evaluate(Z, toward(light, 0.0), toward(eye, azimuth)).item()
    assert rho * i == pytest.approx(0.3 / np.pi * (2 * weight * i / (i + e) + (1 - weight) * i), rel=1e-12)


def test_weight_one_is_a_flat_disc_at_full_phase():
    """Lommel and Seeliger's law: light and eye in one direction, no limb darkening."""
    toward_both = np.stack([toward(t, 0.3) for t in np.linspace(0.0, 1.55, 20)])
    brdf = LunarLambert(albedo=0.2, weight=1.0)
    radiance = brdf.evaluate(Z, toward_both, toward_both)[:, 0] * toward_both[:, 2]
    np.testing.assert_allclose(radiance, 0.2 / np.pi, rtol=1e-14)


def test_weight_by_phase_angle():
    degrees = np.array([0.0, 30.0, 60.0, 90.0])
    expected = [1.0, 1 - 0.57 + 0.2178 - 0.03942, 1 - 1.14 + 0.8712 - 0.31536, 1 - 1.71 + 1.9602 - 1.06434]
    np.testing.assert_allclose(lunar_weight(np.radians(degrees)), expected, rtol=1e-12)
    for phase, weight in zip(np.radians(degrees[:3]), expected, strict=False):
        scene = Z, toward(phase / 2, 0.7), toward(phase / 2, 0.7 + np.pi)
        np.testing.assert_allclose(
            LunarLambert(albedo=0.2).evaluate(*scene),
            LunarLambert(albedo=0.2, weight=weight).evaluate(*scene),
            rtol=1e-12,
        )


@pytest.mark.parametrize("phase", [-0.1, 30.0, np.nan, [0.1, 30.0]])
def test_phase_angles_that_do_not_exist_are_refused(phase):
    with pytest.raises(InputError, match="phase angle"):
        lunar_weight(phase)


def test_weight_falls_to_nothing_and_stays_there():
    weights = lunar_weight(np.linspace(0.0, np.pi, 1000))
    assert (np.diff(weights) <= 0.0).all()
    assert lunar_weight(np.radians(LAST - 0.01)) > 0.0
    assert lunar_weight(np.radians(LAST + 0.01)) == 0.0
    assert weights[-1] == 0.0
    scene = Z, toward(1.2, 0.0), toward(1.2, np.pi)
    np.testing.assert_allclose(LunarLambert(albedo=0.2).evaluate(*scene), 0.2 / np.pi, rtol=1e-15)


@pytest.mark.parametrize("weight", [0.0, 0.3, 1.0])
def test_share_reflected_and_its_range(weight):
    i = np.array([1.0, 0.7, 0.3, 0.05, 1e-3])
    brdf = LunarLambert(albedo=1.0, weight=weight)
    shares = directional_reflectance(brdf, np.arccos(i))[:, 0]
    np.testing.assert_allclose(shares, 1 - weight + 4 * weight * (1 - i * np.log(1 + 1 / i)), rtol=1e-8)
    assert (shares <= 1 + 3 * weight + 1e-8).all()
    # The albedo that the docstring calls safe, and one that is not.
    grazing = np.radians(89.999)
    safe = LunarLambert(albedo=1 / (1 + 3 * weight), weight=weight)
    assert directional_reflectance(safe, grazing).item() <= 1.0 + 1e-9
    if weight > 0:
        bright = LunarLambert(albedo=1.01 / (1 + 3 * weight), weight=weight)
        assert directional_reflectance(bright, grazing).item() > 1.0


def test_share_reflected_with_the_moons_weight():
    shares = directional_reflectance(LunarLambert(albedo=1.0), np.radians([0.0, 89.999]), count=128)[:, 0]
    np.testing.assert_allclose(shares, [1.09, 1.71], atol=8e-3)


def test_diffuse_albedo_is_what_is_seen_along_the_normal():
    for weight in (None, 0.0, 0.7, [0.2, 1.0]):
        brdf = LunarLambert(albedo=[0.2, 0.1], weight=weight)
        np.testing.assert_allclose(np.pi * brdf.evaluate(Z, Z, Z), brdf.diffuse_albedo, rtol=1e-15)
