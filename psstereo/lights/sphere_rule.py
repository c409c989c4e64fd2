"""Rules of directions and weights over the whole sphere."""

from functools import cache

import numpy as np

from psstereo.types import FloatArray

__all__ = ["product_rule", "sphere_rule"]

_FEWEST = 32
"""With fewer points the conditions on the weights would make some of them negative."""
_GOLDEN_TURN = np.pi * (3.0 - np.sqrt(5.0))
"""Turn from point to point of a Fibonacci lattice [rad]."""


@cache
def sphere_rule(count: int) -> tuple[FloatArray, FloatArray]:
    """Return evenly spread directions, one after the other along a spiral, with nearly equal weights.

    A Fibonacci lattice [1]_ whose weights are corrected by the least change that makes polynomials up to the third
    degree exact: a radiance of order 2 keeps its flux and its vector irradiance. With 512 points the irradiance from
    uniform light has a root-mean-square error of 3e-4 over all normals.

    Parameters
    ----------
    count : int
        How many directions are wanted; there are 32 at least [1].

    Returns
    -------
    tuple of float64 arrays (k, 3) and (k,)
        Unit vectors [1] and positive weights, whose sum is 4π [sr]. Read-only.

    References
    ----------
    .. [1] Á. González, "Measurement of Areas on a Sphere Using Fibonacci and Latitude-Longitude Lattices",
       Math. Geosci. 42, 49-64, 2010. doi:10.1007/s11004-009-9257-x
    """
    k = max(count, _FEWEST)
    i = np.arange(k)
    height, turn = 1.0 - (2.0 * i + 1.0) / k, i * _GOLDEN_TURN
    across = np.sqrt((1.0 - height) * (1.0 + height))
    directions = np.stack([across * np.cos(turn), across * np.sin(turn), height], axis=-1)
    dense, dense_weights = product_rule(3)
    conditions = _cubics(directions)
    wanted = _cubics(dense) @ dense_weights
    weights = np.full(k, 4.0 * np.pi / k)
    weights += np.linalg.lstsq(conditions, wanted - conditions @ weights, rcond=1e-10)[0]
    return _kept(directions), _kept(weights)


@cache
def product_rule(degree: int) -> tuple[FloatArray, FloatArray]:
    """Return a Gauss rule in z times equal steps in azimuth, exact for polynomials up to a degree.

    Parameters
    ----------
    degree : int
        The highest degree in x, y, z that is integrated exactly, ≥ 0 [1].

    Returns
    -------
    tuple of float64 arrays (k, 3) and (k,)
        Unit vectors [1] and positive weights, whose sum is 4π [sr]. Read-only.
    """
    heights, shares = np.polynomial.legendre.leggauss(degree // 2 + 1)
    turns = 2.0 * np.pi / (degree + 1) * (np.arange(degree + 1) + 0.5)
    across = np.sqrt((1.0 - heights) * (1.0 + heights))[:, None]
    x, y = across * np.cos(turns), across * np.sin(turns)
    directions = np.stack([x, y, np.broadcast_to(heights[:, None], x.shape)], axis=-1)
    return _kept(directions.reshape(-1, 3)), _kept(np.repeat(shares * 2.0 * np.pi / (degree + 1), degree + 1))


def _cubics(directions: FloatArray) -> FloatArray:
    """Return all monomials up to the third degree, (20, k)."""
    powers = [(a, b, c) for a in range(4) for b in range(4 - a) for c in range(4 - a - b)]
    return np.stack([np.prod(directions ** np.array(power), axis=-1) for power in powers])


def _kept(values: FloatArray) -> FloatArray:
    """Return a read-only copy, which may be handed out again and again."""
    kept = np.array(values, np.float64)
    kept.flags.writeable = False
    return kept
