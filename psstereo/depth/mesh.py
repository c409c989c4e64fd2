"""A triangle mesh from a depth map."""

import numpy as np
import numpy.typing as npt

from psstereo.camera import Camera
from psstereo.errors import InputError
from psstereo.surface_mesh import SurfaceMesh
from psstereo.types import Array, BoolArray, FloatArray, IntArray

__all__ = ["triangulate"]

_CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))
"""Corners of a block of 2 × 2 pixels: (row, column)."""
_TRIANGLES = ((0, 2, 1), (1, 2, 3), (0, 2, 3), (0, 3, 1))
"""Corners of the triangles, counter-clockwise for the camera: two along the rising diagonal, two along the falling."""
_WHITE = 99.0
"""Percentile of the albedo that is drawn white, so that a few bright outliers do not blacken the rest [%]."""


def triangulate(
    depth: FloatArray,
    camera: Camera,
    *,
    normals: FloatArray | None = None,
    albedo: FloatArray | None = None,
    components: IntArray | None = None,
    texture: bool = False,
) -> SurfaceMesh:
    """Join the pixels of a depth map to triangles.

    One vertex a pixel that has depth, in row-major order; two triangles where all pixels of a block of 2 × 2 have
    depth, parted along the diagonal with the smaller step in depth; one where three of them have. Depth jumps inside
    a component are bridged by steep triangles: where that matters, give `components` that are cut there.

    Parameters
    ----------
    depth : float array (h, w)
        Depth of the camera's kind; NaN where unknown [any length].
    camera : Camera
        The camera.
    normals : float array (h, w, 3), optional
        Normals of the pixels, x right, y up, z toward the camera; where unknown, the direction to the camera stands in
        [1].
    albedo : float array (h, w) or (h, w, 1) or (h, w, 3), optional
        For the colours: its 99th percentile becomes white, encoded by the sRGB curve; unknown is black [any].
    components : int array (h, w), optional
        Connected components; no triangle joins two of them, and 0 counts as unknown depth.
    texture : bool
        Whether the colours come as a picture too, cut to the surface, each vertex in the middle of its pixel. Beyond
        the surface it repeats the nearest colour, so that nothing dark shows at the borders. It needs `albedo`.

    Returns
    -------
    SurfaceMesh
        Float64 vertices in the unit of the depth.

    Raises
    ------
    InputError
        If shapes do not fit, no pixel has depth, or a texture is wanted without albedo.
    """
    depth = np.asarray(depth)
    shape = depth.shape
    _check(depth, normals, albedo, components)
    if texture and albedo is None:
        raise InputError(
            given="A texture is wanted, and there is no albedo.",
            needed="The texture is a picture of the albedo.",
            remedy="Give the albedo, or leave the texture out.",
        )
    labels = np.ones(shape, np.int32) if components is None else np.asarray(components)
    labels = np.where(np.isfinite(depth), labels, 0)
    known = labels > 0
    if not known.any():
        raise InputError(
            given="No pixel of the depth map has a depth.",
            needed="A mesh needs at least one point.",
            remedy="Integrate normals first, or check the mask.",
        )
    rays = camera.rays((shape[0], shape[1]))
    colors = None if albedo is None else _display_colors(np.asarray(albedo)[known])
    picture, uv = _texture(colors, known) if texture and colors is not None else (None, None)
    return SurfaceMesh(
        vertices=camera.points(np.where(known, depth, 1.0))[known],
        faces=_faces(depth, labels, known),
        normals=None if normals is None else _vertex_normals(normals[known], rays[known]),
        colors=colors,
        texture=picture,
        uv=uv,
    )


def _check(depth: Array, normals: Array | None, albedo: Array | None, components: Array | None) -> None:
    given = {"normals": normals, "albedo": albedo, "components": components}
    allowed = {"normals": ((3,),), "albedo": ((), (1,), (3,)), "components": ((),)}
    shapes = {name: array.shape for name, array in given.items() if array is not None}
    fits = depth.ndim == 2 and all(
        any(shape == depth.shape + tail for tail in allowed[name]) for name, shape in shapes.items()
    )
    if not fits:
        listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise InputError(
            given=f"The depth has shape {depth.shape}{', ' if listed else ''}{listed}.",
            needed="Depth must be (h, w), normals (h, w, 3), albedo (h, w), (h, w, 1) or (h, w, 3), components (h, w).",
            remedy="Give arrays of one and the same image.",
        )


def _faces(depth: FloatArray, labels: IntArray, known: BoolArray) -> npt.NDArray[np.int32]:
    """Return the triangles, block by block in row-major order."""
    height, width = depth.shape
    if min(height, width) < 2:
        return np.zeros((0, 3), np.int32)
    index = np.cumsum(known, dtype=np.int32).reshape(known.shape) - np.int32(1)

    def corners(array: Array) -> list[Array]:
        return [array[row : height - 1 + row, column : width - 1 + column] for row, column in _CORNERS]

    label, vertex, near = corners(labels), corners(index), corners(np.where(known, depth, 0.0))
    whole = (label[0] > 0) & (label[0] == label[1]) & (label[0] == label[2]) & (label[0] == label[3])
    falling = np.abs(near[3] - near[0]) < np.abs(near[2] - near[1])  # the diagonal from top left to bottom right
    wanted = np.zeros((*whole.shape, len(_TRIANGLES)), np.bool_)
    for number, (a, b, c) in enumerate(_TRIANGLES):
        alone = (label[a] > 0) & (label[a] == label[b]) & (label[a] == label[c]) & ~whole
        wanted[..., number] = alone | (whole & (falling == (number >= 2)))
    faces = np.zeros((int(np.count_nonzero(wanted)), 3), np.int32)
    for corner in range(3):
        choices = np.stack([vertex[triangle[corner]] for triangle in _TRIANGLES], axis=-1)
        faces[:, corner] = choices[wanted]
    return faces


def _vertex_normals(normals: FloatArray, rays: FloatArray) -> FloatArray:
    """Return unit normals (v, 3); the direction to the camera where there is none (files allow no gaps)."""
    normals = np.asarray(normals, np.float64)
    length = np.linalg.norm(np.where(np.isfinite(normals), normals, 0.0), axis=-1, keepdims=True)
    usable = np.isfinite(normals).all(axis=-1, keepdims=True) & (length > 0)
    to_camera = -rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    return np.asarray(np.where(usable, normals / np.where(usable, length, 1.0), to_camera))


def _display_colors(albedo: FloatArray) -> npt.NDArray[np.uint8]:
    """Return sRGB bytes (v, 3) of albedos (v,) or (v, c)."""
    values = np.asarray(albedo, np.float64).reshape(len(albedo), -1)
    finite = np.isfinite(values)
    white = float(np.percentile(values[finite], _WHITE)) if finite.any() else 0.0
    linear = np.clip(np.where(finite, values, 0.0) / (white if white > 0 else 1.0), 0.0, 1.0)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055)
    colors = np.rint(255.0 * curve).astype(np.uint8)
    return np.ascontiguousarray(np.broadcast_to(colors, (len(colors), 3)))


def _texture(colors: npt.NDArray[np.uint8], known: BoolArray) -> tuple[npt.NDArray[np.uint8], FloatArray]:
    """Return the colours as a picture of the surface's bounding rectangle, and where the vertices lie on it."""
    from scipy.ndimage import distance_transform_edt

    rows, columns = np.nonzero(known)
    top, left = int(rows.min()), int(columns.min())
    height, width = int(rows.max()) + 1 - top, int(columns.max()) + 1 - left
    picture = np.zeros((height, width, 3), np.uint8)
    picture[rows - top, columns - left] = colors
    missing = ~known[top : top + height, left : left + width]
    if missing.any():
        nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
        picture = picture[nearest[0], nearest[1]]
    uv = np.stack([(columns - left + 0.5) / width, 1.0 - (rows - top + 0.5) / height], axis=-1)
    return picture, uv
