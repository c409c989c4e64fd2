"""Solid angle of polygons: flat ones in space, and regions of the sphere bounded by great circles."""

import numpy as np
import numpy.typing as npt

from psstereo.radiometry.checks import vectors
from psstereo.radiometry.constants import FULL_SPHERE
from psstereo.radiometry.triangle import triangle_solid_angle
from psstereo.types import FloatArray

__all__ = ["polygon_solid_angle", "spherical_polygon_solid_angle"]

_APEX_COUNT = 16
"""Directions tried as apex of the fan of a spherical polygon [1]."""
_APEX_NEAR = 0.1
"""The first vertex is apex while no vertex comes nearer to its antipode: 1 + cos of the angle between them [1]."""


def polygon_solid_angle(vertices: npt.ArrayLike, observer: npt.ArrayLike = (0.0, 0.0, 0.0)) -> FloatArray:
    """Signed solid angle of flat polygons, convex or not: the sum of a fan of signed triangles.

    Positive where the vertices run counter-clockwise about a normal that points away from the observer, as for
    `triangle_solid_angle`. Triangles of the fan outside a non-convex polygon cancel by their sign; a polygon that is a
    small part of its fan's triangles loses as many digits. Not for observers in the polygon's plane, nor for regions
    larger than a hemisphere, which no flat polygon has: `spherical_polygon_solid_angle`.

    Parameters
    ----------
    vertices : float array (..., n, 3)
        At least 3 vertices in one plane, in order, without repeating the first [m].
    observer : float array (..., 3)
        Where they are seen from; its leading axes broadcast with those of the vertices [m].

    Returns
    -------
    float64 array (...)
        Solid angle, −2π … 2π [sr].

    Raises
    ------
    InputError
        If there are fewer than 3 vertices or a last axis has not 3 components.

    Examples
    --------
    >>> face = [[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]]
    >>> print(f"{polygon_solid_angle(face) / (4 * np.pi / 6):.15f}")
    1.000000000000000
    """
    corners = vectors("polygon", vertices, trailing=(None, 3))
    viewpoint = vectors("observer", observer)
    first = np.broadcast_to(corners[..., :1, :], corners[..., 2:, :].shape)
    fan = np.stack([first, corners[..., 1:-1, :], corners[..., 2:, :]], axis=-2)
    return np.asarray(triangle_solid_angle(fan, viewpoint[..., None, :]).sum(axis=-1))


def spherical_polygon_solid_angle(vertices: npt.ArrayLike) -> FloatArray:
    """Solid angle of the region to the left of a closed path of great-circle arcs, up to the whole sphere.

    A closed path bounds two regions, Ω and 4π − Ω; the order of the vertices says which is meant: it lies to the left
    when walking on the outside of the sphere. Convex or not, smaller or larger than a hemisphere. Small regions keep
    their relative accuracy, their complements do not. Not for paths that cross themselves (each loop counts with its
    sign) or retrace themselves (0 and 4π are then the same).

    Parameters
    ----------
    vertices : float array (..., n, 3)
        At least 3 directions, of any length, in order, without repeating the first; neighbours must not be opposite
        to each other [any unit].

    Returns
    -------
    float64 array (...)
        Solid angle, 0 … 4π; NaN where an arc joins opposite directions [sr].

    Raises
    ------
    InputError
        If there are fewer than 3 vertices or the last axis has not 3 components.

    Examples
    --------
    >>> octant = np.eye(3)
    >>> print(f"{spherical_polygon_solid_angle(octant[::-1]) / np.pi:.12f}")  # all but the octant
    3.500000000000
    """
    corners = vectors("polygon", vertices, trailing=(None, 3))
    following = np.roll(corners, -1, axis=-2)
    apex = np.broadcast_to(_fan_apex(corners)[..., None, :], corners.shape)
    # Triangles add up modulo 4π: one that passes the apex's antipode jumps by exactly that.
    fan = triangle_solid_angle(np.stack([apex, corners, following], axis=-2)).sum(axis=-1)
    return np.asarray(np.where(fan >= 0.0, np.fmod(fan, FULL_SPHERE), np.mod(fan, FULL_SPHERE)))


def _fan_apex(corners: FloatArray) -> FloatArray:
    """Return a direction whose antipode is far from all vertices, the first vertex if possible, (..., 3)."""
    with np.errstate(all="ignore"):
        units = corners / np.linalg.norm(corners, axis=-1, keepdims=True)
    first = np.min(1.0 + np.einsum("...i,...ni->...n", units[..., 0, :], units), axis=-1)
    candidates = _scattered_directions(_APEX_COUNT)
    clearance = np.min(1.0 + np.einsum("ki,...ni->...kn", candidates, units), axis=-1)
    other = candidates[np.argmax(clearance, axis=-1)]
    keep_first = ~((first < _APEX_NEAR) & (np.max(clearance, axis=-1) > first))
    return np.where(keep_first[..., None], corners[..., 0, :], other)


def _scattered_directions(count: int) -> FloatArray:
    """Return unit vectors spread evenly along a golden spiral, on no symmetry that shapes tend to have, (count, 3)."""
    steps = np.arange(count) + 0.5
    z = 1.0 - 2.0 * steps / count
    azimuth = np.pi * (1.0 + np.sqrt(5.0)) * steps
    across = np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z], axis=-1)
