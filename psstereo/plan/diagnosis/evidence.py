"""What the checks share: a sample's lit observations, robustly weighted, and what a fault would add to them.

A fault adds, to first order, a known pattern times an unknown size to every observation: v = L b + Σ θ h, with b the
scaled normal of each pixel and θ the same for all pixels. Eliminating b pixel by pixel leaves small normal equations
for θ. Residuals of neighbouring pixels hang together, so the error of θ is told by how much blocks of pixels disagree,
not by how many pixels there are.
"""

from dataclasses import dataclass

import numpy as np

from psstereo.normals.low_rank_fit import fit_normals, outer_entries, reweighted
from psstereo.normals.strength_steps import inverse_root
from psstereo.plan.sample import Sample
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Evidence", "Explanation", "evidence"]

_MOST = 50_000
"""Observations that are looked at; what is beyond is thinned evenly, so that the cost is bounded."""
_ROUNDS = 3
_ENTRIES = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
"""Where the entries of a symmetric matrix stand among 11, 12, 13, 22, 23, 33."""
_SINGULAR = 1e6
"""Product of the traces of a matrix and its inverse beyond which a pixel's lit lights do not tell its normal."""
_AGAIN = 2
"""Times that patterns are fitted again with new weights."""
_FLOOR = 1e-3
"""Least scale of a pixel's residuals over its albedo: no image is better than that."""
_DARK = 0.1
"""Albedo below this share of a bright one is not looked at: noise over it is too large."""
_LEAST = 64
"""Pixels below which nothing is said."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """How well patterns explain what a matte surface under the given lights leaves unexplained.

    Attributes
    ----------
    size : float64 array (k,)
        Size θ of each pattern.
    error : float64 array (k,)
        Its standard error by the disagreement of blocks.
    share : float
        Share of the squared residual that the patterns take away [1].
    blocks : float64 array (b, k)
        Size of each pattern by the block's own data, NaN where it does not tell.
    """

    size: FloatArray
    error: FloatArray
    share: float
    blocks: FloatArray


@dataclass(frozen=True, eq=False)
class Evidence:
    """Lit observations of the pixels that are worth a look, each pixel divided by its albedo.

    Attributes
    ----------
    chosen : int array (n,)
        Which of the sample's pixels they are.
    lights : float64 array (m, 3)
        Unit directions.
    values : float64 array (m, n)
        Brightness over albedo; zero where not usable.
    normals : float64 array (3, n)
        Scaled normals of the robust fit, about 1 long.
    model : float64 array (m, n)
        Fitted brightness, ``lights @ normals``.
    weights : float64 array (m, n)
        Robust weights, zero where left out.
    albedo : float64 array (n,)
        What was divided by, in the unit of the sample's values.
    blocks : int array (n,)
        Block of each pixel, counted anew from 0.
    place : float64 array (2, n)
        x right and y up from the middle of the sample, over `reach` [1].
    reach : float
        Half of the sample's larger extent [px].
    """

    chosen: IntArray
    lights: FloatArray
    values: FloatArray
    normals: FloatArray
    model: FloatArray
    weights: FloatArray
    albedo: FloatArray
    blocks: IntArray
    place: FloatArray
    reach: float

    @property
    def redundant(self) -> bool:
        """Whether residuals say anything: more lights than unknowns, and enough pixels."""
        return len(self.lights) > 3 and len(self.blocks) >= _LEAST

    def residual(self) -> float:
        """Return the weighted root mean square of the residual over the albedo [1]."""
        left = self.values - self.model
        total = float(self.weights.sum())
        return float(np.sqrt((self.weights * left * left).sum() / total)) if total > 0 else float("nan")

    def explain(self, patterns: FloatArray) -> Explanation:
        """Fit patterns (k, m, n) beside the normals.

        Observations are weighted anew by what the patterns leave: weights of the plain fit would take what a pattern
        adds for outliers, and make it small.
        """
        lit, weights = self.weights > 0, self.weights
        count, blocks = len(patterns), int(self.blocks.max(initial=-1)) + 1
        say = self.weights.max(axis=0, initial=0.0)
        table = np.zeros((count + 1, count + 1, blocks))
        for round_ in range(_AGAIN + 1):
            weights, root = _roots(self.lights, weights)
            left = [_eliminated(self.lights, weights, root, h) for h in (*patterns, self.values)]
            for a in range(count + 1):
                for b in range(a, count + 1):
                    product = (weights * left[a] * left[b]).sum(axis=0)
                    table[a, b] = table[b, a] = np.bincount(self.blocks, product, blocks)
            found = _solved(table)
            if round_ < _AGAIN:
                rest = left[-1] - sum(size * h for size, h in zip(found.size, left, strict=False))
                weights = lit * say * _geman(rest, lit)
        return found


def _geman(residual: FloatArray, lit: BoolArray) -> FloatArray:
    """Return Geman–McClure weights by the scale of each pixel's residuals."""
    size = np.where(lit, np.abs(residual), np.inf)
    place = np.minimum(lit.sum(axis=0) // 2, len(size) - 1)
    middle = np.take_along_axis(np.sort(size, axis=0), place[None], axis=0)[0]
    scale = np.maximum(1.4826 * np.where(np.isfinite(middle), middle, 1.0), _FLOOR)
    return np.asarray(1.0 / (1.0 + (residual / scale) ** 2) ** 2)


def evidence(sample: Sample) -> Evidence:
    """Choose, scale and weight what the checks look at.

    Parameters
    ----------
    sample : Sample
        The sample.

    Returns
    -------
    Evidence
        Of at most 80 000 observations.
    """
    with np.errstate(invalid="ignore"):
        middling = np.nanquantile(sample.albedo, 0.9) if np.isfinite(sample.albedo).any() else np.nan
        good = np.isfinite(sample.albedo) & (sample.albedo > _DARK * middling)
    chosen = np.flatnonzero(good)
    step = -(-len(chosen) * len(sample.directions) // _MOST)
    chosen = chosen[:: max(step, 1)]
    values = sample.values[:, chosen] / sample.albedo[chosen]
    usable = np.isfinite(values)
    values = np.where(usable, values, 0.0)
    lights = sample.directions
    weights = _weights(values, usable, lights)
    fit = fit_normals(values, lights, weights)
    kept = np.flatnonzero(np.isfinite(fit.spread) & (fit.weights.max(axis=0, initial=0.0) > 0))
    length = np.sqrt((fit.normals[:, kept] ** 2).sum(axis=0))
    kept, length = kept[length > _DARK], length[length > _DARK]
    final = fit.weights[:, kept] * length**2
    _, blocks = np.unique(sample.blocks[chosen[kept]], return_inverse=True)
    place, reach = _place(sample, chosen[kept])
    return Evidence(
        chosen=chosen[kept],
        lights=lights,
        values=values[:, kept] / length,
        normals=fit.normals[:, kept] / length,
        model=fit.model[:, kept] / length,
        weights=final / max(float(final.max(initial=0.0)), np.finfo(np.float64).tiny),
        albedo=sample.albedo[chosen[kept]] * length,
        blocks=blocks.reshape(-1),
        place=place,
        reach=reach,
    )


def _weights(values: FloatArray, usable: BoolArray, lights: FloatArray) -> FloatArray:
    """Return robust weights (m, n) of what is lit."""
    if not values.size:
        return np.zeros(values.shape)
    bright = values > 0.1 * np.quantile(values, 0.9, axis=0)
    weights: FloatArray = np.asarray(bright & usable, np.float64)
    for _ in range(_ROUNDS):
        weights = reweighted(values, usable, fit_normals(values, lights, weights))
    return weights


def _place(sample: Sample, chosen: IntArray) -> tuple[FloatArray, float]:
    rows, columns = sample.pixels[chosen].T.astype(np.float64)
    if not len(rows):
        return np.zeros((2, 0)), 1.0
    reach = max(float(np.ptp(rows)), float(np.ptp(columns)), 1.0) / 2
    x = columns - (columns.min() + columns.max()) / 2
    y = (rows.min() + rows.max()) / 2 - rows
    return np.stack([x, y]) / reach, reach


def _roots(lights: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the weights, zero where a pixel has no redundancy, and G (3, 3, n) with G Gᵀ its inverse normal matrix."""
    enough = (weights > 1e-3 * weights.max(axis=0, initial=0.0)).sum(axis=0) > 3
    table = outer_entries(lights.T) @ (weights * enough)
    gram = table[_ENTRIES]
    root = inverse_root(gram)
    # a trace of the inverse far above that of the matrix: nearly singular
    size = (root * root).sum(axis=(0, 1)) * (table[0] + table[3] + table[5])
    fine = enough & (size > 0) & (size < _SINGULAR)
    return weights * fine, root * fine


def _eliminated(lights: FloatArray, weights: FloatArray, root: FloatArray, h: FloatArray) -> FloatArray:
    """Return what is left of h (m, n) when a normal is fitted to it."""
    right = lights.T @ (weights * h)
    inner = (root * right[:, None]).sum(axis=0)
    return np.asarray(h - lights @ (root * inner).sum(axis=1))


def _solved(table: FloatArray) -> Explanation:
    """Solve from the moments of each block, (k + 1, k + 1, b), the last row and column those of the data."""
    count = len(table) - 1
    whole = table.sum(axis=2)
    a, g, rest = whole[:count, :count], whole[:count, count], float(whole[count, count])
    scale = np.sqrt(np.maximum(np.diag(a), np.finfo(np.float64).tiny))
    inverse = np.linalg.pinv(a / scale / scale[:, None], rcond=1e-9, hermitian=True) / scale / scale[:, None]
    size = inverse @ g
    scores = table[:count, count].T - np.einsum("klb,l->bk", table[:count, :count], size)
    number = max(table.shape[2], 2)
    spread = scores.T @ scores * number / (number - 1)
    error = np.sqrt(np.maximum(np.diag(inverse @ spread @ inverse), 0.0))
    own = np.einsum("kkb->bk", table[:count, :count])
    with np.errstate(invalid="ignore", divide="ignore"):
        alone = np.where(own > 0.01 * own.mean(axis=0), table[:count, count].T / own, np.nan)
    share = float(g @ size) / rest if rest > 0 else 0.0
    return Explanation(size=size, error=error, share=share, blocks=alone)
