"""A triangle mesh as plain data."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError
from psstereo.types import FloatArray

__all__ = ["SurfaceMesh"]


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceMesh:
    """Triangles in the camera's axes: x right, y up, z toward the camera.

    Attributes
    ----------
    vertices : float array (v, 3)
        Points [the depth's unit].
    faces : int32 array (f, 3)
        Vertices of each triangle, counter-clockwise seen from the camera.
    normals : float array (v, 3) or None
        Unit normals of the vertices [1].
    colors : uint8 array (v, 3) or None
        Red, green, blue of the vertices, for display (sRGB curve).

    Raises
    ------
    InputError
        If the arrays do not fit together.
    """

    vertices: FloatArray
    faces: npt.NDArray[np.int32]
    normals: FloatArray | None = None
    colors: npt.NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        count = len(self.vertices)
        fits = self.vertices.shape == (count, 3) and self.faces.ndim == 2 and self.faces.shape[1] == 3
        fits = fits and all(extra is None or extra.shape == (count, 3) for extra in (self.normals, self.colors))
        if not fits or (self.faces.size and not 0 <= self.faces.min() <= self.faces.max() < count):
            extras = [None if extra is None else extra.shape for extra in (self.normals, self.colors)]
            raise InputError(
                given=(
                    f"A mesh has vertices {self.vertices.shape}, faces {self.faces.shape}, normals {extras[0]} and "
                    f"colours {extras[1]}."
                ),
                needed="All must have 3 columns, normals and colours a row for each vertex, and faces name vertices.",
                remedy="Build the mesh with psstereo.depth.triangulate.",
            )
