"""Solid angle of a flat disc, seen from anywhere.

The rays from an observer to a circle form an elliptic cone, also off the axis. In the cone's own axes it is
x²/A² + y²/B² < z², and its solid angle is an average over the unit disc u² + v² < 1 that has only positive terms:

    Ω = AB ∬ (1 + A²u² + B²v²)^(-3/2) du dv = (4/3) AB R_J(0, 1 + A², 1 + B², 1)

(the average is Carlson's multivariate function of exponent −3/2 and weights ½, ½, 1, which is a complete R_J [2]_).
Nothing cancels in it, neither far away, nor at the rim, nor in the plane of the disc, where the older forms subtract
elliptic integrals from each other [1]_.

With radius a, height h over the disc's plane and distance p from its axis, the cone's quadratic form has the
eigenvalues h² > 0 and those of [[h², hp], [hp, p² − a²]], of trace T = h² + p² − a² and determinant −a²h²:

    μ₁, −q = (T ± D) / 2,   D = √(h² + (p − a)²) √(h² + (p + a)²),   A² = q / μ₁,   B² = q / h²

The one of μ₁, q that would cancel follows from the product μ₁ q = a²h².

References
----------
.. [1] F. Paxton, "Solid angle calculation for a circular disk", Rev. Sci. Instrum. 30, 254-258, 1959,
   doi:10.1063/1.1716590
.. [2] B. C. Carlson, "Numerical computation of real or complex elliptic integrals", Numer. Algorithms 10, 13-26, 1995,
   doi:10.1007/BF02198293
"""

import numpy as np
import numpy.typing as npt

from psstereo.radiometry.checks import directions, in_range, vectors
from psstereo.radiometry.constants import HEMISPHERE
from psstereo.types import FloatArray

__all__ = ["disc_solid_angle", "disc_solid_angle_from"]

_LEAST_HEIGHT = 1e-60
"""Below this height, relative to the geometry, a point over the disc sees 2π to the last digit [1]."""


def disc_solid_angle(radius: npt.ArrayLike, height: npt.ArrayLike, offset: npt.ArrayLike = 0.0) -> FloatArray:
    """Solid angle that a disc subtends, on or off its axis, by a complete elliptic integral.

    Relative accuracy 1e-14 everywhere, whatever the size of the result. In the plane of the disc the value is the
    limit along its normal: 2π inside, π on the rim, 0 outside. Not for the *irradiance* from a disc, which has a cosine
    in the integral.

    Parameters
    ----------
    radius : float or float array (...)
        Radius a of the disc, ≥ 0 [m].
    height : float or float array (...)
        Distance h of the observer from the disc's plane, on either side (the sign is ignored) [m].
    offset : float or float array (...)
        Distance p of the observer from the disc's axis, ≥ 0 [m].

    Returns
    -------
    float64 array (...)
        Solid angle of the broadcast shape, 0 … 2π; NaN at infinity, and for a disc of radius 0 seen from its centre
        [sr].

    Raises
    ------
    InputError
        If radius or offset is negative, or a scalar is not finite.

    Examples
    --------
    >>> print(f"{disc_solid_angle(1.0, 0.3, 0.7):.12f}")
    3.662247291660
    """
    a, p = in_range("radius", radius, unit="m"), in_range("offset", offset, unit="m")
    h = np.abs(in_range("height", height, unit="m", low=-np.inf))
    a, h, p = np.broadcast_arrays(a, h, p)
    with np.errstate(all="ignore"):
        # By a power of two, which is exact: rounding would move a point that is close to the rim.
        shift = -np.frexp(np.maximum(np.maximum(a, h), p))[1]
        a, h, p = np.ldexp(a, shift), np.ldexp(h, shift), np.ldexp(p, shift)
        solid = _cone_solid_angle(a, np.maximum(h, _LEAST_HEIGHT), p)
    in_plane = np.select([p < a, (p == a) & (a > 0.0)], [HEMISPHERE, 0.5 * HEMISPHERE], np.nan)
    # Under the least height, what a point outside the rim sees falls in proportion to its height.
    low = h < _LEAST_HEIGHT
    solid = np.where(low & (p > a), solid * (h / _LEAST_HEIGHT), solid)
    return np.where(low & ~(p > a), in_plane, solid)


def _cone_solid_angle(a: FloatArray, h: FloatArray, p: FloatArray) -> FloatArray:
    """Return the solid angle of the elliptic cone; the module's derivation has the letters."""
    from scipy.special import elliprj

    trace = h * h + (p - a) * (p + a)
    spread = np.hypot(p - a, h) * np.hypot(p + a, h)
    larger = 0.5 * (np.abs(trace) + spread)
    narrow = trace >= 0.0
    tan_a = np.where(narrow, a * h / larger, larger / (a * h))
    tan_b = np.where(narrow, a / np.sqrt(larger), np.sqrt(larger) / h)
    carlson = elliprj(0.0, 1.0 + tan_a * tan_a, 1.0 + tan_b * tan_b, 1.0)
    return np.asarray(np.minimum(4.0 / 3.0 * tan_a * tan_b * carlson, HEMISPHERE))


def disc_solid_angle_from(
    points: npt.ArrayLike, centre: npt.ArrayLike, normal: npt.ArrayLike, radius: npt.ArrayLike
) -> FloatArray:
    """Solid angle that a disc in space subtends at given points.

    Near the rim height and offset are differences of coordinates: the result is as accurate as those are. Where they
    are known, give them to `disc_solid_angle`.

    Parameters
    ----------
    points : float array (..., 3)
        Observers, on either side of the disc [m].
    centre : float array (..., 3)
        Centre of the disc [m].
    normal : float array (..., 3)
        Unit normal of the disc, of either sign [1].
    radius : float or float array (...)
        Radius of the disc, ≥ 0 [m].

    Returns
    -------
    float64 array (...)
        Solid angle of the broadcast shape of the leading axes, 0 … 2π [sr].

    Raises
    ------
    InputError
        If a radius is negative, a normal has not length 1, or a last axis has not 3 components.
    """
    n = directions("disc's normal", normal)
    arm = vectors("points", points) - vectors("centre", centre)
    height = np.einsum("...i,...i->...", arm, n)
    across = np.cross(n, arm)
    return disc_solid_angle(radius, height, np.sqrt(np.einsum("...i,...i->...", across, across)))
