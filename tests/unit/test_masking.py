from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.masking import mask_from_brightness
from psstereo.stack import MemoryStack
from psstereo_synth import checker, hills, lambertian_capture, spiral


def object_before(background, *, bits, noise=0.0, size=96):
    surface = hills(size, size)
    capture, _ = lambertian_capture(surface, checker((size, size)), spiral(8), bits=None)
    images = capture.stack.read()
    images[:, ~surface.mask] = background
    images += np.random.default_rng(0).normal(0, noise, images.shape)
    top = 2**bits - 1 if bits else 1
    if bits:
        images = np.rint(np.clip(images, 0, 1) * top).astype(np.uint8 if bits == 8 else np.uint16)
    return MemoryStack(images), surface.mask


@pytest.mark.parametrize("bits", [8, 16, None])
@pytest.mark.parametrize("background", [0.0, 0.01])
def test_an_object_before_a_dark_background_is_found_to_the_pixel(bits, background):
    stack, truth = object_before(background, bits=bits)
    found = mask_from_brightness(stack)
    assert found.dtype == np.bool_
    np.testing.assert_array_equal(found, truth)


def test_noise_does_little():
    stack, truth = object_before(0.01, bits=16, noise=0.003)
    assert np.count_nonzero(mask_from_brightness(stack) ^ truth) < 0.002 * truth.sum()


def test_specks_are_dropped_and_holes_filled():
    stack, truth = object_before(0.0, bits=16)
    images = stack.read()
    images[:, 2:4, 2:4] = 40000
    images[:, 45:48, 45:48] = 0
    np.testing.assert_array_equal(mask_from_brightness(MemoryStack(images)), truth)


def test_two_large_pieces_are_kept():
    images = np.zeros((3, 40, 60), np.uint16)
    images[:, 5:30, 5:25] = 30000
    images[:, 10:30, 30:50] = 20000
    np.testing.assert_array_equal(mask_from_brightness(MemoryStack(images)), images[0] > 0)


def test_brightest_counts_not_mean():
    """Each half is lit once."""
    images = np.full((2, 20, 40), 10, np.uint16)
    images[0, 5:15, 5:20] = images[1, 5:15, 20:35] = 50000
    np.testing.assert_array_equal(mask_from_brightness(MemoryStack(images)), images.max(axis=0) > 10)


def test_pixels_that_are_no_numbers_are_background():
    stack, truth = object_before(0.0, bits=None)
    images = stack.read()
    images[:, :10] = np.nan
    np.testing.assert_array_equal(mask_from_brightness(MemoryStack(images)), truth & (np.arange(96) >= 10)[:, None])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("value", [0, 1, np.nan, -1.0])
def test_nothing_to_tell_apart_is_refused(dtype, value):
    if np.dtype(dtype).kind == "u" and not value >= 0:
        value = 7
    with pytest.raises(InputError, match="equally bright"):
        mask_from_brightness(MemoryStack(np.full((3, 5, 6), value, dtype)))


def test_one_infinite_value_is_just_bright():
    stack, truth = object_before(0.0, bits=None)
    images = stack.read()
    images[2, 48, 48] = np.inf
    np.testing.assert_array_equal(mask_from_brightness(MemoryStack(images)), truth)


def test_threads_and_progress_change_nothing():
    stack, truth = object_before(0.01, bits=16)
    seen = []
    with ThreadPoolExecutor(3) as pool:
        found = mask_from_brightness(stack, over=pool.map, progress=lambda *step: seen.append(step))
    np.testing.assert_array_equal(found, truth)
    assert seen == [("looking at images", i, 8) for i in range(1, 9)]
