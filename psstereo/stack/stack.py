"""The interface of image stacks."""

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from psstereo.types import Array

__all__ = ["ImageStack", "full_scale"]


class ImageStack(ABC):
    """Images of one size, one a light, in their own numbers: 8 and 16 bit stay what they are.

    Attributes
    ----------
    shape : (int, int, int, int)
        Images, rows, columns, channels: (m, h, w, c).
    dtype : numpy dtype
        Of the values: uint8, uint16, float32 or float64.
    white : float
        Value that means full scale: 255, 65535, or 1 for floating point, unless a white level was given.
    saturates : bool
        Whether values end at `white`; floating-point images may go on beyond it.
    names : tuple of str
        One an image, for messages.
    """

    shape: tuple[int, int, int, int]
    dtype: np.dtype[np.generic]
    white: float
    saturates: bool
    names: tuple[str, ...]

    @abstractmethod
    def frame(self, index: int) -> Array:
        """Return one image, (h, w, c), channels in the order R, G, B; it may be a view and must not be written to.

        Safe to call from several threads at once.
        """

    def __len__(self) -> int:
        return self.shape[0]

    def read(self, rows: slice = slice(None), columns: slice = slice(None)) -> Array:
        """Return a tile of all images, (m, rows, columns, c), in the stack's own numbers.

        It decodes every image once. To bring many pixels of many images into a solver use
        :func:`psstereo.stack.gather.gather`, which never holds the whole stack.
        """
        return np.stack([self.frame(i)[rows, columns] for i in range(len(self))])


def full_scale(dtype: np.dtype[Any]) -> float:
    """Return the value that means full scale for a type of pixel."""
    return float(np.iinfo(dtype).max) if np.issubdtype(dtype, np.integer) else 1.0
