"""Shifts between images, from what a matte surface leaves unexplained.

An image that is shifted by s differs from its place by −s · ∇I. Shading changes from light to light, so images cannot
be laid over each other; but the fit to all images says what each should show, and so its gradient. The normals are
unknown as well: they are eliminated pixel by pixel, and what is left are equations for all shifts at once. A shift of
all images together changes nothing and is set to zero.
"""

from dataclasses import dataclass

import numpy as np

from psstereo.normals.low_rank_fit import LowRankFit, fit_normals, reweighted
from psstereo.normals.strength_steps import inverse_root
from psstereo.plan.sample import Sample
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Shifts", "shifts_from_residuals"]

_MOST = 60_000
_LEAST = 100
"""Pixels with four neighbours below which nothing is said."""
_ROUNDS = 2
_STEPS = 4
_NOTHING = 0.02
"""Share of the squared residual up to which shifts explain nothing, so that their error is not worth the time."""
_WEAK = 1e-3
"""Eigenvalues of the equations below this share of the largest are left out."""


@dataclass(frozen=True, eq=False)
class Shifts:
    """Where the content of each image lies against the mean of all.

    Attributes
    ----------
    size : float64 array (m, 2)
        To the right and up [px].
    error : float
        Root-mean-square error of a shift's two parts together, by what halves of the blocks disagree about;
        infinite if the shifts explain nothing [px].
    share : float
        Share of the squared residual that shifts explain [1].
    """

    size: FloatArray
    error: float
    share: float

    @property
    def rms(self) -> float:
        """Root-mean-square length of the shifts, the error taken off [px]."""
        square = float((self.size**2).sum(axis=1).mean()) - self.error**2
        return float(np.sqrt(max(square, 0.0)))


def shifts_from_residuals(sample: Sample) -> Shifts | None:
    """Estimate shifts of a fraction of a pixel to about two pixels.

    Parameters
    ----------
    sample : Sample
        Blocks of pixels under five lights or more.

    Returns
    -------
    Shifts or None
        None if there are too few lights or neighbours.
    """
    count = len(sample.directions)
    right, left, down, up = _around(sample)
    inner = np.flatnonzero((right >= 0) & (left >= 0) & (down >= 0) & (up >= 0) & np.isfinite(sample.albedo))
    if count < 5 or len(inner) < _LEAST:
        return None
    step = max(-(-len(inner) * count // _MOST), 1)
    inner = inner[::step]
    scaled = (sample.normals * sample.albedo[:, None]).T
    along_x = (scaled[:, right[inner]] - scaled[:, left[inner]]) / 2
    along_y = (scaled[:, up[inner]] - scaled[:, down[inner]]) / 2
    gradient = np.stack([sample.directions @ along_x, sample.directions @ along_y])
    values = sample.values[:, inner]
    usable = np.isfinite(values) & np.isfinite(gradient).all(axis=0)
    values, gradient = np.where(usable, values, 0.0), np.where(usable, gradient, 0.0)
    whole = _settle(values, usable, gradient, sample.directions)
    if whole is None or whole[1] <= _NOTHING:
        return None if whole is None else Shifts(size=whole[0], error=float("inf"), share=whole[1])
    half = sample.blocks[inner] % 2 == 0
    halves = [_settle(values[:, k], usable[:, k], gradient[:, :, k], sample.directions) for k in (half, ~half)]
    if halves[0] is None or halves[1] is None:
        return None
    error = float(np.sqrt(((halves[0][0] - halves[1][0]) ** 2).sum(axis=1).mean()) / 2)
    return Shifts(size=whole[0], error=error, share=whole[1])


def _settle(
    values: FloatArray, usable: BoolArray, gradient: FloatArray, lights: FloatArray
) -> tuple[FloatArray, float] | None:
    """Return shifts (m, 2) and the share of the residual that they explain."""
    size = np.zeros((len(lights), 2))
    first = fit = _fit(values, usable, lights)
    for _ in range(_STEPS):
        moved = values + np.einsum("ma,amp->mp", size, gradient)
        fit = fit_normals(moved, lights, reweighted(moved, usable, fit))
        step = _solve(moved, gradient, fit, lights)
        if step is None:
            return None
        size = size + step
    moved = values + np.einsum("ma,amp->mp", size, gradient)
    before, after = (np.abs(v - fit_normals(v, lights, first.weights).model) for v in (values, moved))
    total = float((first.weights * before**2).sum())
    if not total > 0:
        return None
    return size - size.mean(axis=0), 1 - float((first.weights * after**2).sum()) / total


def _around(sample: Sample) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Return the numbers of the pixels to the right, left, below and above, −1 where there is none."""
    sides = []
    for one in sample.neighbours.T:
        back = np.full(len(sample), -1, np.int64)
        has = np.flatnonzero(one >= 0)
        back[one[has]] = has
        sides += [one, back]
    right, left, down, up = sides
    return right, left, down, up


def _fit(values: FloatArray, usable: BoolArray, lights: FloatArray) -> LowRankFit:
    top = values.max(axis=0)
    fit = fit_normals(values, lights, np.asarray(usable & (values > 0.1 * top), np.float64))
    for _ in range(_ROUNDS):
        fit = fit_normals(values, lights, reweighted(values, usable, fit))
    return fit


def _solve(values: FloatArray, gradient: FloatArray, fit: LowRankFit, lights: FloatArray) -> FloatArray | None:
    """Return one step of the shifts, (m, 2)."""
    count = len(lights)
    pattern = -fit.weights * gradient  # (2, m, n)
    root = inverse_root(fit.gram)
    matrix = np.zeros((2, count, 2, count))
    for a in range(2):
        for b in range(2):
            matrix[a, :, b, :] = np.diag((-pattern[a] * gradient[b]).sum(axis=1))
    flat = np.zeros((2 * count, 3, values.shape[1]))
    for j in range(3):
        flat[:, j] = (pattern * (lights @ root[:, j])).reshape(2 * count, -1)
    rows = flat.reshape(2 * count, -1)
    system = matrix.reshape(2 * count, 2 * count) - rows @ rows.T
    right = (pattern * (values - fit.model)).sum(axis=2).reshape(-1)
    found, vectors = np.linalg.eigh(system)
    if not found[-1] > 0:
        return None
    kept = found > _WEAK * found[-1]
    step = vectors[:, kept] @ ((vectors[:, kept].T @ right) / found[kept])
    return np.asarray(step.reshape(2, count).T)
