"""A part of the images, and coarser pixels."""

import numpy as np

from psstereo.errors import OptionError
from psstereo.stack.stack import ImageStack
from psstereo.types import Array

__all__ = ["BinnedStack", "CroppedStack"]


class CroppedStack(ImageStack):
    """A rectangle of every image, in the stack's own numbers; files are decoded whole all the same.

    Parameters
    ----------
    source : ImageStack
        The images.
    rows, columns : (int, int)
        First row and the one after the last, and the same of columns [px].

    Raises
    ------
    OptionError
        If the rectangle is empty or not within the images.
    """

    def __init__(self, source: ImageStack, *, rows: tuple[int, int], columns: tuple[int, int]) -> None:
        m, h, w, c = source.shape
        if not (0 <= rows[0] < rows[1] <= h and 0 <= columns[0] < columns[1] <= w):
            raise OptionError(
                given=f"Rows {rows[0]} to {rows[1]} and columns {columns[0]} to {columns[1]} are to be kept.",
                needed=f"A rectangle within {h} rows and {w} columns, counted from 0, the end not included.",
                remedy="Correct the rectangle.",
            )
        self.source, self.rows, self.columns = source, slice(*rows), slice(*columns)
        self.shape = (m, rows[1] - rows[0], columns[1] - columns[0], c)
        self.dtype, self.white, self.saturates, self.names = source.dtype, source.white, source.saturates, source.names

    def frame(self, index: int) -> Array:
        """Return the rectangle of one image; see :meth:`ImageStack.frame`."""
        return np.asarray(self.source.frame(index)[self.rows, self.columns])


class BinnedStack(ImageStack):
    """A stack of coarser pixels, each the mean of a square of pixels; what is left at the end of a row is dropped.

    The mean is that of light only if the values are: put a :class:`psstereo.stack.LinearStack` below it. A square with
    a NaN in it is NaN. Not to hide noise before a solver that weighs it; it costs detail, and pays where the images are
    larger than what is wanted, or memory is short.

    Parameters
    ----------
    source : ImageStack
        Images of linear light, floating point.
    size : int
        Pixels along a side of the square, 1 or more [px].

    Raises
    ------
    OptionError
        If the size is not positive or larger than the images, or the values are whole numbers.
    """

    def __init__(self, source: ImageStack, *, size: int) -> None:
        m, h, w, c = source.shape
        if isinstance(size, bool) or not 1 <= size <= min(h, w) or source.dtype.kind != "f":
            raise OptionError(
                given=f"Squares of {size} pixels are to become one, of {source.dtype} images with {h} rows and {w} "
                "columns.",
                needed="A whole number from 1 to the smaller side, and linear light as floating-point numbers.",
                remedy="Correct the size; put images of whole numbers into a LinearStack first.",
            )
        self.source, self.size = source, int(size)
        self.shape = (m, h // size, w // size, c)
        self.dtype, self.white, self.names = source.dtype, source.white, source.names
        self.saturates = False

    def frame(self, index: int) -> Array:
        """Average one image; see :meth:`ImageStack.frame`."""
        _, rows, columns, channels = self.shape
        image = self.source.frame(index)[: rows * self.size, : columns * self.size]
        squares = image.reshape(rows, self.size, columns, self.size, channels)
        return np.asarray(squares.mean(axis=(1, 3), dtype=np.float64), self.dtype)
