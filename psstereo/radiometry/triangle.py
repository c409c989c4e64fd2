"""Solid angle of a triangle.

Van Oosterom and Strackee (1983): with unit vectors a, b, c to the corners,

    tan(Ω/2) = a·(b × c) / (1 + a·b + b·c + c·a)

The triple product of a small triangle is the small difference of large products. It equals a·((b − a) × (c − a)), in
which the edges are formed from the corners as they were given: those differences are exact for neighbouring corners,
and what is left is a product of small numbers. Any corner may be the base; the rounding error is bounded by
ε |corner| |edge| |edge|, so that the corner with the smallest product is taken.
"""

import numpy as np
import numpy.typing as npt

from psstereo.radiometry.checks import vectors
from psstereo.types import FloatArray

__all__ = ["triangle_solid_angle"]

_DEGENERATE = 4.0 * float(np.finfo(np.float64).eps)
"""Both parts of the tangent below this: the observer is on the edge, and the angle could be anything [1]."""


def triangle_solid_angle(vertices: npt.ArrayLike, observer: npt.ArrayLike = (0.0, 0.0, 0.0)) -> FloatArray:
    """Signed solid angle of triangles, by Van Oosterom and Strackee with the triple product formed from edges [1]_.

    Positive where the right-hand normal (b − a) × (c − a) points away from the observer. So a closed mesh with outward
    normals sums to 4π from inside and to 0 from outside. The relative error is about 1e-15 times the ratio of the
    longest edge to the smallest height, over the cosine between normal and line of sight. Not for observers in the
    triangle's plane, where the solid angle jumps between −2π and 2π.

    Parameters
    ----------
    vertices : float array (..., 3, 3)
        Corners a, b, c along the last but one axis [m].
    observer : float array (..., 3)
        Where they are seen from; its leading axes broadcast with those of the vertices [m].

    Returns
    -------
    float64 array (...)
        Solid angle, −2π … 2π; NaN where the observer is at a corner or on an edge [sr].

    Raises
    ------
    InputError
        If the last axes are not (3, 3) and (3,).

    References
    ----------
    .. [1] A. van Oosterom and J. Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed. Eng. 30,
       125-126, 1983, doi:10.1109/TBME.1983.325207

    Examples
    --------
    >>> print(f"{triangle_solid_angle([[1, 0, 0], [0, 1, 0], [0, 0, 1]]) / np.pi:.15f}")
    0.500000000000000
    """
    corners = vectors("triangle", vertices, trailing=(3, 3))
    arms = corners - vectors("observer", observer)[..., None, :]
    with np.errstate(all="ignore"):
        lengths = np.sqrt(np.einsum("...i,...i->...", arms, arms))
        units = arms / lengths[..., None]
        sine = _triple_product(corners, arms, lengths) / np.prod(lengths, axis=-1)
        cosine = 1.0 + np.einsum("...ki,...ki->...", units, np.roll(units, -1, axis=-2))
        degenerate = np.hypot(sine, cosine) <= _DEGENERATE
        return np.where(degenerate, np.nan, 2.0 * np.arctan2(sine, cosine))


def _triple_product(corners: FloatArray, arms: FloatArray, lengths: FloatArray) -> FloatArray:
    """Return a·((b − a) × (c − a)), from the corner whose rounding error is smallest, (...)."""
    to_next = np.roll(corners, -1, axis=-2) - corners
    to_previous = np.roll(corners, 1, axis=-2) - corners
    edges = np.sqrt(np.einsum("...i,...i->...", to_next, to_next))
    base = np.argmin(lengths * (edges * np.roll(edges, 1, axis=-1)), axis=-1)
    triples = np.einsum("...i,...i->...", arms, np.cross(to_next, to_previous))
    return np.asarray(np.take_along_axis(triples, base[..., None], axis=-1)[..., 0])
