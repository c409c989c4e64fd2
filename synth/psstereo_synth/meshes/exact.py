"""Rays and triangles in double precision, and which triangles lie next to each other."""

import numpy as np

from psstereo.types import BoolArray, FloatArray, IntArray
from psstereo_synth.meshes.mesh import TriangleMesh

__all__ = ["Neighbours", "meet"]

_SLACK = 1e-12
"""How far outside a triangle a ray still meets it, in barycentric coordinates: seams stay closed under rounding [1]."""


def meet(corners: FloatArray, origins: FloatArray, directions: FloatArray) -> tuple[BoolArray, FloatArray, FloatArray]:
    """Intersect rays with the planes of triangles, one each, by the method of Möller and Trumbore.

    Parameters
    ----------
    corners : float64 array (p, 3, 3)
        Corners of a triangle for each ray [length].
    origins, directions : float64 array (p, 3)
        Rays [length], [length].

    Returns
    -------
    inside : bool array (p,)
        Whether the ray meets the triangle, edges included, at a distance of zero or more.
    distance : float64 array (p,)
        To the triangle's plane, in lengths of the direction; NaN if they are parallel [1].
    weights : float64 array (p, 3)
        Barycentric coordinates of that point, which add up to 1; NaN if they are parallel [1].

    References
    ----------
    .. [1] T. Möller, B. Trumbore, "Fast, Minimum Storage Ray-Triangle Intersection", Journal of Graphics Tools 2,
       1997. doi:10.1080/10867651.1997.10487468
    """
    first = corners[:, 0]
    one, other, back = corners[:, 1] - first, corners[:, 2] - first, origins - first
    across = np.cross(directions, other)
    turned = np.cross(back, one)
    volume = (one * across).sum(axis=1)
    # A ray within rounding of the plane meets it nowhere that could be told.
    flat = np.abs(volume) <= 1e-15 * np.linalg.norm(one, axis=1) * np.linalg.norm(across, axis=1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        inverse = np.where(flat, np.nan, 1 / volume)
        second = (back * across).sum(axis=1) * inverse
        third = (directions * turned).sum(axis=1) * inverse
        distance = (other * turned).sum(axis=1) * inverse
    weights = np.stack([1 - second - third, second, third], axis=1)
    inside = (weights >= -_SLACK).all(axis=1) & (distance >= 0)
    return np.asarray(inside), np.asarray(distance), weights


class Neighbours:
    """The triangles around each triangle: those that have a corner in common with it.

    Corners at the same place are the same here, so that a mesh which lists every triangle's corners apart has
    neighbours too.

    Parameters
    ----------
    mesh : TriangleMesh
        The triangles.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        _, place = np.unique(mesh.vertices, axis=0, return_inverse=True)
        self._corners = place.reshape(-1)[mesh.faces]
        order = np.argsort(self._corners, axis=None, kind="stable")
        self._around = order // 3
        self._start = np.searchsorted(self._corners.reshape(-1)[order], np.arange(place.max() + 2))

    def pairs(self, faces: IntArray) -> tuple[IntArray, IntArray]:
        """Return all pairs of a triangle and one around it.

        Parameters
        ----------
        faces : int array (p,)
            Triangles.

        Returns
        -------
        row : int64 array (q,)
            Which of `faces`, in ascending order.
        neighbour : int64 array (q,)
            A triangle around it; itself and double entries included.
        """
        corners = self._corners[faces].reshape(-1)
        counts = self._start[corners + 1] - self._start[corners]
        which = np.repeat(np.arange(corners.size), counts)
        within = np.arange(which.size) - np.repeat(np.cumsum(counts) - counts, counts)
        return which // 3, self._around[self._start[corners][which] + within]
