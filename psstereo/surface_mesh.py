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
    texture : uint8 array (h, w, 3) or None
        A picture to lay over the surface, for display (sRGB curve); files that hold one need no colours.
    uv : float array (v, 2) or None
        Where a vertex lies on the texture: from its left edge to the right and from its lower edge up, in 0 to 1, so
        that the centre of the pixel in row i and column j has ((j + ½) / w, 1 − (i + ½) / h). Beside `texture` [1].

    Raises
    ------
    InputError
        If the arrays do not fit together.
    """

    vertices: FloatArray
    faces: npt.NDArray[np.int32]
    normals: FloatArray | None = None
    colors: npt.NDArray[np.uint8] | None = None
    texture: npt.NDArray[np.uint8] | None = None
    uv: FloatArray | None = None

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
        self._check_texture(count)

    def _check_texture(self, count: int) -> None:
        texture, uv = self.texture, self.uv
        if texture is None and uv is None:
            return
        fits = texture is not None and texture.ndim == 3 and texture.shape[2] == 3 and texture.dtype == np.uint8
        fits = fits and texture is not None and texture.size > 0
        if not (fits and uv is not None and uv.shape == (count, 2) and bool(np.all((uv >= 0) & (uv <= 1)))):
            raise InputError(
                given=(
                    f"A mesh of {count} vertices has a texture of shape {None if texture is None else texture.shape} "
                    f"and places on it of shape {None if uv is None else uv.shape}."
                ),
                needed="Both or neither: bytes (h, w, 3), and two numbers from 0 to 1 for each vertex.",
                remedy="Build the mesh with psstereo.depth.triangulate.",
            )
