import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.stack import BracketStack, MemoryStack, Response
from psstereo.stack.brackets import merge_exposures

TIMES = np.array([0.0025, 0.01, 0.04])


def exposures(exponent, seed=0, full_well=2e4):
    """A scene of four decades, as a camera of 8 bits with photon noise sees it."""
    rng = np.random.default_rng(seed)
    light = np.exp(rng.uniform(np.log(1e-3), np.log(0.8), (2, 60, 70, 1)))
    frames = []
    for time in TIMES / TIMES.min():
        electrons = rng.poisson(light * time * full_well) / full_well
        frames.append(np.round(255 * np.minimum(electrons, 1) ** (1 / exponent)).astype(np.uint8))
    return light, frames


@pytest.mark.parametrize("exponent", [1.0, 2.2])
def test_merged_exposures_beat_each_of_them(exponent):
    light, frames = exposures(exponent)
    response = Response("gamma", exponent) if exponent != 1 else Response()
    merged = BracketStack(tuple(MemoryStack(one) for one in frames), TIMES, response=response).read()
    assert np.isfinite(merged).all()
    wrong = np.sqrt(np.mean((merged / light - 1) ** 2))
    for frame, time in zip(frames, TIMES / TIMES.min(), strict=True):
        alone = (frame / 255.0) ** exponent / time
        assert wrong < 0.5 * np.sqrt(np.mean((alone / light - 1) ** 2))
    assert abs(np.median(merged / light) - 1) < 0.002  # nothing is drawn to one side


def test_errors_are_those_that_come_out():
    light, frames = exposures(1.0, full_well=1e4)
    merged, error = merge_exposures([one[0] for one in frames], TIMES, white=255.0)
    score = (merged - light[0]) / error
    assert 0.8 < np.std(score) < 1.25


def test_what_is_saturated_everywhere_is_unknown_and_fades_without_a_step():
    ramp = np.linspace(0, 1.3, 2000).reshape(1, 1, -1, 1)
    frames = [np.round(255 * np.minimum(ramp * time, 1)).astype(np.uint8) for time in (1, 4)]
    merged = BracketStack(tuple(MemoryStack(one) for one in frames), (1, 4)).frame(0)[0, :, 0]
    assert np.isnan(merged[ramp[0, 0, :, 0] > 1]).all()
    known = ramp[0, 0, :, 0] < 0.97
    assert np.abs(merged - ramp[0, 0, :, 0])[known].max() < 0.7 / 255


def test_dark_levels_are_taken_off_each_exposure():
    light = np.random.default_rng(4).uniform(0.01, 0.2, (5, 6, 1))
    frames = [np.round(65535 * (light * time + 0.01)).astype(np.uint16) for time in (1, 4)]
    dark = np.full((5, 6, 1), 655.35)
    merged, _ = merge_exposures(frames, (1, 4), white=65535.0, darks=(dark, dark))
    np.testing.assert_allclose(merged, light, rtol=1e-3)


@pytest.mark.parametrize("times", [(1.0,), (1.0, 0.0), (1.0, np.nan), (1.0, -2.0)])
def test_hostile_times_are_refused(times):
    with pytest.raises(InputError, match="times"):
        BracketStack((MemoryStack(np.ones((2, 3, 4))),) * 2, times)


def test_exposures_of_different_sizes_are_refused():
    with pytest.raises(InputError, match="exposures"):
        BracketStack((MemoryStack(np.ones((2, 3, 4))), MemoryStack(np.ones((2, 3, 5)))), (1, 2))
