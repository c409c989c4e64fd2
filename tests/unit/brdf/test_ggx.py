import numpy as np
import pytest
from mpmath import mp, mpf

from psstereo.brdf import Ggx, Lambert, directional_reflectance

Z = np.array([0.0, 0.0, 1.0])


def toward(tilt, azimuth):
    return np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])


def textbook(light, eye, albedo, f0, roughness):
    """The model from angles, masking from Smith's Λ, in 60 digits."""
    with mp.workdps(60):
        sun, eye = ([mpf(float(x)) for x in vector] for vector in (light, eye))
        sun, eye = ([x / mp.sqrt(sum(y * y for y in vector)) for x in vector] for vector in (sun, eye))
        alpha = mpf(roughness) ** 2
        half = [a + b for a, b in zip(sun, eye, strict=True)]
        half = [x / mp.sqrt(sum(y * y for y in half)) for x in half]
        tan_h = mp.sqrt(half[0] ** 2 + half[1] ** 2) / half[2]
        facets = 1 / (mp.pi * alpha**2 * half[2] ** 4 * (1 + (tan_h / alpha) ** 2) ** 2)
        masks = [(mp.sqrt(1 + alpha**2 * (x[0] ** 2 + x[1] ** 2) / x[2] ** 2) - 1) / 2 for x in (sun, eye)]
        fresnel = [
            f0 + (1 - mpf(f0)) * (1 - x) ** 5
            for x in (sum(a * b for a, b in zip(sun, half, strict=True)), sun[2], eye[2])
        ]
        mirrors = facets * fresnel[0] / (1 + masks[0] + masks[1]) / (4 * sun[2] * eye[2])
        return float(mirrors + (1 - fresnel[1]) * (1 - fresnel[2]) * mpf(albedo) / mp.pi)


@pytest.mark.parametrize("roughness", [1.0, 0.5, 0.1, 0.01, 1e-3])
@pytest.mark.parametrize("incidence", [0.0, 0.7, 1.5, np.radians(89.9), np.pi / 2 - 1e-6])
@pytest.mark.parametrize("widths", [0.0, 1e-3, 0.3, 1.0, 30.0])
def test_agrees_with_the_textbook_in_many_digits(roughness, incidence, widths):
    """In the lobe's tip, on its flank and far away, at grazing incidence and nearly mirrors."""
    away = min(widths * roughness**2, 0.2) * np.cos(incidence)
    light, eye = toward(incidence, 0.4), toward(incidence - away, 0.4 + np.pi + away)
    value = Ggx(albedo=0.5, f0=0.04, roughness=roughness).evaluate(Z, light, eye).item()
    # The half vector's slope is known to 1e-16 / n·H: this much of the lobe's width.
    tolerance = 1e-12 + 1e-15 / (roughness**2 * np.cos(incidence))
    assert value == pytest.approx(textbook(light, eye, 0.5, 0.04, roughness), rel=tolerance, abs=0.0)


def test_the_tip_of_the_lobe_is_finite():
    """Mirror directions at roughness 0.001: D = 1 / (π α²), with α² = 1e-12."""
    for incidence in (0.0, 0.5, 1.2, 1.5):
        value = Ggx(albedo=0.0, f0=1.0, roughness=1e-3).evaluate(
            Z, toward(incidence, 1.0), toward(incidence, 1 + np.pi)
        )
        assert value.item() == pytest.approx(1e12 / (4 * np.pi * np.cos(incidence) ** 2), rel=1e-6)


def test_roughest_metal_along_the_normal():
    """At α = 1 the share is ∫ 2 sin cos³ … = 1 − log 2 in closed form."""
    metal = Ggx(albedo=0.0, f0=1.0, roughness=1.0)
    assert directional_reflectance(metal, 0.0).item() == pytest.approx(1 - np.log(2), rel=1e-10)


def test_nearly_smooth_metal_reflects_everything():
    metal = Ggx(albedo=0.0, f0=1.0, roughness=[0.1, 0.03, 0.01])
    shares = directional_reflectance(metal, np.radians([0.0, 20.0, 60.0]), count=160)
    np.testing.assert_allclose(shares, 1.0, atol=3e-4)


def test_metals_lose_what_the_docstring_says():
    metal = Ggx(albedo=0.0, f0=1.0, roughness=[0.5, 1.0])
    np.testing.assert_allclose(directional_reflectance(metal, 0.0), [0.916, 0.307], atol=5e-4)


def test_no_roughness_and_incidence_reflect_more_than_they_receive():
    """The sum is convex in F₀ and linear in albedo, so that F₀ = 0 and 1 with a white body are the worst."""
    roughness = np.concatenate([[1e-2], np.geomspace(0.03, 1.0, 16)])
    angles = np.radians([0.0, 15.0, 30.0, 45.0, 55.0, 65.0, 72.0, 78.0, 82.0, 85.0, 87.0, 88.0, 89.0, 89.5, 89.9])
    for f0 in (0.0, 0.5, 1.0):
        shares = directional_reflectance(Ggx(albedo=1.0, f0=f0, roughness=roughness), angles, count=72)
        assert shares.max() < 1.0 + 1e-6  # the quadrature of the sharpest
        assert shares[:, 1:].max() < 1.0


def test_white_body_without_mirrors_reflects_twenty_of_twenty_one():
    body = Ggx(albedo=1.0, f0=0.0, roughness=1e-2)
    assert directional_reflectance(body, 0.0).item() == pytest.approx(20 / 21, rel=1e-6)


def test_diffuse_albedo_is_that_of_the_body_under_light_and_eye_on_the_normal():
    rough = {"f0": [0.04, 0.5, 1.0], "roughness": 0.7}
    with_body = Ggx(albedo=0.6, **rough)
    body = with_body.evaluate(Z, Z, Z) - Ggx(albedo=0.0, **rough).evaluate(Z, Z, Z)
    np.testing.assert_allclose(with_body.diffuse_albedo, np.pi * body, rtol=1e-12, atol=1e-15)


def test_far_from_the_lobe_it_is_nearly_its_body():
    scene = Z, toward(0.5, 0.0), toward(0.5, 0.0)
    shiny = Ggx(albedo=0.6, f0=0.0, roughness=0.05).evaluate(*scene).item()
    assert shiny == pytest.approx(Lambert(albedo=0.6).evaluate(*scene).item(), rel=1e-3)
