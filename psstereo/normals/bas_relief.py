"""The bas-relief transformations: what integrability leaves unknown of a surface under unknown lights.

The surfaces z and λ z + μ x + ν y show the same images under lights that change along with them [1]_. A transformation
is written here by the matrix

    K = [[1, 0, 0], [0, 1, 0], [μ, ν, λ]],

which turns scaled normals b into Kᵀ b and lights l into K⁻¹ l, so that l · b stays. Where λ is negative both change
their signs too, and hills become hollows.

References
----------
.. [1] P. N. Belhumeur, D. J. Kriegman, A. L. Yuille, "The bas-relief ambiguity", Int. J. Comput. Vis. 35(1), 33-44,
   1999. doi:10.1023/A:1008154927611
"""

from dataclasses import dataclass

import numpy as np

from psstereo.types import BoolArray, FloatArray

__all__ = ["PLAUSIBLE", "BasRelief", "is_plausible", "transformed", "typical_facing", "upright"]

PLAUSIBLE = (0.3, 0.995)
"""Median of n_z over the image in which a surface is sought: steeper ones are seen edge-on, flatter ones are flat."""
_TYPICAL_SLOPE = 0.7
"""Root mean square slope at which a search starts; seen from afar, a ball's is of that size."""


@dataclass(frozen=True, kw_only=True)
class BasRelief:
    """One transformation.

    Attributes
    ----------
    mu, nu : float
        Slant that is added along x and y [1].
    depth : float
        Factor λ of the depth, not zero; negative where hills become hollows [1].
    """

    mu: float
    nu: float
    depth: float

    @property
    def matrix(self) -> FloatArray:
        """K, float64 (3, 3), with its sign."""
        k = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [self.mu, self.nu, self.depth]])
        return np.asarray(k * np.sign(self.depth))

    def normals(self, normals: FloatArray) -> FloatArray:
        """Transform scaled normals (3, p)."""
        return np.asarray(self.matrix.T @ normals)

    def lights(self, lights: FloatArray) -> FloatArray:
        """Transform lights (m, 3)."""
        return np.asarray(np.linalg.solve(self.matrix, lights.T).T)


def upright(normals: FloatArray, trust: FloatArray) -> BasRelief:
    """Return the transformation after which a surface faces the camera on the whole and is neither flat nor steep.

    Parameters
    ----------
    normals : float64 array (3, p)
        Scaled normals in a basis in which they belong to a surface.
    trust : float64 array (p,)
        Weight of each.

    Returns
    -------
    BasRelief
        A place to start a search from.
    """
    length = np.sqrt((normals * normals).sum(axis=0))
    unit = normals / np.where(length > 0, length, 1.0)
    moment = (unit * trust) @ unit.T
    mu, nu = -moment[0, 2] / moment[2, 2], -moment[1, 2] / moment[2, 2]
    slopes = moment[0, 0] + moment[1, 1] + mu * moment[0, 2] + nu * moment[1, 2]
    return BasRelief(mu=float(mu), nu=float(nu), depth=float(np.sqrt(slopes / moment[2, 2]) / _TYPICAL_SLOPE))


def transformed(normals: FloatArray, parameters: FloatArray) -> FloatArray:
    """Return normals (3, n) under several transformations, (k, 3, n).

    Parameters
    ----------
    normals : float64 array (3, n)
        Scaled normals.
    parameters : float64 array (k, 3)
        μ, ν, log λ of each [1].
    """
    mu, nu, log_depth = (parameters[:, i : i + 1] for i in range(3))
    b1, b2, b3 = normals
    return np.stack([b1 + mu * b3, b2 + nu * b3, np.exp(log_depth) * b3], axis=1)


def typical_facing(normals: FloatArray, parameters: FloatArray) -> FloatArray:
    """Return the median of n_z under several transformations, (k,); see `transformed`."""
    b = transformed(normals, parameters)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.median(b[:, 2] / np.sqrt((b * b).sum(axis=1)), axis=1))


def is_plausible(normals: FloatArray, parameters: FloatArray) -> BoolArray:
    """Return which of several transformations give a surface that is neither flat nor seen edge-on, (k,)."""
    facing = typical_facing(normals, parameters)
    return np.asarray((facing > PLAUSIBLE[0]) & (facing < PLAUSIBLE[1]))
