import numpy as np
import pytest

from psstereo.calibrate.response import response_from_exposures
from psstereo.errors import InputError, OptionError

TIMES = np.array([1 / 60, 1 / 30, 1 / 15, 1 / 8])


def srgb(light):
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def shoulder(light):
    """A film-like curve: a gamma with a soft knee and toe."""
    raised = light ** (1 / 2.2)
    return 0.75 * raised + 0.25 * (3 * raised**2 - 2 * raised**3)


def photographs(encode, times=TIMES, *, seed=0, noise=0.004):
    rng = np.random.default_rng(seed)
    light = np.exp(rng.uniform(np.log(0.005), np.log(1.5), (50, 60)))
    frames = []
    for time in np.asarray(times) / np.max(times) * 4:
        noisy = light * time * (1 + noise * rng.standard_normal(light.shape))
        frames.append(np.round(255 * encode(np.clip(noisy, 0, 1))).astype(np.uint8))
    return frames


@pytest.mark.parametrize(("exponent", "count"), [(1.6, 4), (2.2, 2), (2.2, 4)])
def test_a_gamma_curve_is_found_to_a_part_in_a_thousand(exponent, count):
    frames = photographs(lambda light: light ** (1 / exponent), TIMES[:count])
    found = response_from_exposures(frames, TIMES[:count])
    assert found.response.name == "gamma"
    assert abs(found.exponent / exponent - 1) < 1e-3
    assert abs(found.exponent - exponent) < 5 * found.exponent_error
    assert found.exponent_error < 0.003


def test_linear_photographs_stay_linear():
    found = response_from_exposures(photographs(lambda light: light), TIMES)
    assert found.response.is_linear
    assert "linear" in found.quality.verdict


@pytest.mark.parametrize("encode", [srgb, shoulder])
def test_a_curve_that_is_no_gamma_is_found_to_half_a_percent_of_full_scale(encode):
    found = response_from_exposures(photographs(encode), TIMES)
    assert found.response.name == "curve"
    light = np.linspace(0, 1, 400)
    assert np.abs(found.response.curve(encode(light)) - light).max() < 0.009
    assert np.sqrt(np.mean((found.response.curve(encode(light)) - light) ** 2)) < 0.005


def test_wrong_times_show_in_the_error():
    frames = photographs(lambda light: light ** (1 / 2.2))
    found = response_from_exposures(frames, TIMES * [1.0, 1.15, 1.0, 1.0], model="gamma")
    assert found.exponent_error > 0.03
    assert any("exposure times" in line for line in found.quality.advice)


def test_what_cannot_be_used_is_refused():
    frames = photographs(lambda light: light)
    with pytest.raises(InputError, match="exposure times run"):
        response_from_exposures(frames[:2], [0.1, 0.1])
    with pytest.raises(InputError, match="times"):
        response_from_exposures(frames, [0.1, 0.2])
    with pytest.raises(InputError, match="1 photographs"):
        response_from_exposures(frames[:1], [0.1])
    with pytest.raises(InputError, match="power"):
        response_from_exposures(frames[:3][::-1], TIMES[:3])
    with pytest.raises(InputError, match="neither clipped nor nearly black"):
        response_from_exposures([np.full((40, 40), 255, np.uint8)] * 2, [1, 2])
    with pytest.raises(InputError, match="free curve"):
        response_from_exposures(frames[:2], TIMES[:2], model="curve")
    with pytest.raises(OptionError, match="model"):
        response_from_exposures(frames, TIMES, model="spline")
