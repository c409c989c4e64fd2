"""Triangles over a surface, for casting rays at it."""

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError, UnsupportedError
from psstereo.types import FloatArray
from psstereo_synth.shapes.checks import whole
from psstereo_synth.shapes.finite import FiniteRelief
from psstereo_synth.shapes.relief import Relief

__all__ = ["relief_mesh", "require_extent"]


def require_extent(relief: Relief) -> FiniteRelief:
    """Return the surface as one whose extent is known, or refuse it.

    Parameters
    ----------
    relief : Relief
        A surface.

    Returns
    -------
    FiniteRelief
        The same.

    Raises
    ------
    UnsupportedError
        If it does not say how far it reaches.
    """
    if not isinstance(relief, FiniteRelief):
        raise UnsupportedError(
            given=f"The surface {relief.name} does not say how far it reaches.",
            needed="Rays and meshes need the rectangle that it lies in.",
            remedy="Derive it from FiniteRelief and give its extent; straight from above it can be seen as it is.",
        )
    return relief


def relief_mesh(relief: Relief, n: int) -> tuple[FloatArray, npt.NDArray[np.int32]]:
    """Return a surface as triangles over a grid of about square cells.

    Heights are exact at the vertices; between them triangles lie off the surface by about curvature · cell² / 8. Cells
    that are not wholly on the surface are left out, so that round outlines become ragged by up to a cell; a vertical
    wall within the surface becomes a slope of one cell.

    Parameters
    ----------
    relief : Relief
        A surface that knows its extent.
    n : int
        Vertices along the longer side of its rectangle, at least 2.

    Returns
    -------
    vertices : float64 array (v, 3)
        Points of the surface [length].
    faces : int32 array (f, 3)
        Vertices of each triangle, counter-clockwise seen from above.

    Raises
    ------
    InputError
        If there are fewer than 2 vertices along a side, or no whole cell is on the surface.
    UnsupportedError
        If the surface does not know its extent.
    """
    whole("mesh", least=2, vertices_along_a_side=n)
    width, height = require_extent(relief).extent
    cell = 2 * max(width, height) / (n - 1)
    columns, rows = (max(round(2 * half / cell), 1) + 1 for half in (width, height))
    x, y = np.meshgrid(np.linspace(-width, width, columns), np.linspace(height, -height, rows))
    z = relief.evaluate(x, y).height
    number = np.arange(x.size).reshape(x.shape)
    top_left, top_right = number[:-1, :-1], number[:-1, 1:]
    low_left, low_right = number[1:, :-1], number[1:, 1:]
    halves = [np.stack(three, axis=-1) for three in ((top_left, low_left, low_right), (top_left, low_right, top_right))]
    there = np.isfinite(z)
    there = there[:-1, :-1] & there[:-1, 1:] & there[1:, :-1] & there[1:, 1:]
    faces = np.stack(halves, axis=2)[there].reshape(-1, 3)
    if not len(faces):
        raise InputError(
            given=f"No cell of a grid of {columns} × {rows} vertices is wholly on the {relief.name}.",
            needed="At least one, or there are no triangles.",
            remedy="Ask for more vertices.",
        )
    used, faces = np.unique(faces, return_inverse=True)
    vertices = np.stack([x.flat[used], y.flat[used], z.flat[used]], axis=1)
    return vertices, np.asarray(faces.reshape(-1, 3), np.int32)
