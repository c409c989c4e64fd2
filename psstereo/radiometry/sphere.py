"""Spherical sources: sun, moon, lamp globes.

A sphere of radius R at distance d appears as a cap of half-angle a = asin(R/d), and while it is wholly above the
surface's horizon its irradiance is exactly π L sin²a cosθ. When the horizon cuts it, the part above gives, with
s = sin a and c = cosθ,

    E / L = s² c acos(−c cot a / sinθ) + atan(t) − (1 − s²) t,   t = √(s² − c²) / cos a

[1]_, whose terms cancel for small spheres: written as s² c acos(…) + s² t − (t − atan t), with t − atan t summed from
its series, all of them are of the size of the result.

References
----------
.. [1] J. M. Snyder, "Area light sources for real-time graphics", Microsoft Research MSR-TR-96-11, 1996
"""

import numpy as np
import numpy.typing as npt

from psstereo.radiometry.checks import cosines, in_range
from psstereo.radiometry.constants import FULL_SPHERE, HEMISPHERE
from psstereo.types import FloatArray

__all__ = ["sphere_irradiance", "sphere_solid_angle"]

_SERIES_BELOW = 0.25
"""Below this t, t − atan t is summed from its series; 14 terms leave less than 1e-17 of it [1]."""
_SERIES = np.array([1.0 / (2 * k + 3) * (-1.0) ** k for k in range(14)])


def sphere_solid_angle(radius: npt.ArrayLike, distance: npt.ArrayLike) -> FloatArray:
    """Solid angle of a sphere, Ω = 4π sin²(a/2) with sin a = R / d, computed as 2π (R/d)² / (1 + √(1 − (R/d)²)).

    Not for a disc: `disc_solid_angle`. A sphere of the same radius at the same distance looks larger.

    Parameters
    ----------
    radius : float or float array (...)
        Radius R of the sphere, ≥ 0 [m].
    distance : float or float array (...)
        Distance d of the observer from the sphere's centre, ≥ 0 [m].

    Returns
    -------
    float64 array (...)
        Solid angle of the broadcast shape, 0 … 2π; 4π where the observer is inside [sr].

    Raises
    ------
    InputError
        If radius or distance is negative, or a scalar is not finite.

    Examples
    --------
    >>> print(f"{sphere_solid_angle(6.957e8, 1.495978707e11):.3e}")
    6.794e-05
    """
    r, d = in_range("radius", radius, unit="m"), in_range("distance", distance, unit="m")
    sine, cosine = _sine_cosine(r, d)
    return np.where(r > d, FULL_SPHERE, HEMISPHERE * sine * (sine / (1.0 + cosine)))


def sphere_irradiance(
    radiance: npt.ArrayLike, radius: npt.ArrayLike, distance: npt.ArrayLike, cosine: npt.ArrayLike = 1.0
) -> FloatArray:
    """Irradiance from a uniform sphere, π L sin²a cosθ, also where the surface's horizon cuts it.

    Exact for one surface element that nothing else shadows. Falls as 1/d² at any distance, not only far away.

    Parameters
    ----------
    radiance : float or float array (...)
        Radiance L of the sphere, ≥ 0 [W m⁻² sr⁻¹].
    radius : float or float array (...)
        Radius R of the sphere, ≥ 0 [m].
    distance : float or float array (...)
        Distance d of the surface from the sphere's centre, ≥ 0 [m].
    cosine : float or float array (...)
        Cosine of the angle θ between normal and the sphere's centre, not clipped: a sphere whose centre is below the
        horizon may still be seen, −1 … 1 [1].

    Returns
    -------
    float64 array (...)
        Irradiance of the broadcast shape; π L inside of the sphere, whatever the normal [W m⁻²].

    Raises
    ------
    InputError
        If a value lies outside its range.

    Examples
    --------
    >>> print(f"{sphere_irradiance(1.0, 1.0, 2.0) / np.pi:.15f}")
    0.250000000000000
    """
    level = in_range("radiance", radiance, unit="W m⁻² sr⁻¹")
    r, d = in_range("radius", radius, unit="m"), in_range("distance", distance, unit="m")
    c = cosines("cosine", cosine)
    sine, cos_a = _sine_cosine(r, d)
    factor = np.where(c >= sine, np.pi * sine * sine * c, _cut_sphere(sine, cos_a, c))
    factor = np.where(c <= -sine, 0.0, factor)
    return np.asarray(level * np.where(r > d, np.pi, factor))


def _sine_cosine(r: FloatArray, d: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return sine and cosine of the half-angle, both to full relative accuracy; of no meaning inside."""
    with np.errstate(divide="ignore", invalid="ignore"):
        sine = np.minimum(r / d, 1.0)
        above = np.where(np.isinf(d), 1.0, np.maximum(d - r, 0.0) / d)
        return np.asarray(sine), np.sqrt(above * (1.0 + sine))


def _cut_sphere(s: FloatArray, cos_a: FloatArray, c: FloatArray) -> FloatArray:
    """Return E / L of a sphere that the horizon cuts; the module's derivation has the letters."""
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(np.maximum((s - c) * (s + c), 0.0))
        angle = np.arctan2(root, -c * cos_a)
        t = root / cos_a
        square = np.minimum(t * t, _SERIES_BELOW**2)
        lack = t * square * np.polynomial.polynomial.polyval(square, _SERIES)
        rest = np.where(t < _SERIES_BELOW, s * s * t - lack, np.arctan2(root, cos_a) - cos_a * root)
        return np.asarray(s * s * c * angle + rest)
