"""Faults that change brightness: stray light, blur, flicker."""

import numpy as np
import pytest
from scipy.special import erf

from psstereo.errors import InputError, OptionError
from psstereo_synth.faults import AmbientLeak, Blur, Draws, Flicker

IMAGE = np.random.default_rng(1).uniform(0, 5, (31, 41, 3))


def test_stray_light_is_the_same_everywhere():
    np.testing.assert_array_equal(AmbientLeak(level=0.5).radiance(IMAGE, 3, Draws(0)), IMAGE + 0.5)
    tinted = AmbientLeak(level=(0.1, 0.0, 0.3)).radiance(IMAGE, 0, Draws(0))
    np.testing.assert_array_equal(tinted, IMAGE + np.array([0.1, 0.0, 0.3]))


def test_levels_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match="2 levels"):
        AmbientLeak(level=(0.1, 0.2)).radiance(IMAGE, 0, Draws(0))
    for bad in ((), (0.1, -0.1), (np.nan,), -1.0):
        with pytest.raises(OptionError):
            AmbientLeak(level=bad)


@pytest.mark.parametrize("sigma", [0.8, 2.0, 5.0])
def test_blur_of_a_point_has_the_width_that_was_asked_for(sigma):
    point = np.zeros((121, 121, 2))
    point[60, 60] = [1.0, 3.0]
    spread = Blur(sigma=sigma).radiance(point, 0, Draws(0))
    rows, columns = np.indices((121, 121)) - 60
    np.testing.assert_allclose(spread.sum(axis=(0, 1)), [1.0, 3.0], rtol=1e-12)  # channels do not mix
    for offset in (rows, columns):
        assert (spread[..., 0] * offset**2).sum() == pytest.approx(sigma**2, rel=1e-3)
        assert abs((spread[..., 0] * offset).sum()) < 1e-12
    gauss = np.exp(-(rows**2 + columns**2) / (2 * sigma**2)) / (2 * np.pi * sigma**2)
    np.testing.assert_allclose(spread[..., 0], gauss, rtol=0, atol=2e-3 * gauss.max())


def test_blur_of_an_edge_is_the_error_function():
    edge = np.zeros((5, 100, 1))
    edge[:, 50:] = 1.0
    x = np.arange(100) - 49.5
    blurred = Blur(sigma=3.0).radiance(edge, 0, Draws(0))
    # a sampled Gaussian against the integral: the difference is of second order in 1 / sigma
    np.testing.assert_allclose(blurred[2, :, 0], 0.5 * (1 + erf(x / (3.0 * np.sqrt(2)))), rtol=0, atol=2e-3)


def test_flicker_has_the_spread_that_was_asked_for():
    for rms in (0.02, 0.4):
        factors = Flicker(rms=rms).factors(20000, Draws(5))
        assert factors.mean() == pytest.approx(1.0, abs=4 * rms / np.sqrt(20000))
        assert factors.std() == pytest.approx(rms, rel=0.04)
        assert (factors > 0).all()
        assert abs(np.corrcoef(factors[1:], factors[:-1])[0, 1]) < 0.03


def test_flicker_is_one_factor_an_image():
    fault = Flicker(rms=0.1)
    factors = fault.factors(4, Draws(2))
    for index in range(4):
        np.testing.assert_allclose(fault.radiance(IMAGE, index, Draws(2)), IMAGE * factors[index], rtol=1e-15)
