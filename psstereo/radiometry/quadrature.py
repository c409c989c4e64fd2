"""Rules of points and weights over discs and triangles, all weights positive."""

from functools import cache

import numpy as np

from psstereo.types import FloatArray

__all__ = ["disc_rule", "triangle_rule"]

_GOLDEN_TURN = np.pi * (3.0 - np.sqrt(5.0))
"""Turn from ring to ring, after which no two rings' points line up [rad]."""


@cache
def disc_rule(count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return about ``count`` points of the unit disc: Gauss in the square of the radius, even in angle.

    With m rings of k points, polynomials in x and y are integrated exactly up to the degree min(2m, k) − 1 or better;
    the square of the radius may also stand for 1 − z of a spherical cap, whose area is even in it.

    Parameters
    ----------
    count : int
        How many points are wanted; fewer than 3 give the centre alone [1].

    Returns
    -------
    tuple of three float64 arrays (k,)
        Squares of the radii [1], angles [rad], and weights, whose sum is 1 [1]. Read-only.
    """
    if count < 3:
        return _kept(np.zeros(1)), _kept(np.zeros(1)), _kept(np.ones(1))
    rings = max(1, round(np.sqrt(count / 4.0)))
    around = max(3, round(count / rings))
    nodes, weights = np.polynomial.legendre.leggauss(rings)
    turn = 2.0 * np.pi / around * np.arange(around) + _GOLDEN_TURN * np.arange(rings)[:, None]
    squares = np.broadcast_to(0.5 + 0.5 * nodes[:, None], turn.shape)
    shares = np.broadcast_to(0.5 * weights[:, None] / around, turn.shape)
    return _kept(squares.ravel()), _kept(turn.ravel()), _kept(shares.ravel())


@cache
def triangle_rule(order: int) -> tuple[FloatArray, FloatArray]:
    """Return order² points of a triangle: Gauss rules along its height and across, exact up to the degree 2 order − 1.

    Parameters
    ----------
    order : int
        Points along each of the two ways; 1 gives the centroid [1].

    Returns
    -------
    tuple of float64 arrays (k, 3) and (k,)
        Barycentric coordinates, and weights, whose sum is 1 [1]. Read-only.
    """
    from scipy.special import roots_jacobi

    # The strip across the triangle grows in proportion to the distance from the first corner: that is Jacobi's weight.
    nodes, weights = roots_jacobi(order, 0.0, 1.0)
    across, shares = np.polynomial.legendre.leggauss(order)
    u, v = (axis.ravel() for axis in np.meshgrid(0.5 + 0.5 * nodes, 0.5 + 0.5 * across, indexing="ij"))
    points = np.stack([1.0 - u, u * (1.0 - v), u * v], axis=-1)
    return _kept(points), _kept(np.outer(weights / weights.sum(), shares / shares.sum()).ravel())


def _kept(values: FloatArray) -> FloatArray:
    """Return a read-only copy, which may be handed out again and again."""
    kept = np.array(values, np.float64)
    kept.flags.writeable = False
    return kept
