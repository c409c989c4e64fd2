import numpy as np
import pytest

from psstereo.calibrate.camera import flat_from_frames
from psstereo.errors import InputError, OptionError
from psstereo.stack import Response

SHAPE = (60, 80, 3)
ROWS, COLUMNS = np.indices(SHAPE[:2])
FALL = np.cos(np.arctan(np.hypot(ROWS - 29.5, COLUMNS - 39.5) / 55)) ** 4


def cards(count, *, noise=0.01, exponent=1.0, seed=0):
    rng = np.random.default_rng(seed)
    pixels = 1 + 0.03 * np.random.default_rng(99).standard_normal(SHAPE)
    light = 0.7 * FALL[..., None] * pixels * np.array([1.0, 0.8, 0.6])
    frames = [
        np.round(65535 * (light * (1 + noise * rng.standard_normal(SHAPE))) ** (1 / exponent)) for _ in range(count)
    ]
    return light, [np.clip(one, 0, 65535).astype(np.uint16) for one in frames]


@pytest.mark.parametrize("exponent", [1.0, 2.2])
def test_gains_make_the_card_even_to_the_noise_that_is_told(exponent):
    light, frames = cards(9, exponent=exponent)
    found = flat_from_frames(frames, response=Response("gamma", exponent))
    even = light * found.flat.gain
    wrong = np.std(even / even.mean(axis=(0, 1)))
    assert abs(wrong / found.noise - 1) < 0.05
    assert abs(found.noise / (0.01 / 3) - 1) < 0.05
    np.testing.assert_allclose(np.median(even, axis=(0, 1)), np.median(light, axis=(0, 1)), rtol=0.01)  # colours stay


def test_corners_are_told():
    found = flat_from_frames(cards(2, noise=0.0)[1])
    corner, middle = FALL[:7, :10].mean(), FALL[26:34, 35:45].mean()
    assert abs(found.corners - corner / middle) < 0.01


def test_smoothing_takes_noise_out():
    light, frames = cards(1, noise=0.05)
    smooth = flat_from_frames(frames, smooth=3.0)
    even = (light / 0.7 / FALL[..., None]) * 0 + FALL[..., None] * smooth.flat.gain
    inside = even[8:-8, 8:-8]
    assert np.std(inside / inside.mean(axis=(0, 1))) < 0.01
    assert np.isnan(smooth.noise)


def test_a_dead_pixel_has_no_gain():
    _, frames = cards(2)
    for frame in frames:
        frame[10, 20] = 0
    found = flat_from_frames(frames)
    assert np.isnan(found.flat.gain[10, 20]).all()
    assert found.dead == 3


def test_what_cannot_be_used_is_refused():
    _, frames = cards(1)
    with pytest.raises(InputError, match="saturated"):
        flat_from_frames([np.full(SHAPE, 65535, np.uint16)])
    with pytest.raises(InputError, match="shows light"):
        flat_from_frames([np.zeros(SHAPE, np.uint16)])
    with pytest.raises(InputError, match="white card"):
        flat_from_frames([])
    with pytest.raises(InputError, match="white card"):
        flat_from_frames([frames[0], frames[0][:5]])
    with pytest.raises(OptionError, match="smoothed"):
        flat_from_frames(frames, smooth=-1)
