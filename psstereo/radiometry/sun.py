"""The sun as a light: irradiance from its radiance, and back."""

import numpy as np
import numpy.typing as npt

from psstereo.radiometry.checks import in_range
from psstereo.radiometry.constants import FULL_SPHERE, SUN_SOLID_ANGLE
from psstereo.radiometry.irradiance import incidence_cosine, narrow_irradiance
from psstereo.types import FloatArray

__all__ = ["sun_irradiance", "sun_radiance"]


def sun_irradiance(
    radiance: npt.ArrayLike,
    normals: npt.ArrayLike,
    direction: npt.ArrayLike,
    *,
    solid_angle: npt.ArrayLike = SUN_SOLID_ANGLE,
) -> FloatArray:
    """Irradiance from a sun, E = L_sun Ω_sun max(0, n·l).

    Not where the sun's disc is partly below the surface's horizon, within half a degree of grazing:
    `sphere_irradiance` is exact there.

    Parameters
    ----------
    radiance : float or float array (...)
        Radiance of the sun's disc, ≥ 0, broadcast with the leading axes [W m⁻² sr⁻¹].
    normals : float array (..., 3)
        Unit normals of the surface; NaN where not known [1].
    direction : float array (3,) or (..., 3)
        Unit vectors from the surface to the sun; see `incidence_cosine` for broadcasting [1].
    solid_angle : float or float array (...)
        Solid angle of the sun's disc, broadcast with the leading axes [sr].

    Returns
    -------
    float64 array (...)
        Irradiance of the broadcast shape; NaN where a normal is [W m⁻²].

    Raises
    ------
    InputError
        If a vector's length is not 1, or radiance or solid angle is negative.

    Examples
    --------
    >>> print(f"{sun_irradiance(2.0e7, [0, 0, 1], [0.6, 0, 0.8]):.1f}")
    1088.0
    """
    return narrow_irradiance(radiance, solid_angle, incidence_cosine(normals, direction))


def sun_radiance(
    irradiance: npt.ArrayLike,
    normals: npt.ArrayLike,
    direction: npt.ArrayLike,
    *,
    solid_angle: npt.ArrayLike = SUN_SOLID_ANGLE,
) -> FloatArray:
    """Radiance of the sun's disc from a measured irradiance, L_sun = E / (Ω_sun n·l); inverse of `sun_irradiance`.

    The irradiance must come from the sun alone, without skylight. Not for grazing light, where errors of the normals
    are magnified by 1 / n·l.

    Parameters
    ----------
    irradiance : float or float array (...)
        Irradiance on the surface, ≥ 0, broadcast with the leading axes [W m⁻²].
    normals : float array (..., 3)
        Unit normals of the surface; the direction itself for a meter that faces the sun [1].
    direction : float array (3,) or (..., 3)
        Unit vectors from the surface to the sun; see `incidence_cosine` for broadcasting [1].
    solid_angle : float or float array (...)
        Solid angle of the sun's disc, > 0, broadcast with the leading axes [sr].

    Returns
    -------
    float64 array (...)
        Radiance of the broadcast shape; NaN where the surface is turned away from the sun [W m⁻² sr⁻¹].

    Raises
    ------
    InputError
        If a vector's length is not 1, an irradiance is negative, or a solid angle is not positive.

    Examples
    --------
    >>> print(f"{sun_radiance(1361.0, [0, 0, 1], [0, 0, 1]):.2e}")
    2.00e+07
    """
    received = in_range("irradiance", irradiance, unit="W m⁻²")
    solid = in_range("solid angle", solid_angle, unit="sr", high=FULL_SPHERE, exclude_low=True)
    cosine = incidence_cosine(normals, direction)
    return np.asarray(received / (solid * np.where(cosine > 0.0, cosine, np.nan)))
