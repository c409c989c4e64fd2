"""Checks that every reflectance model makes on its parameters."""

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError
from psstereo.types import FloatArray

__all__ = ["common_shape", "in_total", "parameter", "reflectance"]


def parameter(
    values: npt.ArrayLike, what: str, *, low: float, high: float, unit: str, remedy: str, exclude_low: bool = False
) -> FloatArray:
    """Return a parameter as a read-only float64 array of its own, with a last axis of channels.

    Parameters
    ----------
    values : scalar or array (c,) or (..., c)
        One number, one a channel, or a map of them [unit].
    what, unit, remedy : str
        What it is, in which unit, and what to do if it is wrong, for the message.
    low, high : float
        Least and greatest value allowed [unit].
    exclude_low : bool
        Whether it must be greater than ``low``.

    Returns
    -------
    float64 array (c,) or (..., c)
        The parameter [unit].

    Raises
    ------
    InputError
        If one lies outside, is not a number, or there is none.
    """
    array = np.atleast_1d(np.array(values, np.float64))
    fine = ((array > low) if exclude_low else (array >= low)) & (array <= high)
    if array.size == 0 or not fine.all():
        raise InputError(
            given=f"The {what} {'is empty' if array.size == 0 else f'holds {array[~fine].flat[0]:.6g}'} [{unit}].",
            needed=f"Every value must be {'greater than' if exclude_low else 'at least'} {low:g}, at most {high:g}.",
            remedy=remedy,
        )
    array.flags.writeable = False
    return array


def reflectance(values: npt.ArrayLike, what: str) -> FloatArray:
    """Return read-only shares of reflected light in float64, with a last axis of channels.

    Parameters
    ----------
    values : scalar or array (c,) or (..., c)
        Shares of the light, one number, one a channel, or a map of them [1].
    what : str
        What they are, for the message.

    Returns
    -------
    float64 array (c,) or (..., c)
        The shares [1].

    Raises
    ------
    InputError
        If one lies outside 0 … 1, is not a number, or there is none.
    """
    remedy = "A surface reflects a share of the light: scale it into that range; ρ in sr⁻¹ is albedo / π."
    return parameter(values, what, low=0.0, high=1.0, unit="1", remedy=remedy)


def common_shape(**parameters: FloatArray) -> tuple[int, ...]:
    """Return the shape of a model's values over the surface: (c,), or (..., c) if a parameter is a map.

    Parameters
    ----------
    **parameters : float array (c,) or (..., c)
        The parameters by name; each has one channel or as many as the others [any unit].

    Returns
    -------
    tuple of int
        The shape.

    Raises
    ------
    InputError
        If numbers of channels disagree, or maps are of different sizes.
    """
    channels = {array.shape[-1] for array in parameters.values()} - {1}
    maps = {array.shape[:-1] for array in parameters.values()} - {()}
    if len(channels) > 1 or len(maps) > 1:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in parameters.items())
        raise InputError(
            given=f"The parameters have the shapes {shapes}.",
            needed="Each is (c,), or a map (..., c) of one size for all; c is the same for all, or 1.",
            remedy="Give maps for the same surface, with an axis of channels at the end.",
        )
    return (*max(maps, default=()), max(channels, default=1))


def in_total(diffuse: FloatArray, specular: FloatArray) -> None:
    """Refuse a surface whose parts together reflect more than they receive.

    Parameters
    ----------
    diffuse, specular : float array (c,) or (..., c)
        Largest shares of the light that the two parts reflect [1].

    Raises
    ------
    InputError
        If they add up to more than 1, rounding aside.
    """
    total = diffuse + specular
    if not (total <= 1.0 + 4.0 * np.finfo(np.float64).eps).all():
        raise InputError(
            given=f"Diffuse and specular share add up to {total.max():.6g}.",
            needed="Together they reflect at most all of the light.",
            remedy="Make one of them smaller.",
        )
