"""Weighted least squares of three unknowns at every pixel, in the basis of the rig's factorisation.

With the light matrix factored once as L = Q R, the scaled normal b of a pixel solves ``min Σ_i w_i (I_i − q_i·x)²``
with ``x = R b`` and q_i the rows of Q. Its normal matrix ``A = Σ w_i q_i q_iᵀ`` has six different entries, so one
product of the weights (m, p) with a table (6, m) gives all pixels' matrices, and a Cholesky factorisation of 3 × 3
numbers solves them side by side. Working with Q instead of L matters: A is the identity when all weights are 1, however
poor the rig, so the rig's condition number is not squared; it enters once, in ``b = R⁻¹ x``.

What a pixel's own gate costs in condition would still be squared by A. One step of correction from the residual of the
data (the corrected semi-normal equations [1]_) removes that too, at the price of one more product.

References
----------
.. [1] Å. Björck, "Stability analysis of the method of seminormal equations for linear least squares problems", Linear
   Algebra and its Applications 88/89, 1987. doi:10.1016/0024-3795(87)90101-7
"""

from dataclasses import dataclass, field

import numpy as np

from psstereo.lights import Rig
from psstereo.scratch import Scratch
from psstereo.types import BoolArray, FloatArray

__all__ = [
    "Factor",
    "RigFactor",
    "angular_covariance",
    "angular_spread",
    "cholesky",
    "solve_cholesky",
    "widening",
]

_SINGULAR = 1e-10
"""Pivot over trace below which a pixel's lights count as coplanar: 1e-5 of the rig's own spread, squared."""

Factor = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]
"""Entries l11, l21, l22, l31, l32, l33 of lower triangular factors, each (p,)."""


@dataclass(frozen=True, eq=False)
class RigFactor:
    """The factorisation L = Q R of a light matrix.

    Attributes
    ----------
    q : float64 array (m, 3)
        Orthonormal columns.
    r_inverse : float64 array (3, 3)
        R⁻¹.
    moments : float64 array (6, m)
        Products q₁q₁, q₁q₂, q₂q₂, q₁q₃, q₂q₃, q₃q₃ of each row of Q.
    scratch : Scratch
        Working arrays of a block, a set for each thread.
    """

    q: FloatArray
    r_inverse: FloatArray
    moments: FloatArray
    scratch: Scratch = field(default_factory=Scratch)

    @classmethod
    def from_rig(cls, rig: Rig) -> "RigFactor":
        """Factor a rig of distant lights.

        Raises
        ------
        RigError
            If there are fewer than three lights or they are coplanar.
        UnsupportedError
            If a light is not distant.
        """
        directions = rig.directions
        rig.require_spanning()
        q, r = np.linalg.qr(directions)
        a, b, c = q.T
        moments = np.stack([a * a, a * b, b * b, a * c, b * c, c * c])
        return cls(q, np.linalg.solve(r, np.eye(3)), moments)


def cholesky(a: FloatArray) -> tuple[Factor, BoolArray]:
    """Factor symmetric 3 × 3 matrices A = G Gᵀ.

    Parameters
    ----------
    a : float64 array (6, p)
        Entries 11, 12, 22, 13, 23, 33.

    Returns
    -------
    factor : tuple of six float64 arrays (p,)
        Entries of G; NaN where singular.
    singular : bool array (p,)
        Where a pivot is negligible against the trace.
    """
    a11, a12, a22, a13, a23, a33 = a
    tiny = _SINGULAR * (a11 + a22 + a33)
    with np.errstate(invalid="ignore", divide="ignore"):
        l11 = np.sqrt(np.where(a11 > tiny, a11, np.nan))
        l21, l31 = a12 / l11, a13 / l11
        d2 = a22 - l21 * l21
        l22 = np.sqrt(np.where(d2 > tiny, d2, np.nan))
        l32 = (a23 - l31 * l21) / l22
        d3 = a33 - l31 * l31 - l32 * l32
        l33 = np.sqrt(np.where(d3 > tiny, d3, np.nan))
    return (l11, l21, l22, l31, l32, l33), ~np.isfinite(l33)


def solve_cholesky(factor: Factor, rhs: FloatArray) -> FloatArray:
    """Return x, (3, p), with G Gᵀ x = rhs; NaN where the factor is."""
    l11, l21, l22, l31, l32, l33 = factor
    y1 = rhs[0] / l11
    y2 = (rhs[1] - l21 * y1) / l22
    y3 = (rhs[2] - l31 * y1 - l32 * y2) / l33
    x3 = y3 / l33
    x2 = (y2 - l32 * x3) / l22
    x1 = (y1 - l21 * x2 - l31 * x3) / l11
    return np.stack([x1, x2, x3])


def angular_spread(r_inverse: FloatArray, factor: Factor | None, normals: FloatArray) -> FloatArray:
    """Return the root-mean-square angle of a normal's error per unit of relative noise.

    For white noise of standard deviation σ the covariance of b is σ² (LᵀWL)⁻¹ = σ² M Mᵀ with M = R⁻¹ G⁻ᵀ; its part
    across n has the trace ``|M|² − |Mᵀn|²``, and dividing by the albedo turns lengths into angles. For Gaussian noise
    this is the Cramér–Rao bound with the albedo unknown.

    Parameters
    ----------
    r_inverse : float64 array (3, 3)
        R⁻¹ of the rig.
    factor : Factor or None
        Cholesky factors G of the pixels' matrices, None where all are the identity.
    normals : float64 array (3, p)
        Unit normals.

    Returns
    -------
    float64 array (p,)
        Angle for σ equal to the albedo [rad].
    """
    across = _across(r_inverse, factor, normals)
    across *= across
    return np.asarray(np.sqrt(across.sum(axis=(0, 1))))


def angular_covariance(r_inverse: FloatArray, factor: Factor | None, normals: FloatArray) -> FloatArray:
    """Return the covariance of a unit normal's error for σ equal to the albedo; see :func:`angular_spread`.

    Parameters
    ----------
    r_inverse : float64 array (3, 3)
        R⁻¹ of the rig.
    factor : Factor or None
        Cholesky factors G of the pixels' matrices, None where all are the identity.
    normals : float64 array (3, p)
        Unit normals.

    Returns
    -------
    float64 array (p, 6)
        Entries xx, xy, yy, xz, yz, zz; their trace is the square of what :func:`angular_spread` returns [rad²].
    """
    x, y, z = _across(r_inverse, factor, normals)
    pairs = ((x, x), (x, y), (y, y), (x, z), (y, z), (z, z))
    return np.stack([(first * second).sum(axis=0) for first, second in pairs], axis=1)


def widening(directions: FloatArray, normals: FloatArray, uncertainty: FloatArray) -> FloatArray:
    """Return by how much error bars grow because an error along the normal may be as large as the normal itself.

    Under nearly coplanar lights noise alone can make a long vector across their plane. To first order its direction
    looks certain, since nearly all of its error lies along it; two standard errors of that, squared, are added.

    Parameters
    ----------
    directions : float array (m, 3)
        Toward the lights [1].
    normals : float array (p, 3)
        Unit normals found, NaN where there is none [1].
    uncertainty : float array (p,)
        Error bars to first order [rad].

    Returns
    -------
    float64 array (p,)
        Factors of at least 1 [1].
    """
    inverse = np.linalg.pinv(directions, rcond=0.0)
    n = np.asarray(normals, np.float64)
    along = n @ inverse
    across = inverse - n[:, :, None] * along[:, None, :]
    ratio = (along * along).sum(axis=1) / (across * across).sum(axis=(1, 2))
    return np.asarray(np.sqrt(1.0 + np.square(4.0 * np.asarray(uncertainty, np.float64) * ratio)))


def _across(r_inverse: FloatArray, factor: Factor | None, normals: FloatArray) -> FloatArray:
    """Return the part of every pixel's M across its normal, (3, 3, p)."""
    m = np.broadcast_to(r_inverse[:, :, None], (3, 3, 1)) if factor is None else _spread_matrix(r_inverse, factor)
    along = (m * normals[:, None]).sum(axis=0)
    return np.asarray(m - normals[:, None] * along)  # subtract the vectors, not their squares: no cancellation


def _spread_matrix(r_inverse: FloatArray, factor: Factor) -> FloatArray:
    """Return M = R⁻¹ G⁻ᵀ of every pixel, (3, 3, p)."""
    l11, l21, l22, l31, l32, l33 = factor
    inverse = np.zeros((3, 3, len(l11)))  # the entry j, k is the entry k, j of G⁻¹
    g11, g22, g33 = 1 / l11, 1 / l22, 1 / l33
    inverse[0, 0], inverse[1, 1], inverse[2, 2] = g11, g22, g33
    inverse[0, 1] = -l21 * g11 * g22
    inverse[1, 2] = -l32 * g22 * g33
    inverse[0, 2] = (l21 * l32 * g22 - l31) * g11 * g33
    return (r_inverse @ inverse.reshape(3, -1)).reshape(inverse.shape)
