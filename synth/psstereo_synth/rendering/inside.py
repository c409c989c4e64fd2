"""Lamps have to be outside of what they light."""

import numpy as np

from psstereo.errors import InputError
from psstereo.lights import Light
from psstereo.types import BoolArray, FloatArray
from psstereo_synth.meshes import TriangleMesh
from psstereo_synth.rendering.occlusion import Occlusion
from psstereo_synth.scenes import Scene

__all__ = ["require_lights_outside"]

_WAYS = np.array([[0.0, 0.0, 1.0], [0.62, 0.31, 0.72], [-0.47, 0.58, 0.66], [0.11, -0.83, 0.55], [-0.3, -0.2, -0.93]])
"""Directions in which a lamp looks for the surface; several, since a ray may slip through an edge."""
_PLACES = 16
"""Places of a lamp with an extent that are looked at, about."""
_FROM = np.array([[0.1234567, -0.7654321, -1.2345678]])
"""A point from which the places of a lamp are seen; an odd one, since a lamp cannot be seen from where it is."""


def require_lights_outside(scene: Scene, occlusion: Occlusion) -> None:
    """Refuse lamps that are below a height field or inside a mesh, with some part of them at least.

    Parameters
    ----------
    scene : Scene
        Surface and lights.
    occlusion : Occlusion
        Has the ray caster of a mesh.

    Raises
    ------
    InputError
        If a lamp is inside; the message says which.
    """
    for number, light in enumerate(scene.lights, 1):
        places = _places(light)
        inside = _inside(scene, occlusion, places) if len(places) else np.zeros(0, bool)
        if inside.any():
            where = np.array2string(places[inside][0], precision=4, suppress_small=True)
            raise InputError(
                given=f"Light {number}, a {light.name}, is inside the surface at {where}.",
                needed="A lamp stands in the open, before the surface.",
                remedy="Move it away from the surface, or toward the viewer.",
            )


def _places(light: Light) -> FloatArray:
    """Return where a near light is, (n, 3); none for those that are far away."""
    if not light.positional:
        return np.zeros((0, 3))
    beams = [(beam.directions, np.asarray(beam.distances)) for beam in light.beams(_FROM, _PLACES)]
    near = [direction.reshape(-1, 3) * distance.reshape(-1, 1) for direction, distance in beams if np.ndim(distance)]
    return np.asarray(np.concatenate([np.zeros((0, 3)), *near]) + _FROM)


def _inside(scene: Scene, occlusion: Occlusion, places: FloatArray) -> BoolArray:
    if not isinstance(scene.surface, TriangleMesh):
        # Where there is no surface nothing is below it.
        ground = scene.surface.evaluate(places[:, 0], places[:, 1]).height
        return places[:, 2] <= np.where(np.isnan(ground), -np.inf, ground)
    ways = _WAYS / np.linalg.norm(_WAYS, axis=1, keepdims=True)
    faces = occlusion.caster.first_hit(np.repeat(places, len(ways), axis=0), np.tile(ways, (len(places), 1)))[0]
    outward = np.einsum("pi,pi->p", scene.surface.face_normals[faces], np.tile(ways, (len(places), 1))) > 0
    # From inside of a closed surface every way leads to the back of a face.
    return np.asarray(((faces >= 0) & outward).reshape(len(places), len(ways)).all(axis=1))
