"""The forward model of a matte surface: L_out = ρ E, the same from every viewpoint."""

import numpy as np

from psstereo.errors import InputError
from psstereo.lights import Rig
from psstereo.types import FloatArray

__all__ = ["lambertian_images"]


def lambertian_images(
    normals: FloatArray, brdf: FloatArray, rig: Rig, *, points: FloatArray | None = None
) -> FloatArray:
    """Return the radiance of a Lambertian surface under each light, attached shadows only.

    Nothing casts a shadow on anything else and no light is reflected twice: right for convex surfaces, and for reliefs
    whose slopes stay below the lights' elevation.

    Parameters
    ----------
    normals : float array (h, w, 3)
        Unit normals, x right, y up, z toward the camera; NaN where there is no surface [1].
    brdf : float array (h, w) or (h, w, c)
        Constant BRDF ρ = albedo / π [sr⁻¹].
    rig : Rig
        The lights; strengths are irradiances [W m⁻²].
    points : float array (h, w, 3), optional
        Surface points, needed if a light is near.

    Returns
    -------
    float64 array (m, h, w, c)
        Radiance, 0 where there is no surface [W m⁻² sr⁻¹].

    Raises
    ------
    InputError
        If shapes disagree, ρ is negative, or points are missing.

    Examples
    --------
    >>> flat = np.array([[[0.0, 0.0, 1.0]]])
    >>> rig = Rig.distant([[0, 0, 1], [0, 0.6, 0.8]], [1000.0, 1000.0])
    >>> lambertian_images(flat, np.array([[0.5 / np.pi]]), rig).ravel().round(3)
    array([159.155, 127.324])
    """
    n = np.asarray(normals, np.float64)
    rho = np.asarray(brdf, np.float64)
    rho = rho[..., None] if rho.ndim == 2 else rho
    if n.ndim != 3 or n.shape[2] != 3 or rho.ndim != 3 or rho.shape[:2] != n.shape[:2]:
        raise InputError(
            given=f"Normals have the shape {n.shape}, ρ the shape {np.shape(brdf)}.",
            needed="Normals are (h, w, 3) and ρ is (h, w) or (h, w, c).",
            remedy="Give both for the same image.",
        )
    if (rho < 0).any():
        raise InputError(
            given=f"The smallest ρ is {np.nanmin(rho):.4g} sr⁻¹.",
            needed="A surface cannot reflect a negative share of the light.",
            remedy="Give ρ of zero or more; ρ = albedo / π.",
        )
    if points is None and not rig.all_distant:
        raise InputError(
            given="A light is near, and no surface points are given.",
            needed="Irradiance from a near light depends on where the surface is.",
            remedy="Give points, such as camera.points(depth).",
        )
    if points is not None and np.shape(points) != n.shape:
        raise InputError(
            given=f"Points have the shape {np.shape(points)}, normals the shape {n.shape}.",
            needed="There must be one point for each normal.",
            remedy="Give both for the same image.",
        )
    where = n if points is None else np.asarray(points, np.float64)
    corner = where[:1, :1], n[:1, :1]  # tells the channels of a light
    channels = {rho.shape[2], *(light.irradiance(*corner).shape[-1] for light in rig.lights)} - {1}
    if len(channels) > 1:
        raise InputError(
            given=f"ρ and the lights have {' and '.join(str(c) for c in sorted(channels))} channels.",
            needed="They must have the same number of channels, or one.",
            remedy="Give ρ and the lights' strengths for the same channels.",
        )
    shape = (*n.shape[:2], max(channels, default=1))
    images = [np.broadcast_to(rho * light.irradiance(where, n), shape) for light in rig.lights]
    return np.nan_to_num(np.stack(images), nan=0.0)
