"""From depth to normals."""

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.depth.differences import Differences
from psstereo.depth.footprint import labels_of
from psstereo.errors import InputError, UnsupportedError
from psstereo.types import Array, FloatArray, IntArray

__all__ = ["normals_from_depth"]


def normals_from_depth(depth: FloatArray, camera: Camera, *, components: IntArray | None = None) -> FloatArray:
    r"""Return the normals of a depth map, from differences between neighbouring pixels.

    Under parallel projection the slopes are differences of the height. Under central projection the point of a pixel
    is X = d / w with the ray d and the *inverse* distance w; a plane m·X = 1 has w = m·d, and d is linear in column
    and row, so that differences of w, not of the distance, give m without error. Exact on planes, up to rounding;
    elsewhere the error falls with the square of the pixel's size, up to the borders, where the differences are
    one-sided. No difference reaches across pixels without depth.

    Do not use it on depth with noise as it comes from stereo or structured light: an error of the height by ε becomes
    one of the normal by about ε / (1.4 · pixel size) [rad]. Smooth the depth first. It does not see jumps of the depth
    either, and draws a steep wall there: where that matters, give `components` that are cut there.

    Parameters
    ----------
    depth : float array (h, w)
        Depth of the camera's kind, height or distance along the optical axis; not finite where unknown. Heights are
        in the camera's unit, distances in any [length].
    camera : Camera
        The camera: :class:`~psstereo.camera.Orthographic` or :class:`~psstereo.camera.Pinhole`.
    components : int array (h, w), optional
        Connected components; pixels of different ones are no neighbours, and 0 counts as unknown.

    Returns
    -------
    float64 array (h, w, 3)
        Unit normals toward the camera, x right, y up, z toward the camera; NaN where there is no depth, or no
        neighbour left and right, or none above and below [1].

    Raises
    ------
    InputError
        If shapes or types do not fit, or distances are not positive.
    UnsupportedError
        If the camera is another one.

    Examples
    --------
    >>> normals_from_depth(np.array([[0.0, 0.75], [0.0, 0.75]]), Orthographic())[0, 0].round(6).tolist()
    [-0.6, 0.0, 0.8]
    """
    if not isinstance(camera, Orthographic | Pinhole):
        raise UnsupportedError(
            given=f"The camera is {camera.name}.",
            needed="Normals of a depth map are known for parallel and for central projection.",
            remedy="Bring the depth map to one of these cameras first.",
        )
    depth = _checked(depth)
    labels = labels_of(np.isfinite(depth), components)
    known = labels > 0
    if isinstance(camera, Pinhole):
        _refuse_behind(depth, known)
        values = np.divide(1.0, depth, where=known, out=np.zeros(depth.shape))
    else:
        values = np.where(known, depth, 0.0)
    right = Differences(labels, axis=1, three_points=True)(values)
    down = Differences(labels, axis=0, three_points=True)(values)
    if isinstance(camera, Pinhole):
        return _unit(*_plane(values, right, down, camera))
    return _unit(-right / camera.pixel_size, down / camera.pixel_size, np.ones(depth.shape))


def _plane(values: FloatArray, right: FloatArray, down: FloatArray, camera: Pinhole) -> tuple[FloatArray, ...]:
    """Return −m of the tangent planes m·X = 1, by components.

    With d = A (u, v, 1)ᵀ and w = m·d, we have mᵀA = (w_u, w_v, w − u w_u − v w_v).
    """
    ray = camera.rays((2, 2))
    inverse = np.linalg.inv(np.stack([ray[0, 1] - ray[0, 0], ray[1, 0] - ray[0, 0], ray[0, 0]], axis=1))
    rows, columns = (np.arange(size, dtype=np.float64) for size in values.shape)
    rest = values - columns * right - rows[:, None] * down
    return tuple(-(inverse[0, k] * right + inverse[1, k] * down + inverse[2, k] * rest) for k in range(3))


def _unit(x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
    """Return unit vectors; slopes beyond the square root of the largest number are no surface."""
    with np.errstate(over="ignore", invalid="ignore"):
        length = np.sqrt(x * x + y * y + z * z)
        out = np.stack([x / length, y / length, z / length], axis=-1)
    out[~np.isfinite(length)] = np.nan
    return out


def _checked(depth: Array) -> FloatArray:
    depth = np.asarray(depth)
    if depth.ndim != 2 or depth.dtype.kind != "f" or depth.size == 0:
        raise InputError(
            given=f"The depth is an array of shape {depth.shape} and type {depth.dtype}.",
            needed="It must be floating-point numbers of shape (rows, columns).",
            remedy="Give the depth map itself; the integers of a depth picture are no lengths.",
        )
    return depth.astype(np.float64)


def _refuse_behind(depth: FloatArray, known: Array) -> None:
    behind = int(np.count_nonzero(depth[known] <= 0))
    if behind:
        raise InputError(
            given=f"{behind} pixels have a distance of 0 or less.",
            needed="A pinhole camera's depth is the positive distance along the optical axis.",
            remedy="Set unknown distances to NaN; heights belong to an orthographic camera.",
        )
