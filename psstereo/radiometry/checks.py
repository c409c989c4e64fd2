"""What every function of this package asks of its input.

A number that a person sets (a scalar, a single direction) must be usable and raises otherwise. Arrays are data: NaN in
them means "not known" and passes through, but a value that is known and impossible still raises.
"""

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError
from psstereo.types import BoolArray, FloatArray

__all__ = ["cosines", "directions", "in_range", "vectors"]

UNIT_TOLERANCE = 1e-6
"""How far the length of a unit vector may be from 1: float32 rounding passes, forgotten normalisation does not [1]."""


def in_range(
    name: str, value: npt.ArrayLike, *, unit: str, low: float = 0.0, high: float = np.inf, exclude_low: bool = False
) -> FloatArray:
    """Return the value as float64, or say what is wrong with it.

    Parameters
    ----------
    name, unit : str
        What the value is, for the message.
    value : float or float array (...)
        The value; NaN is allowed in arrays of one or more axes only [unit].
    low, high : float
        Least and greatest value allowed; infinity is allowed in arrays only [unit].
    exclude_low : bool
        The value must be greater than ``low``.

    Returns
    -------
    float64 array (...)
        The value, unchanged [unit].

    Raises
    ------
    InputError
        If a known value lies outside, or a scalar is not finite.
    """
    array = np.asarray(value, np.float64)
    wrong = np.logical_not((array > low if exclude_low else array >= low) & (array <= high))
    _refuse(name, array, np.asarray(wrong), unit=unit, low=low, high=high, exclude_low=exclude_low)
    return array


def _refuse(
    name: str, array: FloatArray, wrong: BoolArray, *, unit: str, low: float, high: float, exclude_low: bool
) -> None:
    wrong = wrong & ~np.isnan(array) if array.ndim else wrong | ~np.isfinite(array)
    if wrong.any():
        least = f"greater than {low:g}" if exclude_low else f"at least {low:g}"
        most = "" if np.isinf(high) else f" and at most {high:g}"
        least = "finite" if np.isinf(low) else least
        raise InputError(
            given=f"The {name} holds {array[wrong].flat[0]:g} [{unit}].",
            needed=f"It must be {least}{most}, a finite number if it is a single one.",
            remedy=f"Correct the {name}; in an array, NaN stands for a value that is not known.",
        )


def cosines(name: str, value: npt.ArrayLike, *, low: float = -1.0) -> FloatArray:
    """Return cosines as float64, within their range: those beyond it by no more than rounding are put back.

    Parameters
    ----------
    name : str
        What the value is, for the message.
    value : float or float array (...)
        Cosines, ``low`` … 1 (to 1e-6) [1].
    low : float
        Least value allowed [1].

    Returns
    -------
    float64 array (...)
        Cosines, ``low`` … 1 [1].

    Raises
    ------
    InputError
        If a known value lies outside, or a scalar is not finite.
    """
    array = in_range(name, value, unit="1", low=low - UNIT_TOLERANCE, high=1.0 + UNIT_TOLERANCE)
    return np.asarray(np.clip(array, low, 1.0))


def vectors(name: str, value: npt.ArrayLike, *, trailing: tuple[int | None, ...] = (3,)) -> FloatArray:
    """Return the value as float64 whose last axes are as asked (None: any length of at least 3).

    Parameters
    ----------
    name : str
        What the value is, for the message.
    value : float array (..., *trailing)
        The vectors [any unit].
    trailing : tuple
        The last axes.

    Returns
    -------
    float64 array (..., *trailing)
        The vectors, unchanged [same unit].

    Raises
    ------
    InputError
        If the shape is another one.
    """
    array = np.asarray(value, np.float64)
    found = array.shape[max(array.ndim - len(trailing), 0) :]
    fits = len(found) == len(trailing)
    if not fits or any(f < 3 if t is None else f != t for f, t in zip(found, trailing, strict=True)):
        wanted = ", ".join("n ≥ 3" if t is None else str(t) for t in trailing)
        raise InputError(
            given=f"The {name} has shape {array.shape}.",
            needed=f"Its shape must be (..., {wanted}): x, y, z along the last axis.",
            remedy="Move the components to the last axis, for example with numpy.moveaxis.",
        )
    return array


def directions(name: str, value: npt.ArrayLike) -> FloatArray:
    """Return unit vectors as float64, or say that they are not.

    Parameters
    ----------
    name : str
        What the value is, for the message.
    value : float array (..., 3)
        Unit vectors; NaN is allowed where there is more than one [1].

    Returns
    -------
    float64 array (..., 3)
        The vectors, unchanged [1].

    Raises
    ------
    InputError
        If a vector is zero or its length differs from 1 by more than 1e-6, or a single one is not a number.
    """
    array = vectors(name, value)
    lengths = np.sqrt(np.einsum("...i,...i->...", array, array))
    wrong = np.logical_not(np.abs(lengths - 1.0) <= UNIT_TOLERANCE)
    if array.ndim > 1:
        wrong &= ~np.isnan(lengths)
    if np.any(wrong):
        raise InputError(
            given=f"The {name} holds a vector of length {np.asarray(lengths)[wrong].flat[0]:.9g}.",
            needed="Every vector must have length 1.",
            remedy="Divide by the length; a vector of length 0 has no direction: in an array, set it to NaN.",
        )
    return array
