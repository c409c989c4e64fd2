"""Étendue: how much room two openings leave for rays.

Through area dA into solid angle dΩ under the angle θ runs the power dΦ = L dA cosθ dΩ. The geometric factor
G = ∬ dA cosθ dΩ is the étendue [m² sr], and Φ = L G where the radiance is uniform.
"""

import numpy as np
import numpy.typing as npt

from psstereo.radiometry.checks import in_range
from psstereo.types import FloatArray

__all__ = ["disc_etendue", "thin_etendue"]


def thin_etendue(area: npt.ArrayLike, far_area: npt.ArrayLike, length: npt.ArrayLike) -> FloatArray:
    """Étendue of a thin tube between two openings that face each other, G = A A' / d².

    Not for openings wider than about a tenth of the length (it is 0.5 % too large there): `disc_etendue`.

    Parameters
    ----------
    area, far_area : float or float array (...)
        Areas A and A' of the two openings, ≥ 0 [m²].
    length : float or float array (...)
        Distance d between them, > 0 [m].

    Returns
    -------
    float64 array (...)
        Étendue of the broadcast shape [m² sr].

    Raises
    ------
    InputError
        If an area is negative, or a length is not positive.

    Examples
    --------
    >>> print(f"{thin_etendue(1.0, 4.0, 10.0):.3f}")
    0.040
    """
    near, far = in_range("area", area, unit="m²"), in_range("far area", far_area, unit="m²")
    distance = in_range("length", length, unit="m", exclude_low=True)
    return np.asarray((near / distance) * (far / distance))


def disc_etendue(radius: npt.ArrayLike, far_radius: npt.ArrayLike, length: npt.ArrayLike) -> FloatArray:
    """Exact étendue between two coaxial discs that face each other [1]_.

    With X = a² + b² + d²: G = π²/2 (X − √(X² − 4a²b²)), computed as 2π²a²b² / (X + √((d² + (a − b)²)(d² + (a + b)²))),
    which does not cancel in a thin tube.

    Parameters
    ----------
    radius, far_radius : float or float array (...)
        Radii a and b of the two discs, ≥ 0 [m].
    length : float or float array (...)
        Distance d between them, ≥ 0 [m].

    Returns
    -------
    float64 array (...)
        Étendue of the broadcast shape; π²a²b²/d² for a thin tube, π² min(a, b)² for touching discs, NaN where all three
        are 0 [m² sr].

    Raises
    ------
    InputError
        If a radius or the length is negative, or a scalar is not finite.

    References
    ----------
    .. [1] J. R. Howell, "A catalog of radiation heat transfer configuration factors", entry C-41,
       http://www.thermalradiation.net

    Examples
    --------
    >>> print(f"{disc_etendue(1.0, 2.0, 0.0) / np.pi**2:.15f}")
    1.000000000000000
    """
    a, b = in_range("radius", radius, unit="m"), in_range("far radius", far_radius, unit="m")
    d = in_range("length", length, unit="m")
    with np.errstate(invalid="ignore", divide="ignore"):
        scale = np.maximum(np.maximum(a, b), d)
        u, v, w = a / scale, b / scale, d / scale
        spread = u * u + v * v + w * w + np.hypot(u - v, w) * np.hypot(u + v, w)
        return np.asarray(2.0 * np.pi**2 * (a * v) ** 2 / spread)
