"""Images that are already in memory."""

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError
from psstereo.stack.stack import ImageStack, full_scale
from psstereo.types import Array

__all__ = ["MemoryStack"]


class MemoryStack(ImageStack):
    """A stack over an array, which is not copied.

    Parameters
    ----------
    images : array (m, h, w) or (m, h, w, c)
        Linear pixel values of one of the types uint8, uint16, float32, float64, channels R, G, B.
    white : float, optional
        Value that means full scale; from the type if absent, 1 for floating point.
    names : sequence of str, optional
        Names for messages.

    Raises
    ------
    InputError
        If the array has another shape, no pixels, or a type that images do not have.
    """

    def __init__(self, images: npt.ArrayLike, *, white: float | None = None, names: tuple[str, ...] = ()) -> None:
        array = np.asarray(images)
        if array.ndim == 3:
            array = array[..., None]
        if array.ndim != 4 or 0 in array.shape or array.dtype not in (np.uint8, np.uint16, np.float32, np.float64):
            raise InputError(
                given=f"The images are an array of shape {np.shape(images)} and type {array.dtype}.",
                needed="A stack is (m, h, w) or (m, h, w, c), not empty, of uint8, uint16, float32 or float64.",
                remedy="Stack the images along the first axis and convert them to one of these types.",
            )
        self._images: Array = array
        self.shape = (array.shape[0], array.shape[1], array.shape[2], array.shape[3])
        self.dtype = array.dtype
        self.white = full_scale(array.dtype) if white is None else float(white)
        self.saturates = white is not None or array.dtype.kind == "u"
        self.names = names or tuple(f"image {i + 1}" for i in range(len(array)))

    def frame(self, index: int) -> Array:
        """Return a view of one image; see :meth:`ImageStack.frame`."""
        return np.asarray(self._images[index])
