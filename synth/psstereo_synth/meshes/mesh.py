"""A triangle mesh as something to look at and to cast shadows with."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from psstereo.errors import InputError
from psstereo.surface_mesh import SurfaceMesh
from psstereo.types import FloatArray, IntArray

__all__ = ["TriangleMesh"]


@dataclass(frozen=True, kw_only=True, eq=False)
class TriangleMesh:
    """Triangles in a scene; seen from both sides, smooth or faceted.

    A smooth mesh stands for a curved surface: normals are interpolated between those of the vertices, points stay on
    the triangles. Do not take a smooth mesh for a body with sharp edges: its shading would be rounded off.

    Attributes
    ----------
    vertices : float64 array (v, 3)
        Points [length].
    faces : int64 array (f, 3)
        Vertices of each triangle, counter-clockwise seen from outside.
    vertex_normals : float64 array (v, 3) or None
        Unit normals of the vertices, normalised on entry; None leaves them to :attr:`smooth_normals` [1].
    smooth : bool
        Whether normals are interpolated; if not, each triangle has one.

    Raises
    ------
    InputError
        If there are no triangles or only some without area, if a face names a vertex that is not there, if a number is
        not finite, or if shapes disagree.
    """

    vertices: FloatArray
    faces: IntArray
    vertex_normals: FloatArray | None = None
    smooth: bool = False

    def __post_init__(self) -> None:
        vertices, faces = np.array(self.vertices, np.float64), np.array(self.faces)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.isfinite(vertices).all():
            raise InputError(
                given=f"A mesh has vertices of the shape {vertices.shape}, {_not_finite(vertices)} numbers not finite.",
                needed="Vertices are an array (v, 3) of finite numbers.",
                remedy="Repair the mesh, or leave out the vertices that are not known.",
            )
        if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0 or faces.dtype.kind not in "iu":
            raise InputError(
                given=f"A mesh has faces of the shape {faces.shape} and the type {faces.dtype}.",
                needed="At least one triangle, as whole numbers (f, 3).",
                remedy="Give a mesh; a point cloud has no surface between its points.",
            )
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise InputError(
                given=f"Faces name the vertices {faces.min()} to {faces.max()}, and there are {len(vertices)}.",
                needed="Each face names three of the vertices, counted from 0.",
                remedy="Check the file; some formats count from 1.",
            )
        self._set(vertices=vertices, faces=faces.astype(np.int64), smooth=bool(self.smooth))
        if not (self.areas > 0).any():
            raise InputError(
                given=f"All {len(faces)} triangles are without area.",
                needed="A mesh has a surface.",
                remedy="Check the scale of the vertices, and that faces name three different ones.",
            )
        if self.vertex_normals is not None:
            self._set(vertex_normals=_unit_normals(self.vertex_normals, len(vertices)))

    def _set(self, **values: FloatArray | IntArray | bool) -> None:
        for name, value in values.items():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
            object.__setattr__(self, name, value)

    @classmethod
    def from_surface(cls, surface: SurfaceMesh, *, smooth: bool = True) -> "TriangleMesh":
        """Take over the triangles of a reconstructed or generated surface.

        Parameters
        ----------
        surface : SurfaceMesh
            Vertices, faces and, if it has them, normals; colours are left behind.
        smooth : bool
            Whether normals are interpolated.

        Returns
        -------
        TriangleMesh
            The same triangles.

        Raises
        ------
        InputError
            If the surface has no triangles, or only some without area.
        """
        return cls(vertices=surface.vertices, faces=surface.faces, vertex_normals=surface.normals, smooth=smooth)

    def centred(self, scale: float = 1.0) -> "TriangleMesh":
        """Return the mesh moved and scaled so that the longest side of its box runs from −scale to scale.

        Parameters
        ----------
        scale : float
            Half the longest side of the box around the result [length].

        Returns
        -------
        TriangleMesh
            The mesh around the origin, of the same proportions.

        Raises
        ------
        InputError
            If the scale is not a positive number.
        """
        if not (np.isfinite(scale) and scale > 0):
            raise InputError(
                given=f"A mesh is to be scaled to {scale}.",
                needed="A positive length.",
                remedy="Give half the longest side that the mesh is to have.",
            )
        moved = (self.vertices - self.middle) * (2 * scale / np.ptp(self.corners, axis=(0, 1)).max())
        return TriangleMesh(vertices=moved, faces=self.faces, vertex_normals=self.vertex_normals, smooth=self.smooth)

    @cached_property
    def corners(self) -> FloatArray:
        """Corners of each triangle, float64 (f, 3, 3) [length]."""
        return np.asarray(self.vertices[self.faces])

    @cached_property
    def _area_vectors(self) -> FloatArray:
        first, second, third = self.corners[:, 0], self.corners[:, 1], self.corners[:, 2]
        return np.cross(second - first, third - first)

    @cached_property
    def areas(self) -> FloatArray:
        """Area of each triangle, float64 (f,) [length²]."""
        return np.asarray(np.linalg.norm(self._area_vectors, axis=1) / 2)

    @cached_property
    def face_normals(self) -> FloatArray:
        """Unit normal of each triangle, float64 (f, 3); NaN for one without area [1]."""
        doubled = 2 * self.areas[:, None]
        unknown = np.full((len(self.faces), 3), np.nan)
        return np.asarray(np.divide(self._area_vectors, doubled, out=unknown, where=doubled > 0))

    @cached_property
    def centres(self) -> FloatArray:
        """Centre of gravity of each triangle, float64 (f, 3) [length]."""
        return np.asarray(self.corners.mean(axis=1))

    @cached_property
    def middle(self) -> FloatArray:
        """Centre of the box around the triangles, float64 (3,) [length]."""
        return np.asarray((self.corners.min(axis=(0, 1)) + self.corners.max(axis=(0, 1))) / 2)

    @cached_property
    def radius(self) -> float:
        """Radius of the ball around :attr:`middle` that holds all triangles [length]."""
        return float(np.linalg.norm(self.corners - self.middle, axis=2).max())

    @cached_property
    def smooth_normals(self) -> FloatArray:
        """Unit normals of the vertices, float64 (v, 3): those given, or means of the faces weighted by their angles.

        The weights of Thürmer and Wüthrich ("Computing vertex normals from polygonal facets", Journal of Graphics
        Tools 3, 1998) do not depend on how a face is cut into triangles. A vertex without a normal of its own (of no
        face, or in the fold of two opposite ones) has NaN [1].
        """
        if self.vertex_normals is not None:
            return self.vertex_normals
        usable = np.flatnonzero(self.areas > 0)
        faces, corners = self.faces[usable], self.corners[usable]
        total = np.zeros_like(self.vertices)
        for k in range(3):
            one, other = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
            angle = np.arctan2(2 * self.areas[usable], (one * other).sum(axis=1))
            np.add.at(total, faces[:, k], angle[:, None] * self.face_normals[usable])
        length = np.linalg.norm(total, axis=1, keepdims=True)
        return np.asarray(np.divide(total, length, out=np.full_like(total, np.nan), where=length > 1e-9))

    def normals_at(self, faces: IntArray, weights: FloatArray) -> FloatArray:
        """Return unit normals at points of triangles, on the side that faces run counter-clockwise on.

        Parameters
        ----------
        faces : int array (p,)
            Triangles.
        weights : float array (p, 3)
            Barycentric coordinates in them [1].

        Returns
        -------
        float64 array (p, 3)
            Interpolated normals of a smooth mesh, the triangles' own of a faceted one and wherever those of the
            vertices cancel or are unknown [1].
        """
        flat = np.asarray(self.face_normals[faces])
        if not self.smooth:
            return flat
        mixed = np.einsum("pk,pkx->px", weights, self.smooth_normals[self.faces[faces]])
        length = np.linalg.norm(mixed, axis=1, keepdims=True)
        return np.asarray(np.divide(mixed, length, out=flat.copy(), where=length > 1e-9))


def _not_finite(values: FloatArray) -> int:
    return int(values.size - np.count_nonzero(np.isfinite(values)))


def _unit_normals(normals: FloatArray, count: int) -> FloatArray:
    n = np.array(normals, np.float64)
    fits = n.shape == (count, 3)
    length = np.linalg.norm(n, axis=1, keepdims=True) if fits else np.zeros(1)
    if not fits or not np.isfinite(length).all() or not (length > 0).all():
        raise InputError(
            given=f"Vertex normals have the shape {n.shape}; there are {count} vertices.",
            needed="One finite vector for each vertex, longer than zero.",
            remedy="Leave the normals out to have them computed from the faces.",
        )
    return np.asarray(n / length)
