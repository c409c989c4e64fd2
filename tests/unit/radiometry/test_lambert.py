import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.radiometry import albedo_from_brdf, brdf_from_albedo, lambertian_exitance, lambertian_radiance


def test_exitance_is_the_radiance_over_the_hemisphere():
    nodes, weights = np.polynomial.legendre.leggauss(8)
    polar = (nodes + 1) * np.pi / 4
    hemisphere = 2 * np.pi * np.sum(weights * np.pi / 4 * np.cos(polar) * np.sin(polar))
    assert lambertian_exitance(0.2, 3.0) == pytest.approx(
        lambertian_radiance(0.2, 3.0) * hemisphere, rel=1e-12, abs=0.0
    )


def test_albedo_there_and_back():
    np.testing.assert_allclose(albedo_from_brdf(brdf_from_albedo([0.0, 0.18, 1.0])), [0.0, 0.18, 1.0], rtol=1e-15)


def test_albedo_is_the_share_that_returns():
    assert lambertian_exitance(brdf_from_albedo(0.7), 10.0) == pytest.approx(7.0)


def test_unknown_pixels_stay_unknown():
    assert np.isnan(lambertian_radiance([np.nan, 0.1], 1.0)).tolist() == [True, False]


@pytest.mark.parametrize("function", [albedo_from_brdf, brdf_from_albedo])
def test_negative_raises(function):
    with pytest.raises(InputError, match="at least 0"):
        function(-0.1)
