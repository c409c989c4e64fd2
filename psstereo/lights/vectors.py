"""Checks that every light makes on its vectors."""

import numpy as np
import numpy.typing as npt

from psstereo.errors import RigError
from psstereo.types import FloatArray

__all__ = ["strengths", "unit_vector"]


def unit_vector(vector: npt.ArrayLike, what: str) -> FloatArray:
    """Return a read-only unit vector in float64, or refuse zero and non-finite ones.

    Parameters
    ----------
    vector : array (3,)
        Any finite vector but zero; huge and tiny lengths are fine.
    what : str
        What the vector is, for the message.

    Returns
    -------
    float64 array (3,)
        Unit vector [1].

    Raises
    ------
    RigError
        If the vector has another shape, is zero, or is not finite.
    """
    v = np.array(vector, np.float64)
    largest = np.abs(v).max() if v.shape == (3,) else 0.0
    if not (np.isfinite(largest) and largest > 0):
        raise RigError(
            given=f"The {what} is {np.array2string(v, precision=6)}.",
            needed="It must be three finite numbers that are not all zero.",
            remedy="Correct that entry of the lights, or leave its image out.",
        )
    v = v / largest  # so that squaring neither overflows nor underflows
    v /= np.sqrt(v @ v)
    v.flags.writeable = False
    return v


def strengths(values: npt.ArrayLike, what: str) -> FloatArray:
    """Return read-only positive strengths per channel in float64.

    Parameters
    ----------
    values : scalar or array (c,)
        Strength, one number or one a channel.
    what : str
        What they are, for the message.

    Returns
    -------
    float64 array (c,)
        Strengths.

    Raises
    ------
    RigError
        If one is zero, negative or not finite.
    """
    s = np.atleast_1d(np.array(values, np.float64))
    if s.ndim != 1 or s.size == 0 or not np.isfinite(s).all() or (s <= 0).any():
        raise RigError(
            given=f"The {what} is {np.array2string(s, precision=6)}.",
            needed="Each channel needs a positive, finite strength.",
            remedy="Correct that entry of the light intensities, or leave its image out.",
        )
    s.flags.writeable = False
    return s
