"""Cast shadows on a height field under parallel light, by a sweep that keeps the horizon.

Walking toward the light along its ground direction, a point at distance t with height z(t) is in shadow if a later
point s has z(s) − s·tan e > z(t) − t·tan e, where e is the light's elevation. So the running maximum of
z − t·tan e, taken from the far end of each line, decides for the whole line in one pass [1]_. The lines are those
of the light's ground direction, one pixel apart: heights are interpolated onto them once (a shear), and the running
maximum is interpolated back once, so that shadow edges are not smeared by repeated interpolation.

References
----------
.. [1] J. Dozier, J. Bruno, P. Downey, "A faster solution to the horizon problem", Computers & Geosciences 7, 145-151,
   1981. doi:10.1016/0098-3004(81)90026-1
"""

from dataclasses import dataclass

import numpy as np

from psstereo.errors import InputError
from psstereo.types import FloatArray

__all__ = ["shadow_height"]

_NOTHING = -1e300
"""Height of the horizon where nothing is in the way; finite, so that interpolating it stays defined."""


@dataclass(frozen=True)
class _Walk:
    """How a grid is walked toward the light.

    Attributes
    ----------
    transpose, flip : bool
        What turns the grid so that growing rows lead toward the light.
    shift : float
        Columns that a line moves to the side each row, −1 … 1 [px].
    rise : float
        Height that the light's ray gains each row [length].
    """

    transpose: bool
    flip: bool
    shift: float
    rise: float


def shadow_height(height: FloatArray, spacing: tuple[float, float], direction: FloatArray) -> FloatArray:
    """Return the height below which parallel light is blocked, above each node of a height field.

    A point over the node (r, c) is in cast shadow if it lies below the returned height; nodes themselves if
    `height` does. Occluders are the nodes and what is linear between them on lines along the light, so a ridge narrower
    than a pixel, or lying between two nodes, may be missed by as much as the surface bends within a pixel. Not for
    lamps: their rays are not parallel.

    Parameters
    ----------
    height : float array (h, w)
        Heights, NaN where there is no surface [length].
    spacing : (float, float)
        Distance of neighbouring columns and of neighbouring rows [length].
    direction : float array (3,)
        Toward the light, x right along columns, y up against rows, z up [1].

    Returns
    -------
    float64 array (h, w)
        Heights, −1e300 where nothing can be in the way [length].

    Raises
    ------
    InputError
        If the field is not a (h, w) array, or spacing or direction mean nothing.

    Examples
    --------
    >>> wall = np.array([[0.0, 0.0, 0.0, 2.0, 0.0]])
    >>> shadow_height(wall, (1.0, 1.0), np.array([1.0, 0.0, 1.0]))[0, :3]
    array([-1.,  0.,  1.])
    """
    z = np.asarray(height, np.float64)
    d = np.asarray(direction, np.float64)
    if z.ndim != 2 or 0 in z.shape or not (spacing[0] > 0 and spacing[1] > 0) or d.shape != (3,):
        raise InputError(
            given=f"A height field of shape {z.shape} has the spacing {spacing} and a light toward {d.tolist()}.",
            needed="Heights (h, w), two positive spacings and a direction of three numbers.",
            remedy="Correct the arguments.",
        )
    walk = _walk(d, spacing)
    if walk is None:
        return np.full(z.shape, _NOTHING)
    turned = z.T if walk.transpose else z
    turned = turned[::-1] if walk.flip else turned
    found = _sweep(np.where(np.isnan(turned), _NOTHING, turned), walk)
    found = found[::-1] if walk.flip else found
    return np.ascontiguousarray(found.T if walk.transpose else found)


def _walk(direction: FloatArray, spacing: tuple[float, float]) -> _Walk | None:
    """Return how to walk toward the light, None if it stands in the zenith (or the nadir)."""
    columns, rows = direction[0] / spacing[0], -direction[1] / spacing[1]
    transpose = bool(abs(columns) > abs(rows))
    major, minor = (columns, rows) if transpose else (rows, columns)
    # Closer to the zenith than this, a ray leaves a pixel only far above anything.
    if not abs(major) > 1e-12 * abs(direction[2]):
        return None
    return _Walk(transpose, bool(major < 0), float(minor / abs(major)), float(direction[2] / abs(major)))


def _sweep(z: FloatArray, walk: _Walk) -> FloatArray:
    """Return the shadow heights of a field whose growing rows lead toward the light."""
    rows, columns = z.shape
    whole = np.floor(walk.shift * np.arange(rows)).astype(np.int64)
    part = walk.shift * np.arange(rows) - whole
    low, high = int(whole.min()), int(whole.max()) + 1
    # Line k passes row i at column k + shift · i, so lines −high … columns − 1 − low touch the grid.
    first, count = -high, columns + high - low
    lines = np.full((rows, count), _NOTHING)
    for i in range(rows):
        start = -int(whole[i]) - first  # the line that passes this row `part` right of column 0
        mixed = lines[i, start : start + columns - 1]
        np.multiply(z[i, :-1], 1.0 - part[i], out=mixed)
        mixed += part[i] * z[i, 1:]
        if part[i] == 0.0:
            lines[i, start + columns - 1] = z[i, -1]
    lines -= walk.rise * np.arange(rows)[:, None]
    horizon = np.full_like(lines, _NOTHING)
    np.maximum.accumulate(lines[:0:-1], axis=0, out=horizon[-2::-1])
    horizon += walk.rise * np.arange(rows)[:, None]
    result = np.zeros_like(z)
    for i in range(rows):
        start = -int(whole[i]) - first
        np.multiply(horizon[i, start : start + columns], 1.0 - part[i], out=result[i])
        result[i] += part[i] * horizon[i, start - 1 : start - 1 + columns]
    return result
