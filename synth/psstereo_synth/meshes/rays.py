"""Rays through a mesh: what they hit first, and whether anything is in the way."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from psstereo.errors import InputError
from psstereo.types import BoolArray, FloatArray, IntArray
from psstereo_synth.meshes.exact import Neighbours, meet
from psstereo_synth.meshes.mesh import TriangleMesh

__all__ = ["RayCaster"]

_BLOCK = 1 << 16
_STEP = 32 * 2.0**-23
"""How far rays start above the surface, in radii of the mesh: some rounding errors of single precision [1]."""
_PROBE = 1e-4
_ATTEMPTS = 8


class RayCaster:
    """Casts rays at a mesh: Embree finds the triangle in single precision, double precision says where it is met.

    Embree works on the mesh scaled into the unit ball, and rays start at that ball, so neither the unit of length nor a
    far camera costs precision. A ray through the seam of two triangles does not slip through (Embree's robust mode).
    What is left to single precision is which of two triangles closer than about 1e-6 radii is the first, and whether a
    ray meets an outline that it passes within as much.

    Nothing changes after construction, so any number of threads may use one caster.

    Parameters
    ----------
    mesh : TriangleMesh
        The triangles, seen from both sides.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        from embreex.mesh_construction import TriangleMesh as EmbreeMesh
        from embreex.rtcore_scene import EmbreeScene

        self.mesh = mesh
        self._neighbours = Neighbours(mesh)
        self._scene: Any = EmbreeScene(robust=True)
        scaled = (mesh.vertices - mesh.middle) / mesh.radius
        EmbreeMesh(self._scene, scaled.astype(np.float32), mesh.faces.astype(np.int32))
        # The first query builds the tree; afterwards queries only read it.
        self._scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))

    def __reduce__(self) -> tuple[type["RayCaster"], tuple[TriangleMesh]]:
        return RayCaster, (self.mesh,)

    @property
    def step(self) -> float:
        """How far :meth:`lifted` goes off a triangle [length]."""
        return _STEP * self.mesh.radius

    def faces_hit(self, origins: FloatArray, directions: FloatArray) -> IntArray:
        """Return the first triangle on each ray in single precision: quick, and now and then a neighbour of it.

        Parameters
        ----------
        origins : float array (p, 3)
            Where the rays start; not on the surface, see :meth:`lifted` [length].
        directions : float array (p, 3)
            Where to, of any length [1].

        Returns
        -------
        int64 array (p,)
            Triangles, −1 where there is none.

        Raises
        ------
        InputError
            If a number is not finite, a direction is zero, or shapes disagree.
        """
        o, d = _rays(origins, directions)
        hits = [self._run(o[block], d[block], None) for block in _blocks(len(o))]
        return np.concatenate(hits) if hits else np.zeros(0, np.int64)

    def first_hit(self, origins: FloatArray, directions: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return what each ray hits first.

        Parameters
        ----------
        origins : float array (p, 3)
            Where the rays start; not on the surface, see :meth:`lifted` [length].
        directions : float array (p, 3)
            Where to, of any length [1].

        Returns
        -------
        faces : int64 array (p,)
            Triangles, −1 where there is none.
        distances : float64 array (p,)
            How far, in lengths of the direction; infinite where there is no triangle [1].
        weights : float64 array (p, 3)
            Barycentric coordinates in the triangle; NaN where there is none [1].

        Raises
        ------
        InputError
            If a number is not finite, a direction is zero, or shapes disagree.
        """
        o, d = _rays(origins, directions)
        faces, distances, weights = np.full(len(o), -1), np.full(len(o), np.inf), np.full((len(o), 3), np.nan)
        for block in _blocks(len(o)):
            faces[block], distances[block], weights[block] = self._first_hit(o[block], d[block])
        return faces, distances, weights

    def occluded(
        self, origins: FloatArray, directions: FloatArray, distances: FloatArray | float = np.inf
    ) -> BoolArray:
        """Return whether a triangle lies on each ray before its end.

        Parameters
        ----------
        origins : float array (p, 3)
            Where the rays start; not on the surface, see :meth:`lifted` [length].
        directions : float array (p, 3)
            Where to, of any length [1].
        distances : float array (p,) or float
            Where the rays end, in lengths of the direction [1].

        Returns
        -------
        bool array (p,)
            True where something is in the way.

        Raises
        ------
        InputError
            If a number of a ray is not finite, a direction is zero, a distance is NaN or negative, or shapes disagree.
        """
        o, d = _rays(origins, directions)
        reach = np.broadcast_to(np.asarray(distances, np.float64), len(o))
        if not (reach >= 0).all():
            raise InputError(
                given=f"A ray ends at the distance {reach[~(reach >= 0)][0]}.",
                needed="Distances are zero or more.",
                remedy="Give the distance to the source, infinity for a distant one.",
            )
        blocked = [self._run(o[block], d[block], reach[block], "OCCLUDED") >= 0 for block in _blocks(len(o))]
        return np.concatenate(blocked) if blocked else np.zeros(0, bool)

    def lifted(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Return where rays from points of the surface start, so that they do not hit the triangle that they leave.

        A point of this mesh goes off its triangle by :attr:`step`, to the side of its normal. If the mesh is smooth, it
        first goes onto the curved surface that its triangle stands for [1]_: otherwise light that arrives between the
        planes of the smooth normal and of the triangle would be cut off by the triangle itself, and the edge of the
        attached shadow be ragged. Such points are moved by about the triangle's sagitta, so a coarse smooth mesh loses
        shadows of gaps narrower than that. Any other point goes along its normal.

        Parameters
        ----------
        points : float array (p, 3)
            Points on this mesh or elsewhere [length].
        normals : float array (p, 3)
            Unit normals, on the side to start on [1].

        Returns
        -------
        float64 array (p, 3)
            Starting points [length].

        Raises
        ------
        InputError
            If a number is not finite, a normal is zero, or shapes disagree.

        References
        ----------
        .. [1] J. Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, 2021. doi:10.1007/978-1-4842-7185-8_4
        """
        p, n = _rays(points, normals)
        blocks = [self._lifted(p[block], n[block]) for block in _blocks(len(p))]
        return np.concatenate(blocks) if blocks else np.zeros((0, 3))

    def _lifted(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        probe = _PROBE * self.mesh.radius
        start = points + probe * normals
        faces = self._run(start, -normals, np.full(len(points), 2 * probe))
        off = np.array(normals)
        own = np.flatnonzero(faces >= 0)
        _, distance, weights = meet(self.mesh.corners[faces[own]], start[own], -normals[own])
        # Only what is met where the point is can be its own triangle; near a crease it may be the other wall.
        close = np.abs(distance - probe) < 0.1 * self.step
        own, weights = own[close], weights[close]
        flat = self.mesh.face_normals[faces[own]]
        side = np.copysign(1.0, (flat * normals[own]).sum(axis=1))[:, None]
        off[own] = side * flat
        result = points + self.step * off
        if self.mesh.smooth:
            corners = self.mesh.faces[faces[own]]
            around = side[:, None] * self.mesh.smooth_normals[corners]
            under = ((self.mesh.vertices[corners] - points[own][:, None]) * around).sum(axis=2)
            raised = weights[:, :, None] * np.maximum(under, 0)[:, :, None] * around
            result[own] += np.nan_to_num(raised).sum(axis=1)
        return np.asarray(result)

    def _run(
        self, origins: FloatArray, directions: FloatArray, reach: FloatArray | None, query: str = "INTERSECT"
    ) -> IntArray:
        """Ask Embree for the first triangle before `reach`, or with "OCCLUDED" for anything at all; −1 for none."""
        radius = self.mesh.radius
        o, length = (origins - self.mesh.middle) / radius, np.linalg.norm(directions, axis=1)
        d = directions / length[:, None]
        # Rays from far away start where they may enter the ball around the mesh.
        ahead = np.maximum(-(o * d).sum(axis=1) - 1.01, 0.0)
        o = (o + ahead[:, None] * d).astype(np.float32)
        if reach is None:
            return np.asarray(self._scene.run(o, d.astype(np.float32)), np.int64)
        rest = reach * length / radius - ahead
        ends = np.clip(rest, 0.0, 1e30).astype(np.float32)
        found = self._scene.run(o, d.astype(np.float32), dists=ends, query=query)
        return np.where(rest > 0, np.asarray(found, np.int64), -1)

    def _first_hit(self, origins: FloatArray, directions: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
        faces, distances, weights = _nothing(len(origins))
        open_, begin = np.arange(len(origins)), np.zeros(len(origins))
        length = np.linalg.norm(directions, axis=1)
        for _ in range(_ATTEMPTS):
            found = self._run(origins[open_] + begin[open_, None] * directions[open_], directions[open_], None)
            open_, found = open_[found >= 0], found[found >= 0]
            hit, distance, inside = self._settle(found, origins[open_], directions[open_])
            done = hit >= 0
            faces[open_[done]], distances[open_[done]], weights[open_[done]] = hit[done], distance[done], inside[done]
            # The others pass an outline by a hair that single precision does not see: look behind it.
            open_, passed = open_[~done], distance[~done]
            if len(open_) == 0:
                break
            begin[open_] = np.maximum(begin[open_], np.nan_to_num(passed)) + self.step / length[open_]
        return faces, distances, weights

    def _settle(
        self, found: IntArray, origins: FloatArray, directions: FloatArray
    ) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return which of the found triangles and those around them rays really meet first; −1 for none of them."""
        inside, distances, weights = meet(self.mesh.corners[found], origins, directions)
        faces = np.where(inside, found, -1)
        missed = np.flatnonzero(~inside)
        row, candidate = self._neighbours.pairs(found[missed])
        met, far, where = meet(self.mesh.corners[candidate], origins[missed][row], directions[missed][row])
        order = np.flatnonzero(met)
        order = order[np.argsort(far[order], kind="stable")][::-1]  # the nearest is written last and stays
        rows = missed[row[order]]
        faces[rows], distances[rows], weights[rows] = candidate[order], far[order], where[order]
        return faces, distances, weights


def _nothing(count: int) -> tuple[IntArray, FloatArray, FloatArray]:
    return np.full(count, -1), np.full(count, np.inf), np.full((count, 3), np.nan)


def _blocks(count: int) -> Iterator[slice]:
    return (slice(start, start + _BLOCK) for start in range(0, count, _BLOCK))


def _rays(origins: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
    o, d = np.asarray(origins, np.float64), np.asarray(directions, np.float64)
    if o.ndim != 2 or o.shape[1] != 3 or o.shape != d.shape:
        raise InputError(
            given=f"Rays start at an array {o.shape} and run along an array {d.shape}.",
            needed="Both have the shape (p, 3).",
            remedy="Give one start and one direction for each ray.",
        )
    if not np.isfinite(o).all() or not np.isfinite(d).all() or not (d != 0).any(axis=1).all():
        raise InputError(
            given="A ray's start or direction is not finite, or a direction is zero.",
            needed="Finite starts and directions longer than zero.",
            remedy="Leave out pixels without a surface, and lamps that touch it.",
        )
    return o, d
