"""Error regions of normals, and whether they hold.

A solver that fits three numbers to m_eff observations tells the covariance C of the normal's error from the residual,
with ν = m_eff − 3 degrees of freedom. In the plane across the normal C is a 2 × 2 matrix, and for Gaussian noise the
square ``d² = eᵀ C⁻¹ e`` of the error's Mahalanobis distance is Hotelling's [1]_: d²/2 follows the F distribution with
(2, ν) degrees of freedom. The region that holds the true normal with the probability q is therefore ``d² ≤ 2 F_q(2,
ν)``. With two numerator degrees of freedom the quantile is elementary, ``2 F_q(2, ν) = ν ((1 − q)^(−2/ν) − 1)``, which
tends to the normal distribution's ``−2 ln(1 − q)`` for many observations and is fifteen times that for five of them.

References
----------
.. [1] H. Hotelling, "The generalization of Student's ratio", The Annals of Mathematical Statistics 2(3), 1931.
   doi:10.1214/aoms/1177732979
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError, OptionError
from psstereo.types import Array, BoolArray, FloatArray

__all__ = ["Coverage", "confidence_angle", "coverage"]

_UNKNOWNS = 3
"""Numbers that a pixel's observations determine: the albedo and two of the normal."""


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """How often the error regions held the truth.

    Attributes
    ----------
    share : float
        Share of the judged pixels whose true normal lies inside the region; NaN if none was judged [1].
    level : float
        The share that was promised [1].
    count : int
        Judged pixels.
    untold : int
        Pixels with a normal whose error is not known, mostly because three observations leave no residual.
    """

    share: float
    level: float
    count: int
    untold: int


def confidence_angle(covariance: FloatArray, used: npt.ArrayLike, *, level: float = 0.95) -> FloatArray:
    """Return the worst semi-axis of the region that holds the true normal.

    Not for few observations on a wide region: an angle of a radian says no more than that the normal is unknown, since
    the region is taken in the plane across the normal.

    Parameters
    ----------
    covariance : float array (..., 6)
        Covariance of the normal's error, entries xx, xy, yy, xz, yz, zz [rad²].
    used : array (...)
        Observations that each error rests on, m_eff; fractions are allowed [1].
    level : float
        Probability that the region holds the truth, between 0 and 1 [1].

    Returns
    -------
    float64 array (...)
        Angle, at most π; NaN where the covariance is, and where three or fewer observations tell nothing [rad].

    Raises
    ------
    InputError
        If the shapes do not fit each other.
    OptionError
        If the level is no probability.

    Examples
    --------
    >>> float(confidence_angle(np.array([1e-4, 0.0, 1e-4, 0.0, 0.0, 0.0]), 1e9).round(5))
    0.02448
    """
    c, m = _checked(covariance, used, level)
    xx, xy, yy, xz, yz, zz = np.moveaxis(c, -1, 0)
    # C has no part along the normal, so that its two other eigenvalues follow from the trace and the square's trace.
    trace = xx + yy + zz
    square = xx * xx + yy * yy + zz * zz + 2 * (xy * xy + xz * xz + yz * yz)
    with np.errstate(invalid="ignore"):
        largest = (trace + np.sqrt(np.maximum(2 * square - trace * trace, 0.0))) / 2
        return np.asarray(np.minimum(np.sqrt(largest * _quantile(m - _UNKNOWNS, level)), np.pi))


def coverage(
    normals: FloatArray,
    covariance: FloatArray,
    truth: FloatArray,
    used: npt.ArrayLike,
    *,
    level: float = 0.95,
    mask: BoolArray | None = None,
) -> Coverage:
    """Count the pixels whose true normal lies inside the region that the covariance promises.

    Not for data without noise: what is left of the residual is rounding, which follows no distribution.

    Parameters
    ----------
    normals : float array (..., 3)
        Estimated unit normals, NaN where unknown [1].
    covariance : float array (..., 6)
        Covariance of their errors, entries xx, xy, yy, xz, yz, zz [rad²].
    truth : float array (..., 3)
        True normals of any length; NaN or zero where unknown [1].
    used : array (...)
        Observations that each error rests on, m_eff [1].
    level : float
        Probability that the region holds the truth, between 0 and 1 [1].
    mask : bool array (...), optional
        Pixels to judge; all if absent.

    Returns
    -------
    Coverage
        The share, and how many pixels it rests on.

    Raises
    ------
    InputError
        If the shapes do not fit each other.
    OptionError
        If the level is no probability.

    Examples
    --------
    >>> up = np.array([[0.0, 0.0, 1.0]])
    >>> coverage(up, np.array([[1e-4, 0.0, 1e-4, 0.0, 0.0, 0.0]]), up, 9).share
    1.0
    """
    c, m = _checked(covariance, used, level)
    n, t = (np.asarray(a, np.float64) for a in (normals, truth))
    shape = c.shape[:-1]
    if n.shape != (*shape, 3) or t.shape != (*shape, 3) or (mask is not None and mask.shape != shape):
        raise InputError(
            given=f"The normals have the shape {n.shape}, the truth {t.shape}, the covariance {c.shape}.",
            needed="One normal, one true normal, one covariance of six numbers and one place in the mask a pixel.",
            remedy="Compare maps of the same size.",
        )
    length = np.linalg.norm(t, axis=-1)
    wanted = np.isfinite(n).all(axis=-1) & np.isfinite(length) & (length > 0)
    if mask is not None:
        wanted &= mask
    bound = np.broadcast_to(_quantile(m - _UNKNOWNS, level), shape)[wanted]
    distance = _mahalanobis(n[wanted], c[wanted], t[wanted] / length[wanted][:, None])
    told = np.isfinite(bound) & np.isfinite(distance)
    count = int(told.sum())
    share = float((distance[told] <= bound[told]).mean()) if count else float("nan")
    return Coverage(share=share, level=level, count=count, untold=int(wanted.sum()) - count)


def _checked(covariance: FloatArray, used: npt.ArrayLike, level: float) -> tuple[FloatArray, FloatArray]:
    if not 0 < level < 1:
        raise OptionError(
            given=f"The level is {level}.", needed="A probability between 0 and 1.", remedy="95 % is written 0.95."
        )
    c, m = np.asarray(covariance, np.float64), np.asarray(used, np.float64)
    if c.ndim < 1 or c.shape[-1] != 6 or (m.ndim and m.shape != c.shape[:-1]):
        raise InputError(
            given=f"The covariance has the shape {c.shape}; the counts, {m.shape}.",
            needed="Six numbers and one count a pixel.",
            remedy="Ask the estimate for its covariance, and give its counts beside it.",
        )
    return c, m


def _quantile(degrees: FloatArray, level: float) -> FloatArray:
    """Return 2 F_level(2, ν); NaN without a degree of freedom."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        nu = np.where(degrees > 0, degrees, np.nan)
        return np.asarray(nu * np.expm1(-2.0 / nu * np.log1p(-level)))


def _mahalanobis(n: FloatArray, c: FloatArray, truth: FloatArray) -> Array:
    """Return d² of each error, (p,): the way from n to the truth along the sphere, in the plane across n."""
    first, second = _tangents(n)
    sine = np.linalg.norm(np.cross(n, truth), axis=1)
    across = truth - n * (n * truth).sum(axis=1)[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        factor = np.where(sine > 0, np.arctan2(sine, (n * truth).sum(axis=1)) / sine, 1.0)
    error = across * factor[:, None]
    matrix = np.stack([c[:, [0, 1, 3]], c[:, [1, 2, 4]], c[:, [3, 4, 5]]], axis=1)
    a = np.einsum("px,pxy,py->p", first, matrix, first)
    b = np.einsum("px,pxy,py->p", first, matrix, second)
    d = np.einsum("px,pxy,py->p", second, matrix, second)
    u, v = (error * first).sum(axis=1), (error * second).sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        # Cholesky: what is left of d without the part that a explains
        rest = d - b * b / a
        return np.asarray(u * u / a + (v - b / a * u) ** 2 / rest)


def _tangents(n: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors across each unit vector."""
    axis = np.eye(3)[np.argmin(np.abs(n), axis=1)]
    first = np.cross(n, axis)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return first, np.cross(n, first)
