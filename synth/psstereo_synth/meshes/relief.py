"""A relief as triangles, to cast shadows with or to look at from anywhere."""

import numpy as np

from psstereo.errors import InputError
from psstereo_synth.meshes.mesh import TriangleMesh
from psstereo_synth.shapes.mesh import relief_mesh
from psstereo_synth.shapes.relief import Relief

__all__ = ["mesh_of_relief"]


def mesh_of_relief(relief: Relief, n: int, *, scale: float = 1.0, smooth: bool = True) -> TriangleMesh:
    """Return triangles over a grid on a relief.

    The vertices are on the surface, the triangles off it by about curvature · cell² / 8. Where the truth must be exact
    look at the relief itself.

    Parameters
    ----------
    relief : Relief
        A surface that knows its extent.
    n : int
        Vertices along the longer side of its rectangle, at least 2.
    scale : float
        Length of the surface's unit in the scene [length].
    smooth : bool
        Whether normals are interpolated between vertices; those of the vertices are the surface's own, unless a slope
        is infinite or unknown somewhere, then means of the triangles around them.

    Returns
    -------
    TriangleMesh
        Triangles that face +z, in the scene's frame.

    Raises
    ------
    InputError
        If the grid is too coarse, or the scale is not a positive number.
    UnsupportedError
        If the relief does not know its extent.
    """
    if not (np.isfinite(scale) and scale > 0):
        raise InputError(
            given=f"A relief is to be scaled by {scale}.",
            needed="A positive length.",
            remedy="Give the length of the surface's unit in the scene.",
        )
    vertices, faces = relief_mesh(relief, n)
    found = relief.evaluate(vertices[:, 0], vertices[:, 1])
    length = np.hypot(np.hypot(found.slope_x, found.slope_y), 1.0)
    with np.errstate(invalid="ignore"):  # a vertical slope gives NaN
        normals = np.stack([-found.slope_x / length, -found.slope_y / length, 1.0 / length], axis=1)
    known = smooth and bool(np.isfinite(normals).all())
    return TriangleMesh(
        vertices=scale * vertices, faces=faces, vertex_normals=normals if known else None, smooth=smooth
    )
