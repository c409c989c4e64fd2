"""Fits with a bent response at every pixel: the readable reference.

A surface whose brightness is any rising function of the cosine n·l, plus ambient light, obeys

``n'·l = x + Σ_k c_k φ_k(x) + c_0``

with x the brightness over the pixel's `top` quantile, n' a multiple of the normal and φ_k tents, which rise from 0 at
x = 0 to 1 at the knot k / `segments` and fall to 0 at x = 1, and go on as they are beyond. It is linear in the normal,
the bend c_k and the offset c_0. Bend and offset are tied to zero, ``Σ w (tie Σ_k c_k² + offset_tie c_0²)``: an infinite
tie is Lambert's law, and a small one lets the data speak. The steps are these.

1. **Start.** Least squares over the observations that are not dark, with a rank of brightness from `low` to `high`.
2. **Lambert.** Rounds of reweighted least squares with the loss of Geman and McClure. The scale is the median of the
   lit residuals, for the first `freeze` rounds; then it stays.
3. **Structure.** Moran's statistic [1]_ of the residuals, between neighbouring lights on the dome. Noise gives about 0;
   what Lambert's law cannot explain varies smoothly over the dome and gives more. Up to `white` nothing more is done,
   from `white` + `ramp` on the bend takes over, and in between the two are mixed (`share`). Chance moves the statistic
   the more the fewer observations there are, so `white` grows with one over the square root of their number.
4. **Bend.** The same rounds with all unknowns.
5. **Spread.** The matrix of the normal's error with all other unknowns eliminated, and the variance by the influence
   of the residuals [2]_.

References
----------
.. [1] P. A. P. Moran, "Notes on continuous stochastic phenomena", Biometrika 37, 17-23, 1950. doi:10.2307/2332142
.. [2] P. J. Huber, E. M. Ronchetti, "Robust Statistics", 2nd ed., Wiley, 2009. doi:10.1002/9780470434697
"""

from typing import NamedTuple

import numpy as np

from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["BISECTIONS", "MAD", "REFERENCE", "TOO_FEW_BRIGHT", "BendFit", "Settings", "design", "response_bend"]

MAD = 1.4826022185056018
"""Standard deviation over the median of the absolute value, of Gaussian noise [1]."""
REFERENCE = 96.0
"""Observations for which the limit of noise is stated [1]."""
BISECTIONS = 12
"""Steps in which quantiles are found [1]."""
_PART = 256
"""Pixels fitted side by side: their designs, a row for each unknown and light, stay small."""
TOO_FEW_BRIGHT = 1e-3
"""Top quantile over largest brightness below which hardly any light reaches a pixel [1]."""


class Settings(NamedTuple):
    """Numbers of a bent fit; a plain tuple, so that compiled code takes it as it is."""

    segments: int
    tie: float
    offset_tie: float
    level: float  # brightness, as a share of the pixel's top, up to which it counts as shadow; very negative for none
    dark: float  # cosine up to which a light counts as grazing; very negative for none
    white: float  # Moran's statistic up to which residuals are noise, with `REFERENCE` lit observations
    ramp: float  # how much more of it gives the bend all
    top: float = 0.95
    low: float = 0.2
    high: float = 0.8
    floor: float = 1e-3  # of the scale, as a share of the top
    first_rounds: int = 6  # of the fit by Lambert's law, from which structure is told
    rounds: int = 16
    freeze: int = 3
    tolerance: float = 3e-4  # step of the normal at which rounds stop [rad]
    settled: float = 2e-3  # last step up to which a fit counts as converged [rad]
    least: int = 6  # lit observations from which a robust step is taken


class BendFit(NamedTuple):
    """What was found at some pixels; NaN and zero where the bend has no share.

    Attributes
    ----------
    solution : float64 array (p, segments + 3)
        The bend at the knots, the offset, and the scaled normal in the basis of Q, all over `top`.
    matrix : float64 array (p, 6)
        Inverse of the normal's covariance but for the factor `variance`, with bend and offset unknown; entries 11, 12,
        22, 13, 23, 33, for the solution.
    variance : float64 array (p,)
        Variance of a residual as far as it moves the solution; NaN where it cannot be told.
    share : float64 array (p,)
        The bend's share in the answer, 0 … 1.
    scale : float64 array (p,)
        Standard deviation of the residuals that are not outliers.
    top : float64 array (p,)
        Brightness that was taken for one.
    used : int64 array (p,)
        Observations with at least a quarter of their full weight.
    lit : int64 array (p,)
        Observations that are neither dark nor grazing.
    converged : bool array (p,)
        Whether the last round moved the normal by next to nothing.
    """

    solution: FloatArray
    matrix: FloatArray
    variance: FloatArray
    share: FloatArray
    scale: FloatArray
    top: FloatArray
    used: IntArray
    lit: IntArray
    converged: BoolArray


def response_bend(
    values: FloatArray,
    weights: FloatArray | None,
    q: FloatArray,
    r_inverse: FloatArray,
    pairs: IntArray,
    settings: Settings,
) -> BendFit:
    """Fit a bent response to every pixel whose residuals from Lambert's law have structure.

    Parameters
    ----------
    values : float array (m, p)
        Brightness; NaN where an observation is not usable.
    weights : float array (m, p) or None
        Weights of the observations, inverse variances up to a factor a pixel [1].
    q : float64 array (m, 3)
        Orthonormal factor of the light matrix.
    r_inverse : float64 array (3, 3)
        Inverse of the other factor.
    pairs : int array (k, 2)
        Lights whose residuals are compared, each neighbour in its turn.
    settings : Settings
        Numbers of the fit.

    Returns
    -------
    BendFit
        What was found.
    """
    parts = [slice(start, start + _PART) for start in range(0, max(values.shape[1], 1), _PART)]
    fits = [
        _part(values[:, part], None if weights is None else weights[:, part], q, r_inverse, pairs, settings)
        for part in parts
    ]
    return BendFit(*(np.concatenate(fields) for fields in zip(*fits, strict=True)))


def _part(
    values: FloatArray,
    weights: FloatArray | None,
    q: FloatArray,
    r_inverse: FloatArray,
    pairs: IntArray,
    s: Settings,
) -> BendFit:
    """Go through the steps of the module's description for a few pixels side by side; arrays are (p, m) from here."""
    answer = _nothing(values.shape[1], s.segments + 3)
    y, g, w, top = _prepare(values.T, None if weights is None else weights.T, s)
    lambert = np.broadcast_to(q.T, (len(y), *q.T.shape))
    first = _iterate(lambert, np.zeros(3), y, g, w, np.zeros((len(y), 3)), r_inverse, s, s.first_rounds, s.least)
    white = s.white * np.sqrt(REFERENCE / np.maximum(first.lit.sum(axis=1), 1))
    share = np.clip((_structure(first, g, pairs) - white) / s.ramp, 0.0, 1.0)
    chosen = np.flatnonzero((top > 0) & first.sound & (share > 0))
    if len(chosen) == 0:
        return answer
    y, g, share = y[chosen], g[chosen], share[chosen]
    columns = design(y, q, s.segments)
    ridge = np.full(s.segments + 3, s.tie)
    ridge[s.segments - 1], ridge[s.segments :] = s.offset_tie, 0.0
    start = np.zeros((len(chosen), s.segments + 3))
    start[:, s.segments :] = first.solution[chosen]
    bent = _iterate(columns, ridge, y, g, first.w[chosen], start, r_inverse, s, s.rounds, s.segments + 6)
    matrix, variance, used = _spread(columns, ridge, g, bent)
    done = bent.sound
    at = chosen[done]
    answer.solution[at], answer.matrix[at] = bent.solution[done], matrix[done]
    answer.variance[at], answer.share[at] = variance[done], (share * share * (3.0 - 2.0 * share))[done]
    answer.scale[at], answer.top[at] = bent.scale[done], top[at]
    answer.used[at], answer.lit[at] = used[done], bent.lit.sum(axis=1)[done]
    answer.converged[at] = bent.step[done] <= s.settled
    return answer


def design(y: FloatArray, q: FloatArray, segments: int) -> FloatArray:
    """Return the columns that multiply the unknowns: tents, one, and the lights; all but the last stand on the left.

    Parameters
    ----------
    y : float64 array (p, m)
        Brightness, with the top quantile for one [1].
    q : float64 array (m, 3)
        Orthonormal factor of the light matrix.
    segments : int
        Pieces of the bend.

    Returns
    -------
    float64 array (p, segments + 3, m)
        ``−φ_k(y)``, −1, and q.
    """
    columns = np.full((len(y), segments + 3, len(q)), -1.0)
    for k in range(1, segments):
        knot = k / segments
        columns[:, k - 1] = -np.minimum(y / knot, (1.0 - y) / (1.0 - knot))
    columns[:, segments:] = q.T
    return columns


class _Fit(NamedTuple):
    solution: FloatArray  # (p, C)
    r: FloatArray  # (p, m)
    w: FloatArray
    lit: BoolArray
    scale: FloatArray  # (p,)
    step: FloatArray
    sound: BoolArray


def _nothing(pixels: int, unknowns: int) -> BendFit:
    def nan(*shape: int) -> FloatArray:
        return np.full((pixels, *shape), np.nan)

    zero = np.zeros(pixels, np.int64)
    unset = np.zeros(pixels, np.bool_)
    return BendFit(nan(unknowns), nan(6), nan(), np.zeros(pixels), nan(), nan(), zero, zero.copy(), unset)


def _quantile(a: FloatArray, keep: BoolArray, rank: FloatArray, top: FloatArray) -> FloatArray:
    """Return the value of a rank among the numbers of each pixel that are kept, by bisection on 0 … top, from above."""
    low, high = np.zeros_like(top), top.copy()
    kept = np.where(keep, a, np.inf)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        enough = np.count_nonzero(kept <= middle[:, None], axis=1) > rank
        high, low = np.where(enough, middle, high), np.where(enough, low, middle)
    return high


def _prepare(
    values: FloatArray, weights: FloatArray | None, s: Settings
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return brightness, gates, first weights, and the brightness taken for one, 0 where a pixel is left alone."""
    given = np.ones(values.shape) if weights is None else np.asarray(weights, np.float64)
    ok = np.isfinite(values) & (given > 0)
    y, g = np.where(ok, values, 0.0).astype(np.float64), np.where(ok, given, 0.0)
    usable, mass, largest = ok.sum(axis=1), g.sum(axis=1), y.max(axis=1)
    left = (usable >= s.least) & (largest > 0)
    top = _quantile(y, ok, np.floor(s.top * (usable - 1) + 0.5), largest)
    left &= top >= TOO_FEW_BRIGHT * largest
    top = np.where(left, top, 1.0)
    y /= top[:, None]
    g = np.where(y > s.level, g * (usable / np.where(left, mass, 1.0))[:, None], 0.0)
    keep = g > 0
    n = keep.sum(axis=1)
    left &= n >= s.least
    low, high = (_quantile(y, keep, np.floor(share * (n - 1) + 0.5), largest / top) for share in (s.low, s.high))
    first = np.where((y >= low[:, None]) & (y <= high[:, None]), g, 0.0)
    return y, g, first, np.where(left, top, 0.0)


def _factor(a: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return lower triangular factors of matrices (p, C, C), and where no pivot is negligible."""
    factor, sound = np.zeros_like(a), np.ones(len(a), np.bool_)
    for j in range(a.shape[1]):
        row = factor[:, j, :j]
        pivot = a[:, j, j] - (row * row).sum(axis=1)
        sound &= pivot > 1e-10 * a[:, j, j]
        factor[:, j, j] = np.sqrt(np.where(sound, pivot, 1.0))
        rest = a[:, j + 1 :, j] - (factor[:, j + 1 :, :j] * row[:, None]).sum(axis=2)
        factor[:, j + 1 :, j] = np.where(sound[:, None], rest / factor[:, j, j, None], 0.0)
    return factor, sound


def _solve(factor: FloatArray, b: FloatArray) -> FloatArray:
    """Return x, (p, C), with G Gᵀ x = b."""
    x = b.copy()
    size = b.shape[1]
    for i in range(size):
        x[:, i] = (x[:, i] - (factor[:, i, :i] * x[:, :i]).sum(axis=1)) / factor[:, i, i]
    for i in reversed(range(size)):
        x[:, i] = (x[:, i] - (factor[:, i + 1 :, i] * x[:, i + 1 :]).sum(axis=1)) / factor[:, i, i]
    return x


def _normal_matrix(weighted: FloatArray, columns: FloatArray, mass: FloatArray, ridge: FloatArray) -> FloatArray:
    """Return ``Σ w d dᵀ`` with the ties on its diagonal, (p, C, C)."""
    return np.asarray(weighted @ columns.transpose(0, 2, 1) + np.eye(len(ridge)) * (mass[:, None] * ridge)[:, None])


def _explained(columns: FloatArray, solution: FloatArray) -> FloatArray:
    return np.asarray((solution[:, None] @ columns)[:, 0])


def _iterate(
    columns: FloatArray,
    ridge: FloatArray,
    y: FloatArray,
    g: FloatArray,
    w: FloatArray,
    solution: FloatArray,
    r_inverse: FloatArray,
    s: Settings,
    rounds: int,
    least: int,
) -> _Fit:
    """Run rounds from the weights w; pixels that have arrived or failed are not looked at again."""
    pixels = len(y)
    fit = _Fit(
        solution=solution.copy(),
        r=y - _explained(columns, solution),
        w=w.copy(),
        lit=g > 0,
        scale=np.full(pixels, s.floor),
        step=np.ones(pixels),
        sound=np.ones(pixels, np.bool_),
    )
    going = np.arange(pixels)
    for k in range(rounds):
        c, now, gate, weight = columns[going], fit.solution[going], g[going], fit.w[going]
        mass, weighted = weight.sum(axis=1), c * weight[:, None]
        rhs = (weighted @ fit.r[going][..., None])[..., 0] - mass[:, None] * ridge * now
        factor, regular = _factor(_normal_matrix(weighted, c, mass, ridge))
        change = np.where(regular[:, None], _solve(factor, rhs), 0.0)
        now += change
        size = np.linalg.norm(now[:, -3:], axis=1)
        sound = regular & (size > 0)
        step = np.linalg.norm(change[:, -3:], axis=1) / np.where(size > 0, size, 1.0)
        r = y[going] - _explained(c, now)
        dark = s.dark * np.linalg.norm(now[:, -3:] @ r_inverse.T, axis=1)
        lit = (gate > 0) & (_explained(c[:, -3:], now[:, -3:]) > dark[:, None])
        if k < s.freeze:
            fit.scale[going] = _median_scale(r, gate, lit, s.floor)
            sound &= lit.sum(axis=1) >= least
        excess = r * r * gate / (fit.scale[going] ** 2)[:, None]
        fit.w[going] = np.where(lit, gate, 0.0) / (1.0 + excess) ** 2
        fit.solution[going], fit.r[going], fit.lit[going] = now, r, lit
        fit.step[going], fit.sound[going] = step, sound
        going = going[sound & (step > s.tolerance)]
        if len(going) == 0:
            break
    return fit


def _median_scale(r: FloatArray, g: FloatArray, lit: BoolArray, floor: float) -> FloatArray:
    sizes = np.where(lit, np.abs(r) * np.sqrt(g), 0.0)
    rank = np.floor(0.5 * (lit.sum(axis=1) - 1) + 0.5)
    return np.asarray(np.maximum(MAD * _quantile(sizes, lit, rank, sizes.max(axis=1)), floor))


def _structure(fit: _Fit, g: FloatArray, pairs: IntArray) -> FloatArray:
    """Return Moran's statistic of the lit residuals, cut at three scales; 0 if there is nothing left to explain."""
    e = np.where(fit.lit, np.clip(fit.r * np.sqrt(g) / fit.scale[:, None], -3.0, 3.0), 0.0)
    i, j = pairs.T
    count = (fit.lit[:, i] & fit.lit[:, j]).sum(axis=1)
    n = np.maximum(fit.lit.sum(axis=1), 1)
    square = (e * e).sum(axis=1) / n
    told = (count > 0) & (square > 1e-12)
    product = (e[:, i] * e[:, j]).sum(axis=1) / np.maximum(count, 1)
    return np.where(told, product / np.where(told, square, 1.0), 0.0)


def _spread(
    columns: FloatArray, ridge: FloatArray, g: FloatArray, fit: _Fit
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return matrix and variance of the normal's error with all else unknown, and the observations used."""
    v = fit.r * fit.r * g / (fit.scale * fit.scale)[:, None]
    u = np.where(fit.lit, 1.0 / (1.0 + v), 0.0)
    influence = (fit.r * fit.r * g * u**4).sum(axis=1)
    slope = ((1.0 - 3.0 * v) * u**3).sum(axis=1)
    w = np.where(fit.lit, g, 0.0)
    factor, regular = _factor(_normal_matrix(columns * w[:, None], columns, w.sum(axis=1), ridge))
    corner = factor[:, -3:, -3:]  # with the other unknowns first, what is left of the normal's own matrix
    matrix = corner @ corner.transpose(0, 2, 1)
    lit, size = fit.lit.sum(axis=1), columns.shape[1]
    told = regular & (lit > size) & (slope > 0)
    spare, rate = np.where(told, lit - size, 1), np.where(told, slope / np.maximum(lit, 1), 1.0)
    variance = np.where(told, influence / spare / (rate * rate), np.nan)
    entries = np.stack([matrix[:, i, j] for i in range(3) for j in range(i + 1)], axis=1)
    return np.where(told[:, None], entries, np.nan), variance, (u >= 0.5).sum(axis=1)
