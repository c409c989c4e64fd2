"""Light that a surface reflects onto itself, once."""

from dataclasses import replace

import numpy as np

from psstereo.brdf import Lambert
from psstereo.errors import UnsupportedError
from psstereo.forward import Geometry, Shadows, shade
from psstereo.lights import Light
from psstereo.types import FloatArray
from psstereo_synth.meshes import Gather, RayCaster
from psstereo_synth.rendering.field import HeightField
from psstereo_synth.scenes import Scene

__all__ = ["Bounce", "Radiosity"]


class Radiosity:
    """What the parts of a surface send out under a light, by the diffuse part of its reflectance.

    It does not depend on who looks: it is found once for each light, and kept for all views and for the exposure.

    Parameters
    ----------
    scene : Scene
        Surface and material.
    patches : (RayCaster, HeightField or None)
        The surface as triangles, whose middles send light out, and the field that they stand for.
    shadows : Shadows or None
        What stands in the light of those.

    Raises
    ------
    UnsupportedError
        If the diffuse part of the reflectance is not known.
    """

    def __init__(self, scene: Scene, patches: tuple[RayCaster, HeightField | None], shadows: Shadows | None) -> None:
        caster, self.field = patches
        self.caster = caster
        self._shadows = shadows
        self._beams = scene.beams
        self._usable = caster.mesh.areas > 0  # a triangle without area has no side to send light to
        centres, normals = caster.mesh.centres[self._usable], caster.mesh.face_normals[self._usable]
        albedo = scene.material.brdf(centres).diffuse_albedo
        if not np.isfinite(albedo).all():
            raise UnsupportedError(
                given=f"Bounced light is asked for on a surface of the reflectance {scene.material.name}.",
                needed="A reflectance whose diffuse part is known.",
                remedy="Leave bounce out, or take another reflectance.",
            )
        self._matte = Lambert(albedo=np.broadcast_to(albedo, (len(centres), albedo.shape[-1])))
        # The faces are looked at along their normals, so that none is turned away.
        self._faces = Geometry(points=centres, normals=normals, to_eye=normals, mask=np.ones((1, len(centres)), bool))
        self._known: dict[int, tuple[Light, FloatArray]] = {}

    def of(self, light: Light) -> FloatArray:
        """Return what each triangle sends out, (f, c) [W m⁻²]."""
        known = self._known.get(id(light))
        if known is None:
            direct = shade(self._faces, self._matte, light, shadows=self._shadows, beams=self._beams)
            sent = np.zeros((len(self._usable), direct.radiance.shape[1]))
            sent[self._usable] = np.pi * direct.radiance
            known = self._known[id(light)] = (light, sent)  # the light stays, and so does its id
        return known[1]


class Bounce:
    """One bounce of interreflection between the diffuse parts of a surface.

    What the points see in a fixed set of directions is found once and serves all lights. Highlights take no part: they
    would need directions of their own.

    Parameters
    ----------
    radiosity : Radiosity
        What the surface sends out.
    geometry : Geometry
        The points that receive light.
    samples : int
        Directions a point.
    seed : int
        Of the directions.
    """

    def __init__(self, radiosity: Radiosity, geometry: Geometry, *, samples: int, seed: int) -> None:
        self._radiosity = radiosity
        if radiosity.field is not None:
            geometry = replace(geometry, points=radiosity.field.raised(geometry.points))
        self._gather = Gather.prepare(geometry, radiosity.caster, samples=samples, seed=seed)

    def irradiance(self, light: Light) -> FloatArray:
        """Return what the points receive from the rest of the surface under a light, (p, c) [W m⁻²]."""
        return self._gather.irradiance(self._radiosity.of(light))
