"""Light as a polynomial of the unit normal: exact for a sun and for spherical harmonics of order 2."""

import numpy as np

from psstereo.errors import RigError
from psstereo.lights import Directional, Light
from psstereo.lights.sphere_rule import sphere_rule
from psstereo.types import FloatArray

__all__ = ["light_polynomial"]


def light_polynomial(light: Light) -> tuple[FloatArray, float]:
    """Return E(n) = c + b·n + nᵀ Q n as a share of its greatest value, and that value.

    A sun's polynomial is below zero where the surface faces away.

    Parameters
    ----------
    light : Light
        ``Directional``, or a distant light whose irradiance is a polynomial of degree 2 such as ``Harmonics``.

    Returns
    -------
    polynomial : float64 array (10,)
        c, b, and Q's entries xx, yy, zz, xy, xz, yz, over the greatest value [1].
    greatest : float
        Largest irradiance over all normals [unit of the light].

    Raises
    ------
    RigError
        If it gives no light anywhere.
    """
    if isinstance(light, Directional):
        greatest = float(light.strength[0])
        return np.concatenate([[0.0], light.direction, np.zeros(6)]), greatest
    polynomial = _interpolated(light)
    greatest = _greatest(polynomial)
    if not greatest > 0:
        raise RigError(
            given=f"The greatest irradiance of the light is {greatest:g}.",
            needed="Some normal must receive light.",
            remedy="Check the coefficients of the light.",
        )
    return polynomial / greatest, greatest


def _interpolated(light: Light) -> FloatArray:
    """Return the polynomial through the irradiances of nine normals; Q has no trace."""
    axes = np.eye(3)
    between = (axes[[0, 0, 1]] + axes[[1, 2, 2]]) / np.sqrt(2.0)
    normals = np.concatenate([axes, -axes, between])
    found = np.asarray(light.irradiance(np.zeros_like(normals), normals), np.float64)[:, 0]
    even, odd = 0.5 * (found[:3] + found[3:6]), 0.5 * (found[:3] - found[3:6])
    constant = even.mean()
    square = even - constant
    pairs = np.array([[0, 1], [0, 2], [1, 2]])
    mixed = found[6:] - constant - odd[pairs].sum(axis=1) / np.sqrt(2.0) - 0.5 * square[pairs].sum(axis=1)
    return np.concatenate([[constant], odd, square, mixed])


def _greatest(polynomial: FloatArray) -> float:
    """Return the largest value over the sphere."""
    c, linear = polynomial[0], polynomial[1:4]
    xx, yy, zz, xy, xz, yz = polynomial[4:]
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    n, _ = sphere_rule(1 << 10)
    # Each turn goes uphill, because the shift makes the quadratic part convex on all of space.
    shift = 2.0 * np.abs(matrix).sum() + 1e-3 * np.abs(polynomial).max()
    for _ in range(200):
        n = linear + 2.0 * n @ matrix + shift * n
        n = n / np.sqrt((n * n).sum(axis=1, keepdims=True))
    return float((c + n @ linear + np.einsum("ki,ij,kj->k", n, matrix, n)).max())
