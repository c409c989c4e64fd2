import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.stack import MemoryStack


@pytest.mark.parametrize(
    "images",
    [
        np.zeros((3, 4)),
        np.zeros((2, 3, 4, 3, 1)),
        np.zeros((0, 3, 4)),
        np.zeros((2, 0, 4)),
        np.zeros((2, 3, 4), np.int32),
        np.zeros((2, 3, 4), bool),
        np.zeros((2, 3, 4), np.float16),
        np.zeros((2, 3, 4), ">u2"),
    ],
)
def test_arrays_that_are_no_stack_are_refused(images):
    with pytest.raises(InputError, match="The images are an array of shape"):
        MemoryStack(images)


def test_the_array_is_not_copied():
    images = np.zeros((2, 3, 4, 3), np.uint8)
    stack = MemoryStack(images, names=("a", "b"))
    assert np.shares_memory(stack.frame(1), images)
    assert stack.names == ("a", "b")
    assert MemoryStack(images).names == ("image 1", "image 2")
