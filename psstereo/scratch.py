"""Working arrays that are used again and again.

Asking the system for fresh memory can cost more than the arithmetic done in it: every page is zeroed when it is first
touched. Loops over images and blocks therefore keep their working arrays.
"""

import threading
from typing import Any

import numpy as np
import numpy.typing as npt

from psstereo.types import Array

__all__ = ["Scratch"]


class Scratch(threading.local):
    """Named working arrays, a set of its own for every thread.

    The content of an array is whatever its last user left there; it must be written before it is read. Arrays never
    leave the function that asked for them.
    """

    def __init__(self) -> None:
        self._arrays: dict[str, Array] = {}

    def __reduce__(self) -> tuple[type["Scratch"], tuple[()]]:
        return Scratch, ()

    def array(self, name: str, shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
        """Return a contiguous array of this shape and type.

        Parameters
        ----------
        name : str
            What it is for; two arrays in use at the same time need two names.
        shape : tuple of int
            Wanted shape.
        dtype : numpy dtype
            Wanted type.

        Returns
        -------
        array
            Uninitialised, in the sense above.
        """
        held = self._arrays.get(name)
        if held is None or held.shape != shape or held.dtype != dtype:
            held = np.zeros(shape, dtype)
            self._arrays[name] = held
        return held

    def copy(self, name: str, source: Any) -> Array:
        """Return the array `name` holding a float64 copy of `source`."""
        out = self.array(name, source.shape, np.float64)
        np.copyto(out, source)
        return out
