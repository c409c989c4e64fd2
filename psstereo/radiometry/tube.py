"""Thin tubes: the power in a bundle of rays, and the angles under which its far end is seen."""

import numpy as np
import numpy.typing as npt

from psstereo.radiometry.cap import cap_solid_angle
from psstereo.radiometry.checks import cosines, in_range
from psstereo.radiometry.constants import FULL_SPHERE
from psstereo.types import FloatArray

__all__ = ["tube_half_angle", "tube_power", "tube_solid_angle"]


def tube_power(
    radiance: npt.ArrayLike, area: npt.ArrayLike, solid_angle: npt.ArrayLike, cosine: npt.ArrayLike = 1.0
) -> FloatArray:
    """Power through a thin tube, Φ = L A cosθ Ω.

    Not for tubes about as wide as long, in which the cosine varies: multiply the radiance by `disc_etendue`.

    Parameters
    ----------
    radiance : float or float array (...)
        Radiance L of the rays, ≥ 0 [W m⁻² sr⁻¹].
    area : float or float array (...)
        Area A of the opening, ≥ 0 [m²].
    solid_angle : float or float array (...)
        Solid angle Ω of the rays, 0 … 4π [sr].
    cosine : float or float array (...)
        Cosine of the angle θ between the opening's normal and the rays, 0 … 1 [1].

    Returns
    -------
    float64 array (...)
        Power of the broadcast shape [W].

    Raises
    ------
    InputError
        If a value lies outside its range.

    Examples
    --------
    >>> print(tube_power(10.0, 2.0, 0.5))
    10.0
    """
    level = in_range("radiance", radiance, unit="W m⁻² sr⁻¹")
    opening = in_range("area", area, unit="m²")
    rays = in_range("solid angle", solid_angle, unit="sr", high=FULL_SPHERE)
    return np.asarray(level * opening * cosines("cosine", cosine, low=0.0) * rays)


def tube_half_angle(radius: npt.ArrayLike, length: npt.ArrayLike) -> FloatArray:
    """Half-angle under which a tube's far end is seen from the centre of its near end, atan2(r, d).

    Parameters
    ----------
    radius : float or float array (...)
        Radius r of the far end, ≥ 0 [m].
    length : float or float array (...)
        Length d of the tube, ≥ 0 [m].

    Returns
    -------
    float64 array (...)
        Half-angle of the broadcast shape, 0 … π/2 [rad].

    Raises
    ------
    InputError
        If radius or length is negative, or a scalar is not finite.

    Examples
    --------
    >>> print(f"{tube_half_angle(1.0, 1.0) / np.pi:.15f}")
    0.250000000000000
    """
    return np.asarray(np.arctan2(in_range("radius", radius, unit="m"), in_range("length", length, unit="m")))


def tube_solid_angle(radius: npt.ArrayLike, length: npt.ArrayLike) -> FloatArray:
    """Solid angle of a tube's far end, seen from the centre of its near end, 4π sin²(atan2(r, d) / 2).

    Not for points of the near end off the axis: `disc_solid_angle`.

    Parameters
    ----------
    radius : float or float array (...)
        Radius r of the far end, ≥ 0 [m].
    length : float or float array (...)
        Length d of the tube, ≥ 0 [m].

    Returns
    -------
    float64 array (...)
        Solid angle of the broadcast shape, 0 … 2π; π r²/d² for a thin tube [sr].

    Raises
    ------
    InputError
        If radius or length is negative, or a scalar is not finite.

    Examples
    --------
    >>> print(f"{tube_solid_angle(1.0, 1e8):.6e}")
    3.141593e-16
    """
    return cap_solid_angle(tube_half_angle(radius, length))
