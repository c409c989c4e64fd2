"""Arrangements of suns."""

import numpy as np

from psstereo.errors import InputError
from psstereo.types import FloatArray

__all__ = ["arc", "ring", "spiral"]


def spiral(count: int, *, max_tilt: float = np.radians(60.0)) -> FloatArray:
    """Spread directions evenly over a cap of the dome along a Fibonacci spiral.

    Parameters
    ----------
    count : int
        Number of directions.
    max_tilt : float
        Largest angle to the view [rad].

    Returns
    -------
    float64 array (m, 3)
        Unit directions toward the lights, x right, y up, z toward the camera [1].

    Raises
    ------
    InputError
        If the count is below one.
    """
    _require(count)
    i = np.arange(count)
    # 1 − cos in its stable form, so that a narrow cap keeps its shape.
    drop = 2 * np.sin(max_tilt / 2) ** 2 * (i + 0.5) / count
    radius, turn = np.sqrt(drop * (2 - drop)), i * np.pi * (3 - np.sqrt(5))
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), 1 - drop], axis=1)


def ring(count: int, *, tilt: float = np.arctan(np.sqrt(2.0))) -> FloatArray:
    """Spread directions evenly on a ring; the default tilt, 54.7°, carries least noise into the normals.

    Parameters
    ----------
    count : int
        Number of directions.
    tilt : float
        Angle to the view [rad].

    Returns
    -------
    float64 array (m, 3)
        Unit directions toward the lights [1].

    Raises
    ------
    InputError
        If the count is below one.
    """
    _require(count)
    turn = 2 * np.pi * np.arange(count) / count
    flat = np.full(count, np.cos(tilt))
    return np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), flat], axis=1)


def arc(count: int, *, max_tilt: float = np.radians(60.0), azimuth: float = 0.0) -> FloatArray:
    """Spread directions along an arc over the view, all in one plane: what a sun near the equator does.

    Such a rig cannot tell normals, since all directions lie in one plane; it is here to be refused.

    Parameters
    ----------
    count : int
        Number of directions.
    max_tilt : float
        Angle to the view of the first and last one [rad].
    azimuth : float
        Where the arc ends, from right toward up [rad].

    Returns
    -------
    float64 array (m, 3)
        Unit directions toward the lights [1].

    Raises
    ------
    InputError
        If the count is below one.
    """
    _require(count)
    tilt = np.linspace(-max_tilt, max_tilt, count) if count > 1 else np.zeros(1)
    flat = np.sin(tilt)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.cos(tilt)], axis=1)


def _require(count: int) -> None:
    if count < 1:
        raise InputError(
            given=f"{count} lights are asked for.", needed="A rig has at least one.", remedy="Ask for more."
        )
