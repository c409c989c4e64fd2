"""Lambertian surfaces: the same radiance in every direction.

Their BRDF is one number ρ [sr⁻¹]; albedo is πρ [1], the share of the received power that leaves again.
"""

import numpy as np
import numpy.typing as npt

from psstereo.radiometry.checks import in_range
from psstereo.types import FloatArray

__all__ = ["albedo_from_brdf", "brdf_from_albedo", "lambertian_exitance", "lambertian_radiance"]


def lambertian_radiance(brdf: npt.ArrayLike, irradiance: npt.ArrayLike) -> FloatArray:
    """Radiance of a Lambertian surface, L_out = ρ E, toward every direction above it.

    Not for surfaces that shine: their radiance depends on where the eye is.

    Parameters
    ----------
    brdf : float or float array (...)
        BRDF ρ, ≥ 0; a surface that makes no light has at most 1/π [sr⁻¹].
    irradiance : float or float array (...)
        Irradiance E, ≥ 0 [W m⁻²].

    Returns
    -------
    float64 array (...)
        Radiance of the broadcast shape [W m⁻² sr⁻¹].

    Raises
    ------
    InputError
        If a value is negative, or a scalar is not finite.

    Examples
    --------
    >>> print(lambertian_radiance(0.25, [0.0, 4.0]))
    [0. 1.]
    """
    return np.asarray(in_range("BRDF", brdf, unit="sr⁻¹") * in_range("irradiance", irradiance, unit="W m⁻²"))


def lambertian_exitance(brdf: npt.ArrayLike, irradiance: npt.ArrayLike) -> FloatArray:
    """Exitance of a Lambertian surface, M = π L_out = π ρ E: the power that leaves it into the hemisphere.

    Parameters
    ----------
    brdf : float or float array (...)
        BRDF ρ, ≥ 0 [sr⁻¹].
    irradiance : float or float array (...)
        Irradiance E, ≥ 0 [W m⁻²].

    Returns
    -------
    float64 array (...)
        Exitance of the broadcast shape [W m⁻²].

    Raises
    ------
    InputError
        If a value is negative, or a scalar is not finite.

    Examples
    --------
    >>> print(f"{lambertian_exitance(1 / np.pi, 5.0):.1f}")  # a white surface returns all of it
    5.0
    """
    return np.asarray(np.pi * lambertian_radiance(brdf, irradiance))


def albedo_from_brdf(brdf: npt.ArrayLike) -> FloatArray:
    """Albedo of a Lambertian surface, πρ.

    Parameters
    ----------
    brdf : float or float array (...)
        BRDF ρ, ≥ 0 [sr⁻¹].

    Returns
    -------
    float64 array (...)
        Albedo [1].

    Raises
    ------
    InputError
        If a value is negative, or a scalar is not finite.

    Examples
    --------
    >>> print(f"{albedo_from_brdf(0.1):.4f}")
    0.3142
    """
    return np.asarray(np.pi * in_range("BRDF", brdf, unit="sr⁻¹"))


def brdf_from_albedo(albedo: npt.ArrayLike) -> FloatArray:
    """BRDF of a Lambertian surface, albedo / π.

    Parameters
    ----------
    albedo : float or float array (...)
        Albedo, ≥ 0 [1].

    Returns
    -------
    float64 array (...)
        BRDF ρ [sr⁻¹].

    Raises
    ------
    InputError
        If a value is negative, or a scalar is not finite.

    Examples
    --------
    >>> print(f"{brdf_from_albedo(1.0):.4f}")
    0.3183
    """
    return np.asarray(in_range("albedo", albedo, unit="1") / np.pi)
