"""Shadows that a mesh throws, by casting rays."""

from hashlib import blake2b
from typing import ClassVar

import numpy as np

from psstereo.errors import InputError
from psstereo.forward.shadows import Shadows
from psstereo.lights import Beam
from psstereo.types import BoolArray, FloatArray
from psstereo_synth.meshes.mesh import TriangleMesh
from psstereo_synth.meshes.rays import RayCaster

__all__ = ["RayShadows"]


class RayShadows(Shadows):
    """Points see a source unless a triangle lies between them.

    Works on points of the mesh and on any others, and for sources at any distance; a source behind a triangle throws no
    light through it from either side. Points that face away from the source are told as dark where their own body is in
    the way. Each beam is cast on its own: an extended light's soft shadow comes from its quadrature.

    Parameters
    ----------
    mesh : TriangleMesh or RayCaster
        What throws shadows, in the frame of the points; a caster that exists already saves building its tree.
    """

    name: ClassVar[str] = "rays"

    def __init__(self, mesh: TriangleMesh | RayCaster) -> None:
        self.caster = mesh if isinstance(mesh, RayCaster) else RayCaster(mesh)
        self._last: tuple[bytes, FloatArray] | None = None

    def __reduce__(self) -> tuple[type["RayShadows"], tuple[RayCaster]]:
        return RayShadows, (self.caster,)

    def lit(self, points: FloatArray, normals: FloatArray, beam: Beam) -> BoolArray:
        """Return whether nothing lies between points and source; see :meth:`psstereo.forward.shadows.Shadows.lit`.

        Rays start a little off the surface, see :meth:`RayCaster.lifted`, and aim at the same place as the beam.

        Raises
        ------
        InputError
            If a number is not finite, or shapes disagree.
        """
        p = np.asarray(points, np.float64)
        starts = self._starts(p, np.asarray(normals, np.float64))
        directions = np.asarray(beam.directions, np.float64)
        distances = np.asarray(beam.distances, np.float64)
        if directions.shape not in ((3,), p.shape) or distances.shape not in ((), p.shape[:1]):
            raise InputError(
                given=f"A beam has directions {directions.shape} and distances {distances.shape} for points {p.shape}.",
                needed="One direction and distance, or one for each point.",
                remedy="Take the beam of these very points.",
            )
        if not (distances >= 0).all():
            raise InputError(
                given="A beam's distance to its source is negative or not a number.",
                needed="Distances of zero or more, infinite for a distant source.",
                remedy="Leave out points at which the light is not defined.",
            )
        directions = np.broadcast_to(directions, p.shape)
        near = np.broadcast_to(np.isfinite(distances), len(p))
        reach = np.where(near, distances, 1.0)
        aim = np.where(near[:, None], p + reach[:, None] * directions - starts, directions)
        return ~self.caster.occluded(starts, aim, np.where(near, 1.0, np.inf))

    def _starts(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Return where rays start, kept for the next beam: a rig asks for the same points over and over."""
        digest = blake2b(np.ascontiguousarray(points).data, digest_size=16)
        digest.update(np.ascontiguousarray(normals).data)
        key, last = digest.digest(), self._last
        if last is None or last[0] != key or last[1].shape != points.shape:
            last = key, self.caster.lifted(points, normals)
            self._last = last
        return last[1]
