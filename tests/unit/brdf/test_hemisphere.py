from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from scipy.integrate import quad

from psstereo.brdf import BlinnPhong, Brdf, Ggx, Lambert, Phong, directional_reflectance, reciprocity_gap
from psstereo.errors import InputError


@dataclass(frozen=True, kw_only=True, eq=False)
class Power(Brdf):
    """ρ = (n·l)^a (n·v)^b: in closed form, and not reciprocal unless a = b."""

    name: ClassVar[str] = "power"
    a: float
    b: float

    @property
    def channels(self):
        return 1

    def evaluate(self, normals, to_light, to_eye):
        light = np.maximum((normals * to_light).sum(axis=-1), 0.0)
        eye = np.maximum((normals * to_eye).sum(axis=-1), 0.0)
        return (light**self.a * eye**self.b)[..., None]


@pytest.mark.parametrize("angle", [0.0, 1e-8, 0.3, np.pi / 4, 1.2, np.radians(89.9), np.pi / 2 - 1e-9])
def test_smooth_models_to_all_digits(angle):
    matte = directional_reflectance(Lambert(albedo=[0.3, 1.0]), angle)
    np.testing.assert_allclose(matte, [0.3, 1.0], rtol=1e-12)
    for b in (1.0, 2.5):
        share = directional_reflectance(Power(a=1.0, b=b), angle).item()
        assert share == pytest.approx(np.cos(angle) * 2 * np.pi / (b + 2), rel=1e-9)


@pytest.mark.parametrize("exponent", [1.0, 100.0, 1e4, 1e6])
def test_highlights_along_the_normal_against_one_dimensional_quadrature(exponent):
    """Both lobes are round about the normal there: 2π ∫ ρ cos sin, over 60 radii of the lobe."""
    for brdf, radius in (
        (Phong(diffuse=0.0, specular=1.0, exponent=exponent), np.sqrt(2 / exponent)),
        (BlinnPhong(diffuse=0.0, specular=1.0, exponent=exponent), np.sqrt(8 / exponent)),
    ):

        def integrand(tilt, brdf=brdf):
            eye = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
            rho = brdf.evaluate(np.array([0, 0, 1.0]), np.array([0, 0, 1.0]), eye).item()
            return 2 * np.pi * rho * np.cos(tilt) * np.sin(tilt)

        end = min(60 * radius, np.pi / 2)
        expected, _ = quad(integrand, 0.0, end, epsrel=1e-11, limit=400)
        assert directional_reflectance(brdf, 0.0, count=160).item() == pytest.approx(expected, rel=2e-6)


@pytest.mark.parametrize("angle", [0.0, 0.8, 1.5, np.radians(89.9)])
@pytest.mark.parametrize("roughness", [1.0, 0.3, 0.1, 0.03])
def test_more_points_change_nothing(angle, roughness):
    brdf = Ggx(albedo=0.5, f0=0.5, roughness=roughness)
    few, many = (directional_reflectance(brdf, angle, count=n).item() for n in (96, 150))
    assert few == pytest.approx(many, rel=1e-7)


def test_shape_of_the_answer():
    brdf = Lambert(albedo=[0.1, 0.2, 0.3])
    assert directional_reflectance(brdf, 0.1, count=8).shape == (3,)
    assert directional_reflectance(brdf, np.zeros((2, 4)), count=8).shape == (2, 4, 3)
    assert directional_reflectance(brdf, np.zeros(0), count=8).shape == (0, 3)


@pytest.mark.parametrize("bad", [-0.1, np.pi / 2 + 1e-9, np.nan, np.inf, [0.1, 45.0]])
def test_incidences_that_mean_nothing_are_refused(bad):
    with pytest.raises(InputError, match="radians"):
        directional_reflectance(Lambert(albedo=0.5), bad)


def test_too_few_points_are_refused():
    with pytest.raises(InputError, match="1 points"):
        directional_reflectance(Lambert(albedo=0.5), 0.1, count=1)
    with pytest.raises(InputError, match="0 pairs"):
        reciprocity_gap(Lambert(albedo=0.5), count=0)


@pytest.mark.parametrize(("exponent", "gap"), [(1e4, 1e-6), (1e8, 2e-6), (1e12, 3e-4)])
@pytest.mark.parametrize("angle", [0.0, 0.5, 1.0, np.radians(89.9)])
def test_sharp_highlights_to_what_the_docstring_says(angle, exponent, gap):
    for lobe in (Phong, BlinnPhong):
        brdf = lobe(diffuse=0.0, specular=1.0, exponent=exponent)
        usual, many = (directional_reflectance(brdf, angle, count=n).item() for n in (96, 300))
        assert usual == pytest.approx(many, rel=gap)


def test_models_that_are_not_reciprocal_are_found_out():
    assert reciprocity_gap(Power(a=1.0, b=1.0)) == 0.0
    assert reciprocity_gap(Power(a=1.0, b=0.0)) > 0.9
    assert 1e-8 < reciprocity_gap(Power(a=1.0 + 1e-8, b=1.0)) < 1e-6
