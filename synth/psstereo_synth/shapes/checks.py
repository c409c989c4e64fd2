"""What every surface asks of its numbers."""

import math

import numpy as np

from psstereo.errors import InputError
from psstereo.types import FloatArray

__all__ = ["finite", "places", "positive", "whole"]


def positive(surface: str, **values: float) -> None:
    """Refuse lengths that are zero, negative or not finite.

    Parameters
    ----------
    surface : str
        What they belong to, for the message.
    **values : float
        The lengths by name.

    Raises
    ------
    InputError
        If one of them is no positive, finite number.
    """
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise InputError(
                given=f"The {name.replace('_', ' ')} of a {surface} is {value}.",
                needed="It must be a positive, finite number.",
                remedy="Give another value, or leave it out to take the default.",
            )


def finite(surface: str, **values: float) -> None:
    """Refuse numbers that are not finite.

    Parameters
    ----------
    surface : str
        What they belong to, for the message.
    **values : float
        The numbers by name.

    Raises
    ------
    InputError
        If one of them is infinite or NaN.
    """
    for name, value in values.items():
        if not math.isfinite(value):
            raise InputError(
                given=f"The {name.replace('_', ' ')} of a {surface} is {value}.",
                needed="It must be a finite number.",
                remedy="Give another value, or leave it out to take the default.",
            )


def whole(surface: str, *, least: int, **values: int) -> None:
    """Refuse what is no whole number, or too small a one.

    Parameters
    ----------
    surface : str
        What they belong to, for the message.
    least : int
        The smallest number allowed.
    **values : int
        The numbers by name.

    Raises
    ------
    InputError
        If one of them is too small or has a fraction.
    """
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
            raise InputError(
                given=f"The {name.replace('_', ' ')} of a {surface} is {value}.",
                needed=f"It must be a whole number of at least {least}.",
                remedy="Give another value, or leave it out to take the default.",
            )


def places(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return places as float64, and refuse coordinates of different shapes.

    Parameters
    ----------
    x, y : float array (...)
        Places [length].

    Returns
    -------
    x, y : float64 array (...)
        The same places [length].

    Raises
    ------
    InputError
        If the shapes differ.
    """
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    if x.shape != y.shape:
        raise InputError(
            given=f"The x of places have the shape {x.shape}, the y the shape {y.shape}.",
            needed="Each place has one x and one y.",
            remedy="Give both for the same places, for example from numpy.meshgrid.",
        )
    return x, y
