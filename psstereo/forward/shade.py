"""Radiance of a surface under a light: L_out = ∫ ρ L n·l dΩ, with whatever is in the way of the light."""

from dataclasses import dataclass

import numpy as np

from psstereo.brdf import Brdf
from psstereo.errors import InputError
from psstereo.forward.geometry import Geometry
from psstereo.forward.shadows import Shadows
from psstereo.lights import Beam, Light
from psstereo.types import FloatArray

__all__ = ["Shading", "shade"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Shading:
    """What a surface sends to the camera under one light.

    Attributes
    ----------
    radiance : float64 array (p, c)
        Radiance toward the camera [W m⁻² sr⁻¹].
    visibility : float64 array (p,)
        Share of the irradiance from the light's part above the surface's horizon that nothing blocks: 1 in the light,
        0 in cast shadow or where the surface turns away, between the two in a penumbra [1].
    """

    radiance: FloatArray
    visibility: FloatArray


def shade(
    geometry: Geometry,
    brdf: Brdf,
    light: Light,
    *,
    shadows: Shadows | None = None,
    beams: int = 64,
    extinction: float = 0.0,
) -> Shading:
    """Return the radiance of a surface toward the camera under one light.

    Light that a matte surface receives is exact, from the light's closed form; an extended light is split into beams
    only for its penumbra, or where the surface is glossy. Without `shadows` nothing is in the way of anything: right
    for convex surfaces. Light that other parts of the surface reflect is not included.

    Parameters
    ----------
    geometry : Geometry
        What the camera sees, in the light's frame.
    brdf : Brdf
        Reflectance; maps have a row for each of the geometry's points.
    light : Light
        Where light comes from.
    shadows : Shadows, optional
        What may be in the way.
    beams : int
        About how many directions stand for an extended light, where it has to be split.
    extinction : float
        Share of the radiance that a homogeneous medium takes away per length, on the way from a near light and to the
        eye, where that is at a finite distance [length⁻¹].

    Returns
    -------
    Shading
        Radiance and visibility of each point.

    Raises
    ------
    InputError
        If channels disagree, or a number means nothing.
    """
    _require(geometry, brdf, light, beams, extinction)
    through_air = extinction > 0 and light.positional
    if brdf.constant and not through_air:
        shading = _matte(geometry, brdf, light, shadows, beams)
    else:
        shading = _by_beams(geometry, brdf, light, shadows, beams, extinction=extinction if through_air else 0.0)
    radiance = shading.radiance
    if not geometry.all_face_eye:
        radiance = np.where(geometry.faces_eye[:, None], radiance, 0.0)
    if extinction > 0 and geometry.eye_distances is not None:
        radiance = radiance * np.exp(-extinction * geometry.eye_distances)[:, None]
    return Shading(radiance=radiance, visibility=shading.visibility)


def _matte(geometry: Geometry, brdf: Brdf, light: Light, shadows: Shadows | None, beams: int) -> Shading:
    """Shade a surface whose ρ is constant: ρ times the exact irradiance times the share that arrives."""
    irradiance = light.irradiance(geometry.points, geometry.normals)
    reached = irradiance.max(axis=-1) > 0
    visibility = reached.astype(np.float64)
    if shadows is not None:
        if light.extended:
            visibility *= _share(geometry, light, shadows, beams)
        else:
            visibility *= shadows.lit(geometry.points, geometry.normals, next(light.beams(geometry.points, 1)))
        irradiance = irradiance * visibility[:, None]
    return Shading(radiance=np.asarray(brdf.diffuse_albedo * (irradiance / np.pi)), visibility=visibility)


def _share(geometry: Geometry, light: Light, shadows: Shadows, beams: int) -> FloatArray:
    """Return the share of an extended light's irradiance that arrives; it weighs the exact irradiance."""
    arriving, all_of_it = np.zeros((2, len(geometry.points)))
    for beam in light.beams(geometry.points, beams):
        weight = _cosine(geometry, beam) * beam.irradiance.mean(axis=-1)
        all_of_it += weight
        arriving += weight * shadows.lit(geometry.points, geometry.normals, beam)
    return np.divide(arriving, all_of_it, out=np.zeros_like(arriving), where=all_of_it > 0)


def _by_beams(
    geometry: Geometry, brdf: Brdf, light: Light, shadows: Shadows | None, beams: int, *, extinction: float
) -> Shading:
    """Shade a surface of any reflectance, beam by beam."""
    count = len(geometry.points)
    radiance = np.zeros((count, max(brdf.channels, light.channels)))
    arriving, all_of_it = np.zeros((2, count))
    for beam in light.beams(geometry.points, beams):
        cosine = _cosine(geometry, beam)
        weight = cosine * beam.irradiance.mean(axis=-1)
        all_of_it += weight
        if shadows is not None:
            lit = shadows.lit(geometry.points, geometry.normals, beam)
            cosine, weight = cosine * lit, weight * lit
        arriving += weight
        if extinction > 0:
            cosine = cosine * np.exp(-extinction * np.asarray(beam.distances))
        rho = brdf.evaluate(geometry.normals, beam.directions, geometry.to_eye)
        radiance += rho * (cosine[:, None] * beam.irradiance)
    visibility = np.divide(arriving, all_of_it, out=np.zeros_like(arriving), where=all_of_it > 0)
    return Shading(radiance=radiance, visibility=visibility)


def _cosine(geometry: Geometry, beam: Beam) -> FloatArray:
    return np.asarray(np.maximum(_dot(geometry.normals, beam.directions), 0.0))


def _dot(normals: FloatArray, directions: FloatArray) -> FloatArray:
    """Return the scalar products of normals (p, 3) with one direction (3,) or one each."""
    if directions.ndim == 1:
        return np.asarray(normals @ directions)
    return np.asarray(np.einsum("pi,pi->p", normals, directions))


def _require(geometry: Geometry, brdf: Brdf, light: Light, beams: int, extinction: float) -> None:
    channels = {brdf.channels, light.channels} - {1}
    if len(channels) > 1:
        raise InputError(
            given=f"The surface reflects {brdf.channels} channels; the light has {light.channels}.",
            needed="They must have the same number of channels, or one.",
            remedy="Give reflectance and light for the same channels.",
        )
    if beams < 1 or not 0 <= extinction < np.inf:
        raise InputError(
            given=f"{beams} beams and an extinction of {extinction} are asked for.",
            needed="One beam or more, and a finite extinction of zero or more.",
            remedy="Correct them.",
        )
    maps = brdf.diffuse_albedo
    if maps.ndim > 1 and len(maps) != len(geometry.points):
        raise InputError(
            given=f"The reflectance is a map of {len(maps)} points; the camera sees {len(geometry.points)}.",
            needed="One row for each point under the mask.",
            remedy="Restrict the map with brdf.at(mask).",
        )
