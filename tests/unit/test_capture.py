import numpy as np
import pytest

from psstereo.camera import Orthographic
from psstereo.capture import Capture, Truth
from psstereo.errors import InputError
from psstereo.lights import Rig
from psstereo.stack import LINEAR, MemoryStack
from psstereo_synth import ring

STACK, RIG = MemoryStack(np.zeros((4, 5, 6, 3), np.uint8)), Rig.distant(ring(4), source="lights.txt")


def test_what_is_assumed_if_nothing_is_said():
    capture = Capture(stack=STACK, rig=RIG)
    assert capture.shape == (5, 6)
    assert capture.camera == Orthographic()
    assert capture.response is LINEAR
    assert capture.mask is None
    assert capture.effective_mask.shape == (5, 6)
    assert capture.effective_mask.all()
    mask = np.eye(5, 6, dtype=bool)
    assert Capture(stack=STACK, rig=RIG, mask=mask).effective_mask is mask


def test_as_many_images_as_lights():
    with pytest.raises(InputError, match=r"4 images and 5 lights \(given\)"):
        Capture(stack=STACK, rig=Rig.distant(ring(5)))


@pytest.mark.parametrize("mask", [np.ones((6, 5), bool), np.ones((5, 6), np.uint8), np.ones((5, 6, 1), bool)])
def test_a_mask_that_does_not_fit_is_refused(mask):
    with pytest.raises(InputError, match="The mask has the shape"):
        Capture(stack=STACK, rig=RIG, mask=mask)


def test_an_empty_mask_is_refused():
    with pytest.raises(InputError, match="The mask is empty"):
        Capture(stack=STACK, rig=RIG, mask=np.zeros((5, 6), bool))


@pytest.mark.parametrize("shape", [(5, 6), (5, 6, 1), (6, 5, 3), (4, 5, 6, 3)])
def test_a_dark_image_that_does_not_fit_is_refused(shape):
    with pytest.raises(InputError, match="The dark image has the shape"):
        Capture(stack=STACK, rig=RIG, dark=np.zeros(shape))


def test_nothing_can_be_changed_afterwards():
    capture, truth = Capture(stack=STACK, rig=RIG), Truth()
    with pytest.raises(AttributeError):
        capture.name = "other"
    with pytest.raises(AttributeError):
        truth.depth = np.zeros(3)
    assert truth.normals is None


@pytest.mark.parametrize("radiance", [0.0, -1.0, np.nan, np.inf])
def test_radiance_at_white_is_positive(radiance):
    with pytest.raises(InputError, match="radiance"):
        Capture(stack=MemoryStack(np.ones((3, 2, 2))), rig=Rig.distant(np.eye(3)), radiance_at_white=radiance)
