import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError
from psstereo.lights import Rig
from psstereo.matching import Noise, ViewImages
from psstereo.stack import MemoryStack, Response


def capture(images, **kind):
    return Capture(stack=MemoryStack(images), rig=Rig.distant(np.tile([0.0, 0, 1], (len(images), 1))), **kind)


def test_values_of_a_capture_are_linear_shares_of_full_scale():
    images = np.array([[[[0], [51], [255]]]], np.uint8)
    found = ViewImages.from_capture(capture(images, dark=np.full((1, 3, 1), 51.0)))
    np.testing.assert_allclose(found.values[0, 0, 0], [-0.2, 0.0, 0.8], atol=1e-7)
    assert found.saturated[0, 0, 0].tolist() == [False, False, True]
    assert found.noise.step == pytest.approx(1 / 255)


def test_colours_and_lights_stand_apart():
    images = np.arange(2 * 3 * 4 * 3, dtype=np.uint16).reshape(2, 3, 4, 3)
    found = ViewImages.from_capture(capture(images), lights=[1])
    assert found.values.shape == (1, 3, 3, 4)
    np.testing.assert_allclose(found.values[0, 2] * 65535, images[1, :, :, 2], rtol=1e-6)


def test_response_is_undone():
    found = ViewImages.from_arrays(np.full((2, 2), 128, np.uint8), response=Response("srgb"))
    assert found.values[0, 0, 0, 0] == pytest.approx(((128 / 255 + 0.055) / 1.055) ** 2.4, rel=1e-5)


def test_exposures_that_are_known_are_put_on_one_scale():
    one = ViewImages.from_capture(capture(np.full((1, 2, 2, 1), 100, np.uint8), radiance_at_white=10.0))
    two = ViewImages.from_capture(capture(np.full((1, 2, 2, 1), 50, np.uint8), radiance_at_white=20.0))
    np.testing.assert_allclose(two.in_exposure_of(one).values, one.values, rtol=1e-6)
    assert two.in_exposure_of(one).noise.step == pytest.approx(2 / 255)


@pytest.mark.parametrize("lights", [[], [3], [-1]])
def test_lights_that_are_not_there_are_refused(lights):
    with pytest.raises(OptionError):
        ViewImages.from_capture(capture(np.ones((2, 2, 2, 1), np.uint8)), lights=lights)


@pytest.mark.parametrize(
    "images", [np.zeros(3), np.zeros((2, 2), np.int64), [np.zeros((2, 2)), np.zeros((3, 2))], np.full((2, 2), np.nan)]
)
def test_images_that_are_none_are_refused(images):
    with pytest.raises(InputError):
        ViewImages.from_arrays(images)


def test_an_empty_mask_is_refused():
    with pytest.raises(InputError, match="empty"):
        ViewImages.from_arrays(np.ones((2, 2)), mask=np.zeros((2, 2), bool), noise=Noise(read=0.1))
