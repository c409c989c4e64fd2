"""Spherical caps: all directions within an angle of an axis."""

import numpy as np
import numpy.typing as npt

from psstereo.radiometry.checks import in_range
from psstereo.radiometry.constants import FULL_SPHERE
from psstereo.types import FloatArray

__all__ = ["cap_half_angle", "cap_solid_angle"]


def cap_solid_angle(half_angle: npt.ArrayLike) -> FloatArray:
    """Solid angle of a spherical cap, Ω = 4π sin²(a/2).

    The textbook form 2π (1 − cos a) is the same on paper, but loses every digit of a cap smaller than 1e-8 rad.
    Not for the *irradiance* from a cap, which has a cosine in the integral and is π L sin²a: see `sphere_irradiance`.

    Parameters
    ----------
    half_angle : float or float array (...)
        Angle between axis and rim, 0 … π [rad].

    Returns
    -------
    float64 array (...)
        Solid angle, 0 … 4π [sr].

    Raises
    ------
    InputError
        If an angle lies outside 0 … π.

    Examples
    --------
    >>> print(f"{cap_solid_angle(1e-9):.6e}")
    3.141593e-18
    """
    angle = in_range("half-angle", half_angle, unit="rad", high=np.pi)
    return np.asarray(FULL_SPHERE * np.sin(0.5 * angle) ** 2)


def cap_half_angle(solid_angle: npt.ArrayLike) -> FloatArray:
    """Half-angle of the cap of a given solid angle, a = 2 asin √(Ω / 4π); the inverse of `cap_solid_angle`.

    Not for caps of nearly the whole sphere: above 4π − 1e-8 sr the solid angle itself holds few digits of the angle.

    Parameters
    ----------
    solid_angle : float or float array (...)
        Solid angle, 0 … 4π [sr].

    Returns
    -------
    float64 array (...)
        Angle between axis and rim, 0 … π [rad].

    Raises
    ------
    InputError
        If a solid angle lies outside 0 … 4π.

    Examples
    --------
    >>> print(f"{cap_half_angle(6.8e-5):.3e}")
    4.652e-03
    """
    solid = in_range("solid angle", solid_angle, unit="sr", high=FULL_SPHERE)
    return np.asarray(2.0 * np.arcsin(np.sqrt(solid / FULL_SPHERE)))
