"""Irradiance from sources so narrow that the cosine is the same over all of them."""

import numpy as np
import numpy.typing as npt

from psstereo.radiometry.checks import cosines, directions, in_range
from psstereo.radiometry.constants import FULL_SPHERE
from psstereo.types import FloatArray

__all__ = ["incidence_cosine", "narrow_irradiance"]


def incidence_cosine(normals: npt.ArrayLike, direction: npt.ArrayLike) -> FloatArray:
    """Cosine of the angle of incidence, max(0, n·l).

    Parameters
    ----------
    normals : float array (..., 3)
        Unit normals of the surface; NaN where not known [1].
    direction : float array (3,) or (..., 3)
        Unit vectors from the surface to the light. The leading axes broadcast with those of the normals: for m lights
        over (h, w, 3) normals, give ``directions[:, None, None, :]`` and get (m, h, w) [1].

    Returns
    -------
    float64 array (...)
        Cosine of the broadcast shape of the leading axes, 0 … 1; NaN where a vector is [1].

    Raises
    ------
    InputError
        If a vector's length is not 1 (to 1e-6), or a single vector is not a number.

    Examples
    --------
    >>> print(incidence_cosine([[0, 0, 1], [0, 0, -1], [0.6, 0, 0.8]], [0, 0, 1]))
    [1.  0.  0.8]
    """
    n, light = directions("normals", normals), directions("direction", direction)
    return np.asarray(np.clip(np.einsum("...i,...i->...", n, light), 0.0, 1.0))


def narrow_irradiance(radiance: npt.ArrayLike, solid_angle: npt.ArrayLike, cosine: npt.ArrayLike = 1.0) -> FloatArray:
    """Irradiance from a narrow source, E = L Ω max(0, cosθ).

    Not for sources wider than a few degrees or partly under the surface's horizon: `sphere_irradiance`, or the lights.
    For a source of half-angle a that faces the surface, L Ω is too large by 1 + tan²(a/2).

    Parameters
    ----------
    radiance : float or float array (...)
        Radiance L of the source, ≥ 0 [W m⁻² sr⁻¹].
    solid_angle : float or float array (...)
        Solid angle Ω of the source, 0 … 4π; it falls as 1/d² far away, and with it the irradiance [sr].
    cosine : float or float array (...)
        Cosine of the angle θ between normal and source, −1 … 1 [1].

    Returns
    -------
    float64 array (...)
        Irradiance of the broadcast shape [W m⁻²].

    Raises
    ------
    InputError
        If a value lies outside its range.

    Examples
    --------
    >>> print(f"{narrow_irradiance(2.0e7, 6.8e-5):.1f}")
    1360.0
    """
    level = in_range("radiance", radiance, unit="W m⁻² sr⁻¹")
    solid = in_range("solid angle", solid_angle, unit="sr", high=FULL_SPHERE)
    return np.asarray(level * solid * np.maximum(0.0, cosines("cosine", cosine)))
