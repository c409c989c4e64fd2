"""Robust fits of brightness by a light matrix: which observations follow the model, and how much each may say.

Brightness V (m, p) is explained as A B with a light matrix A (m, 3) whose rows are strength times direction, in any
basis, and scaled normals B (3, p). Everything here depends on the products A B only, so that it serves known lights,
lights of unknown strength, and factorisations known up to a 3 × 3 matrix alike.
"""

from dataclasses import dataclass

import numpy as np

from psstereo.types import BoolArray, FloatArray

__all__ = ["LowRankFit", "fit_normals", "first_weights", "reweighted", "solve_symmetric"]

DARK = 0.05
"""Share of a pixel's brightest value below which an observation counts as shadow."""
_FLOOR = 1e-3
"""Least scale of a pixel's residuals, as a share of its brightest value: no image is better than that."""
_ROWS, _COLUMNS = np.array([0, 0, 0, 1, 1, 2]), np.array([0, 1, 2, 1, 2, 2])


@dataclass(frozen=True, eq=False)
class LowRankFit:
    """A fit of all pixels by one light matrix.

    Attributes
    ----------
    normals : float64 array (3, p)
        Scaled normals B in the basis of the light matrix; zero where a pixel has too few observations.
    model : float64 array (m, p)
        A B.
    weights : float64 array (m, p)
        Weights of the observations, 0 where left out; sums over a pixel's are comparable between pixels.
    gram : float64 array (3, 3, p)
        Σ_i w_i a_i a_iᵀ of each pixel.
    spread : float64 array (p,)
        Robust residual over the pixel's brightest value; infinite where a pixel has too few observations [1].
    """

    normals: FloatArray
    model: FloatArray
    weights: FloatArray
    gram: FloatArray
    spread: FloatArray


def first_weights(values: FloatArray) -> FloatArray:
    """Return weights (m, p) that leave out what is dark against its pixel after images are made equally bright."""
    usable = np.isfinite(values)
    level = np.nanquantile(values, 0.9, axis=1)
    even = np.where(usable, values, 0.0) / level[:, None]
    bright = even > 2 * DARK * np.quantile(even, 0.9, axis=0)
    return np.asarray(bright & usable, np.float64)


def fit_normals(values: FloatArray, lights: FloatArray, weights: FloatArray) -> LowRankFit:
    """Fit every pixel by weighted least squares.

    Parameters
    ----------
    values : float64 array (m, p)
        Brightness, finite.
    lights : float64 array (m, 3)
        Light matrix A.
    weights : float64 array (m, p)
        Weights, zero for what is left out.

    Returns
    -------
    LowRankFit
        The fit; its spread is taken over observations of positive weight.
    """
    table = outer_entries(lights.T) @ weights
    gram = np.zeros((3, 3, values.shape[1]))
    gram[_ROWS, _COLUMNS] = gram[_COLUMNS, _ROWS] = table
    usable = (weights > 1e-3 * weights.max(axis=0)).sum(axis=0) >= min(5, len(values))
    normals, singular = solve_symmetric(table, lights.T @ (weights * values))
    lost = singular | ~usable
    normals[:, lost] = 0.0
    model = lights @ normals
    brightest = model.max(axis=0)
    lost |= ~(brightest > 0)
    spread = _spread(values - model, weights > 0, brightest)
    spread[lost] = np.inf
    weights = weights * ~lost
    return LowRankFit(normals, model, weights, gram, spread)


def _spread(residual: FloatArray, used: BoolArray, brightest: FloatArray) -> FloatArray:
    """Return 1.48 times the median magnitude of each pixel's residuals in use, over its brightest value."""
    rows = np.where(used, np.abs(residual), np.inf).T.copy()  # a pixel's numbers side by side sort several times faster
    rows.sort(axis=1)
    middle = used.sum(axis=0) // 2
    median = np.take_along_axis(rows, np.minimum(middle, rows.shape[1] - 1)[:, None], axis=1)[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(1.4826 * median / brightest)


def reweighted(values: FloatArray, usable: BoolArray, fit: LowRankFit) -> FloatArray:
    """Return weights (m, p) by a fit: Geman–McClure on what the fit says is lit, pixels by how well they are fitted.

    Parameters
    ----------
    values : float64 array (m, p)
        Brightness, finite.
    usable : bool array (m, p)
        Which observations may be used at all.
    fit : LowRankFit
        A fit of the same values.

    Returns
    -------
    float64 array (m, p)
        Weights relative to the square of a pixel's brightest value, so that bright pixels have no more say.
    """
    fitted = np.isfinite(fit.spread)
    brightest = np.where(fitted, fit.model.max(axis=0), 1.0)
    threshold = DARK * brightest
    lit = usable & fitted & (fit.model > threshold) & (values > threshold)
    scale = np.where(fitted, np.maximum(fit.spread, _FLOOR), 1.0)
    t = (values - fit.model) / (scale * brightest)
    middle = np.median(scale[fitted]) if fitted.any() else 1.0
    say = 1.0 / (brightest**2 * (1.0 + (scale / middle) ** 2))
    return np.asarray(lit * say / (1.0 + t * t) ** 2)


def outer_entries(vectors: FloatArray) -> FloatArray:
    """Return the entries 11, 12, 13, 22, 23, 33 of v vᵀ, (6, n), of vectors (3, n)."""
    return np.asarray(vectors[_ROWS] * vectors[_COLUMNS])


def solve_symmetric(table: FloatArray, right: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Solve 3 × 3 systems side by side.

    Parameters
    ----------
    table : float64 array (6, p)
        Entries 11, 12, 13, 22, 23, 33 of positive semidefinite matrices.
    right : float64 array (3, p)
        Right sides.

    Returns
    -------
    solution : float64 array (3, p)
        Zero where singular.
    singular : bool array (p,)
        Where a pivot is negligible.
    """
    a11, a12, a13, a22, a23, a33 = table
    tiny = 1e-10 * (a11 + a22 + a33)
    with np.errstate(all="ignore"):
        l21, l31 = a12 / a11, a13 / a11
        d2 = a22 - l21 * a12
        l32 = (a23 - l31 * a12) / d2
        d3 = a33 - l31 * a13 - l32 * l32 * d2
        y2 = right[1] - l21 * right[0]
        y3 = right[2] - l31 * right[0] - l32 * y2
        x3 = y3 / d3
        x2 = y2 / d2 - l32 * x3
        x1 = right[0] / a11 - l21 * x2 - l31 * x3
    singular = ~((a11 > tiny) & (d2 > tiny) & (d3 > tiny))
    solution = np.stack([x1, x2, x3])
    solution[:, singular] = 0.0
    return solution, singular
