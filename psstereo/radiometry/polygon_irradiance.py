"""Irradiance from a flat Lambertian polygon, for a receiver anywhere and of any orientation.

Lambert's formula [1]_: with corners r_k as seen from a receiver of normal n, θ_k the angle between neighbours,

    E = (L/2) Σ θ_k n · (r_k × r_(k+1)) / |r_k × r_(k+1)|

It holds for what is above the receiver's tangent plane, so the polygon is cut off there first (Sutherland and
Hodgman's method [2]_ against one plane). The sum subtracts terms of size s/d to get one of size (s/d)²: far away, a
Gauss rule over triangles takes its place, whose terms have the size of the result.

References
----------
.. [1] J. H. Lambert, Photometria, sive de mensura et gradibus luminis, colorum et umbrae, Augsburg, 1760
.. [2] I. E. Sutherland, G. W. Hodgman, "Reentrant polygon clipping", Commun. ACM 17, 32-42, 1974,
   doi:10.1145/360767.360802
"""

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError
from psstereo.radiometry.checks import directions, in_range, vectors
from psstereo.radiometry.quadrature import triangle_rule
from psstereo.types import BoolArray, FloatArray

__all__ = ["polygon_irradiance"]

_FAR = 50.0
"""Distance from which the Gauss rule is used, where four points each way leave 1e-14 [sizes of the polygon]."""
_BLOCK = 2**18
"""Corners worked on at a time, times receivers, which bounds the memory [1]."""
_FLAT = 1e-6
"""How far vertices may be from their common plane [sizes of the polygon]."""


def polygon_irradiance(
    radiance: npt.ArrayLike, points: npt.ArrayLike, normals: npt.ArrayLike, vertices: npt.ArrayLike
) -> FloatArray:
    """Irradiance from a uniform flat polygon that shines to one side, also where the surface's horizon cuts it.

    Closed form, accurate to 1e-13 of the irradiance that a surface facing the polygon would get, near and far; convex
    or not. It shines to the side from which its vertices run counter-clockwise. Not for sources whose radiance varies
    over the polygon or with the angle, nor for outlines that cross themselves, whose loops count with their sign.

    Parameters
    ----------
    radiance : float or float array (...)
        Radiance L of the polygon, ≥ 0 [W m⁻² sr⁻¹].
    points : float array (..., 3)
        Surface points [m].
    normals : float array (..., 3)
        Unit normals of the surface; NaN where not known [1].
    vertices : float array (n, 3)
        At least 3 vertices in one plane, in order, without repeating the first [m].

    Returns
    -------
    float64 array (...)
        Irradiance of the broadcast shape; 0 behind the polygon and in its plane beside it, NaN on the polygon itself,
        where it jumps, and wherever something is not known [W m⁻²].

    Raises
    ------
    InputError
        If radiance is negative, a normal has not length 1, or the vertices are not finite, not in one plane (to 1e-6 of
        their size), or enclose no area.

    Examples
    --------
    >>> face = [[1, 1, 1], [1, -1, 1], [-1, -1, 1], [-1, 1, 1]]  # of a cube, shining inward
    >>> print(f"{polygon_irradiance(1.0, [0, 0, 0], [0, 0, 1], face) / np.pi:.12f}")
    0.554126423980
    """
    level = in_range("radiance", radiance, unit="W m⁻² sr⁻¹")
    n = directions("normals", normals)
    position = vectors("points", points)
    corners, centre, axis, size = _flat(vectors("polygon", vertices, trailing=(None, 3)))
    shape = np.broadcast_shapes(position.shape, n.shape)
    n = np.broadcast_to(n, shape).reshape(-1, 3)
    away = np.broadcast_to((position - centre) / size, shape).reshape(-1, 3)
    factor = np.zeros(len(n))
    block = max(1, _BLOCK // len(corners))
    for start in range(0, len(n), block):
        some = slice(start, start + block)
        factor[some] = _factors(away[some], n[some], corners, axis)
    return np.asarray(level * factor.reshape(shape[:-1]))


def _factors(away: FloatArray, n: FloatArray, corners: FloatArray, axis: FloatArray) -> FloatArray:
    """Return E / L for receivers at places (p, 3) relative to the polygon's middle, in units of its size."""
    with np.errstate(all="ignore"):
        height = away @ axis
        known = ~np.isnan(height + n.sum(axis=-1))
        factor = np.where(known & (height < 0.0), 0.0, np.nan)
        in_plane = known & (height == 0.0)
        factor[in_plane] = _in_plane(away[in_plane], corners, axis)
        front = known & (height > 0.0)
        distant = np.sqrt(np.einsum("pi,pi->p", away, away)) > _FAR
        rises = n @ corners.T - np.einsum("pi,pi->p", n, away)[:, None]
        whole, hidden = (rises >= 0.0).all(axis=-1), (rises <= 0.0).all(axis=-1)
        for some, clip in [(front & whole, False), (front & ~whole & ~hidden, True)]:
            arms, grazing = corners - away[some][:, None, :], np.zeros((np.count_nonzero(some), len(corners)), np.bool_)
            if clip:
                arms, grazing = _clipped(arms, rises[some])
            far = distant[some]
            part = np.zeros(len(far))
            part[far] = _area(arms[far], n[some][far], axis)
            part[~far] = _outline(arms[~far], n[some][~far], grazing[~far])
            factor[some] = part
        factor[front & hidden] = 0.0
        return factor


def _flat(corners: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return corners about the polygon's middle in units of its size, the middle, the unit normal, the size."""
    if corners.ndim != 2 or not np.isfinite(corners).all():
        raise InputError(
            given=f"The polygon has the shape {corners.shape}, {np.count_nonzero(~np.isfinite(corners))} not finite.",
            needed="One polygon of n ≥ 3 vertices with three finite numbers each is needed.",
            remedy="Give an array (n, 3); add the irradiances of several polygons.",
        )
    centre = corners.mean(axis=0)
    size = float(np.abs(corners - centre).max())
    about = (corners - centre) / (size if size > 0.0 else 1.0)
    normal = 0.5 * np.cross(about, np.roll(about, -1, axis=0)).sum(axis=0)
    area = float(np.sqrt(normal @ normal))
    off = float(np.abs(about @ normal).max() / area) if area > 1e-12 else np.inf
    if not off <= _FLAT:
        raise InputError(
            given=f"The polygon's area is {area * size**2:.4g}, and its vertices are up to {off:.2g} of its size off.",
            needed="A flat polygon with an area is needed.",
            remedy="Correct its vertices, or split it into triangles.",
        )
    return about, centre, normal / area, size


def _in_plane(away: FloatArray, corners: FloatArray, axis: FloatArray) -> FloatArray:
    """Return 0 for points of the polygon's plane beside it, around which it does not go, and NaN for those on it."""
    arms = corners - away[:, None, :]
    following = np.roll(arms, -1, axis=1)
    turn = np.arctan2(np.cross(arms, following) @ axis, np.einsum("pki,pki->pk", arms, following))
    return np.where(np.abs(turn.sum(axis=-1)) > 1e-6, np.nan, 0.0)


def _clipped(arms: FloatArray, rises: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the part of polygons above a plane, (p, 2n, 3), and which of its edges lie in the plane, (p, 2n).

    Every edge gives its first corner, then its crossing. What is not there is filled with the corner before it, which
    adds edges of length zero only.
    """
    inside = rises > 0.0
    following, rise_following = np.roll(arms, -1, axis=1), np.roll(rises, -1, axis=1)
    crosses = inside != np.roll(inside, -1, axis=1)
    share = rises / np.where(crosses, rises - rise_following, 1.0)
    crossing = arms + share[..., None] * (following - arms)
    count, corners = rises.shape
    slots = np.stack([arms, crossing], axis=2).reshape(count, 2 * corners, 3)
    there = np.stack([inside, crosses], axis=2).reshape(count, 2 * corners)
    source = np.where(there, np.arange(2 * corners), -1)
    latest = np.maximum.accumulate(source, axis=1)
    latest = np.where(latest < 0, source.max(axis=1, keepdims=True), latest)
    leaves = np.stack([np.zeros_like(inside), inside & crosses], axis=2).reshape(count, 2 * corners)
    return np.take_along_axis(slots, latest[..., None], axis=1), np.take_along_axis(leaves, latest, axis=1)


def _outline(arms: FloatArray, n: FloatArray, grazing: BoolArray) -> FloatArray:
    """Return E / L by Lambert's formula; grazing edges lie in the receiver's plane."""
    edges = np.roll(arms, -1, axis=1) - arms
    product = np.cross(arms, edges)  # r_k × r_(k+1), without the loss of digits where they are close
    sine = np.sqrt(np.einsum("pki,pki->pk", product, product))
    cosine = np.einsum("pki,pki->pk", arms, arms + edges)
    # The angle over its sine; an edge of length zero adds nothing.
    ratio = np.where(sine > 0.0, np.arctan2(sine, cosine) / sine, 0.0)
    along = np.einsum("pki,pi->pk", product, n)
    # Grazing edges turn about the normal itself, however close they pass by the receiver.
    terms = np.where(grazing, np.arctan2(along, cosine), ratio * along)
    return np.asarray(np.maximum(-0.5 * terms.sum(axis=-1), 0.0))


def _area(arms: FloatArray, n: FloatArray, axis: FloatArray) -> FloatArray:
    """Return E / L as ∬ (n·r) (−axis·r) / |r|⁴ dA by a Gauss rule over a fan of signed triangles."""
    total = np.zeros(len(arms))
    rule, weights = triangle_rule(4)
    for k in range(1, arms.shape[1] - 1):
        fan = np.stack([arms[:, 0], arms[:, k], arms[:, k + 1]], axis=1)
        area = 0.5 * np.cross(fan[:, 1] - fan[:, 0], fan[:, 2] - fan[:, 0]) @ axis
        for place, weight in zip(rule, weights, strict=True):
            r = np.einsum("k,pki->pi", place, fan)
            square = np.einsum("pi,pi->p", r, r)
            total += weight * area * (np.einsum("pi,pi->p", n, r) / square) * (-(r @ axis) / square)
    return np.maximum(total, 0.0)
