"""Phong's and Blinn's highlights."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf

from psstereo.brdf import BlinnPhong, Lambert, Phong, directional_reflectance

Z = np.array([0.0, 0.0, 1.0])
LOBES = [Phong, BlinnPhong]
EXPONENTS = np.array([0.0, 0.3, 1.0, 2.0, 8.8, 50.0, 1e3, 1e5])


def toward(tilt, azimuth):
    return np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])


@settings(deadline=None)
@given(st.floats(0.0, 1.55), st.floats(0.0, 1.55), st.floats(0.0, 2 * np.pi), st.floats(0.0, 300.0))
def test_are_the_formulas(light, eye, azimuth, exponent):
    sun, v = toward(light, 0.0), toward(eye, azimuth)
    mirrored = 2 * sun[2] * Z - sun
    half = (sun + v) / np.linalg.norm(sun + v)
    matte = 0.2 / np.pi
    phong = matte + 0.7 * (exponent + 2) / (2 * np.pi) * max(0.0, mirrored @ v) ** exponent * (mirrored @ v > 0)
    factor = (exponent + 2) * (exponent + 4) / (8 * np.pi * (exponent + 2 ** (-exponent / 2)))
    blinn = matte + 0.7 * factor * half[2] ** exponent
    options = {"diffuse": 0.2, "specular": 0.7, "exponent": exponent}
    assert Phong(**options).evaluate(Z, sun, v).item() == pytest.approx(phong, rel=1e-10)
    assert BlinnPhong(**options).evaluate(Z, sun, v).item() == pytest.approx(blinn, rel=1e-10)


@pytest.mark.parametrize("lobe", LOBES)
def test_along_the_normal_all_of_the_specular_share_is_reflected(lobe):
    brdf = lobe(diffuse=0.3, specular=0.6, exponent=EXPONENTS)
    rtol = np.where(EXPONENTS == 0.0, 5e-3, 1e-5)  # Phong's lobe has an edge there, which the rule does not know
    share = directional_reflectance(brdf, 1e-9, count=128)
    np.testing.assert_array_less(np.abs(share / 0.9 - 1), rtol)


@pytest.mark.parametrize("lobe", LOBES)
@pytest.mark.parametrize("incidence", [0.3, 1.0, 1.4])
def test_share_reflected_agrees_with_adaptive_quadrature(lobe, incidence):
    from scipy.integrate import dblquad

    brdf = lobe(diffuse=0.0, specular=1.0, exponent=6.0)
    light = toward(incidence, 0.0)

    def integrand(azimuth, tilt):
        return brdf.evaluate(Z, light, toward(tilt, azimuth)).item() * np.cos(tilt) * np.sin(tilt)

    whole, _ = dblquad(integrand, 0.0, np.pi / 2, 0.0, np.pi, epsabs=1e-8)
    assert directional_reflectance(brdf, incidence).item() == pytest.approx(2 * whole, rel=1e-6)


@pytest.mark.parametrize("lobe", LOBES)
def test_reflects_most_along_the_normal(lobe):
    exponents = np.concatenate([[0.01, 0.1], np.geomspace(0.5, 1e4, 14)])
    angles = np.radians([0.0, 10.0, 30.0, 50.0, 70.0, 85.0, 89.0, 89.9])
    shares = directional_reflectance(lobe(diffuse=0.0, specular=1.0, exponent=exponents), angles)
    assert (np.diff(shares, axis=0) <= 1e-6).all()


def test_sharp_lobes_fall_with_the_cosine_and_its_square():
    angles = np.radians([0.0, 30.0, 60.0, 80.0])
    options = {"diffuse": 0.0, "specular": 1.0, "exponent": 1e6}
    np.testing.assert_allclose(directional_reflectance(Phong(**options), angles)[:, 0], np.cos(angles), rtol=1e-3)
    blinn = directional_reflectance(BlinnPhong(**options), angles)[:, 0]
    np.testing.assert_allclose(blinn, np.cos(angles) ** 2, rtol=1e-3)


def test_the_usual_factor_of_blinn_reflects_more_than_it_receives():
    exponent = np.geomspace(0.1, 100.0, 2000)
    exact = BlinnPhong(diffuse=0.0, specular=1.0, exponent=exponent).evaluate(Z, Z, Z)
    excess = (exponent + 8) / (8 * np.pi) / exact
    assert excess.max() == pytest.approx(1.0752, abs=1e-4)
    assert exponent[excess.argmax()] == pytest.approx(8.8, abs=0.1)
    assert excess.min() >= 1.0


@pytest.mark.parametrize("exponent", [1e4, 1e8, 1e12])
@pytest.mark.parametrize("radii", [0.0, 0.5, 1.0, 4.0])
def test_sharp_lobes_keep_their_digits(exponent, radii):
    """The same powers in 60 digits, from the vectors as they are."""
    light = toward(0.7, 0.3)
    eye = toward(0.7 + radii * np.sqrt(2 / exponent), 0.3 + np.pi + radii * np.sqrt(1 / exponent))
    with mp.workdps(60):
        sun, v = ([mpf(float(x)) for x in vector] for vector in (light, eye))
        sun, v = ([x / mp.sqrt(sum(y * y for y in vector)) for x in vector] for vector in (sun, v))
        mirrored = [-sun[0], -sun[1], sun[2]]
        phong = sum(a * b for a, b in zip(mirrored, v, strict=True)) ** mpf(exponent) * (exponent + 2) / (2 * mp.pi)
        half = [a + b for a, b in zip(sun, v, strict=True)]
        cosine = half[2] / mp.sqrt(sum(x * x for x in half))
        blinn = cosine ** mpf(exponent) * (mpf(exponent) + 2) * (mpf(exponent) + 4) / (8 * mp.pi * exponent)
        expected = float(phong), float(blinn)
    options = {"diffuse": 0.0, "specular": 1.0, "exponent": exponent}
    values = [lobe(**options).evaluate(Z, light, eye).item() for lobe in LOBES]
    # A direction is given to 1e-16, which is 1e-16 √e of the lobe.
    np.testing.assert_allclose(values, expected, rtol=1e-14 + 4e-15 * np.sqrt(exponent))


@pytest.mark.parametrize("lobe", LOBES)
def test_without_a_highlight_it_is_lambert(lobe):
    scene = Z, toward(1.1, 0.0), toward(0.4, 2.0)
    brdf = lobe(diffuse=[0.2, 0.9], specular=0.0, exponent=50.0)
    np.testing.assert_array_equal(brdf.evaluate(*scene), Lambert(albedo=[0.2, 0.9]).evaluate(*scene))
    np.testing.assert_array_equal(brdf.diffuse_albedo, [0.2, 0.9])


@pytest.mark.parametrize("lobe", LOBES)
def test_shares_that_add_up_to_one_with_rounding_are_taken(lobe):
    lobe(diffuse=0.7, specular=0.3, exponent=1.0)
    lobe(diffuse=1 - 1e-16 - 0.9, specular=0.9, exponent=1.0)
