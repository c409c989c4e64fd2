"""One picture of a matte ball fitted by Lambert's law: direction and strength of the light, and light that is added.

``V = max(0, b · n) + a`` with b along the light, a the same everywhere: ambient light, or the level that the camera
shows in the dark. Where the light does not reach, V = a, so that a terminator on the ball tells the two apart sharply.
The fit is repeated with less weight for what lies off it: highlights, dust, the ball's stand. A ball that is not quite
matte, or not quite lit by one lamp, errs in the same way over large parts, and its formal errors would be far too
small. Errors are those of a jackknife: how much the answer changes when one of twelve sectors of the ball is left out.
"""

from dataclasses import dataclass

import numpy as np

from psstereo.types import FloatArray, IntArray

__all__ = ["SECTORS", "MatteFit", "fit_matte"]

SECTORS = 12
"""Parts that the ball is cut into, around its middle."""
_ROUNDS = 60
_TUNING = 2.385
"""Of Cauchy's weights, for 95 % efficiency under normal errors."""
_FLOOR = 1e-6
"""Smallest scale of residuals over the largest value, so that exact pictures have weights."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MatteFit:
    """What one channel of one picture tells.

    Attributes
    ----------
    solution : float64 array (4,)
        b along the light, and a [value].
    covariance : float64 array (4, 4)
        Of their errors, by the jackknife [value²].
    residual : float
        Root-mean-square residual of what the weights keep, over the root-mean-square value above a [1].
    """

    solution: FloatArray
    covariance: FloatArray
    residual: float


def fit_matte(normals: FloatArray, values: FloatArray, sector: IntArray, *, ambient: float | None = None) -> MatteFit:
    """Fit a picture of a matte ball.

    Parameters
    ----------
    normals : float array (p, 3)
        Of the ball's pixels [1].
    values : float array (p,)
        Their linear values, none of them clipped [value].
    sector : int array (p,)
        Which of the `SECTORS` each pixel lies in.
    ambient : float, optional
        Level a if it is known; it is found if absent [value].

    Returns
    -------
    MatteFit
        Light and level; NaN if the pixels do not tell them.
    """
    size = 3 if ambient is not None else 4
    known = 0.0 if ambient is None else ambient
    solution, weights = _start(normals, values, known, size), np.ones(len(values))
    floor = _FLOOR * float(np.abs(values).max())
    design = _design(normals, solution, size)
    for _ in range(_ROUNDS):
        design = _design(normals, solution, size)
        gap = values - known - design @ solution
        scale = max(1.4826 * float(np.median(np.abs(gap - np.median(gap)))), floor)
        weights = 1.0 / (1.0 + (gap / (_TUNING * scale)) ** 2)
        moved = _solve((design * weights[:, None]).T @ design, design.T @ (weights * (values - known)))
        step = float(np.abs(moved - solution).max())
        solution = moved
        if not step > 1e-9 * float(np.abs(solution).max()):
            break
    covariance = _jackknife(design, weights, values - known, sector)
    gap = values - known - design @ solution
    above = design[:, :3] @ solution[:3]
    strength = float((weights * above * above).sum())
    residual = float(np.sqrt((weights * gap * gap).sum() / strength)) if strength > 0 else np.nan
    whole, spread = np.full(4, known), np.zeros((4, 4))
    whole[:size], spread[:size, :size] = solution, covariance
    return MatteFit(solution=whole, covariance=spread, residual=residual)


def _start(normals: FloatArray, values: FloatArray, known: float, size: int) -> FloatArray:
    """Return a first answer from the brighter half, which is lit; the darkest part gives the level."""
    level = known if size == 3 else float(np.quantile(values, 0.02))
    bright = values >= np.median(values)
    lit = normals[bright]
    light = _solve(lit.T @ lit, lit.T @ (values[bright] - level))
    return light if size == 3 else np.array([*light, level])


def _design(normals: FloatArray, solution: FloatArray, size: int) -> FloatArray:
    lit = (normals @ solution[:3] > 0)[:, None]
    parts = [np.where(lit, normals, 0.0)]
    if size == 4:
        parts.append(np.ones((len(normals), 1)))
    return np.concatenate(parts, axis=1)


def _solve(matrix: FloatArray, side: FloatArray) -> FloatArray:
    if not np.isfinite(matrix).all() or np.linalg.cond(matrix) > 1e12:
        return np.full(len(side), np.nan)
    return np.linalg.solve(matrix, side)


def _jackknife(design: FloatArray, weights: FloatArray, values: FloatArray, sector: IntArray) -> FloatArray:
    """Return the covariance of the weighted solution from leaving one sector out at a time."""
    size = design.shape[1]
    weighted = design * weights[:, None]
    matrices, sides = np.zeros((SECTORS, size, size)), np.zeros((SECTORS, size))
    for s in range(SECTORS):
        own = sector == s
        matrices[s] = weighted[own].T @ design[own]
        sides[s] = weighted[own].T @ values[own]
    whole, side = matrices.sum(axis=0), sides.sum(axis=0)
    left = np.array([_solve(whole - matrices[s], side - sides[s]) for s in range(SECTORS)])
    off = left - left.mean(axis=0)
    return np.asarray((SECTORS - 1) / SECTORS * off.T @ off)
