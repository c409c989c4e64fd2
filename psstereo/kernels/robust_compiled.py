"""Robust regression at every pixel, compiled: the twin of :mod:`psstereo.kernels.robust`, which explains it.

All rounds of a pixel run before the next pixel is looked at, in single precision and within the first-level cache;
loops over lights are branch-free, so that they become vector instructions. Only the last solution is in double
precision. Sixteen pixels are transposed at a time, since a column of a (m, p) block lies in as many cache lines.
"""

import math
from typing import Any

import numpy as np
from numba import njit

from psstereo.kernels.robust_loops_compiled import (
    between,
    count,
    count_used,
    largest,
    mean_and_variance,
    moments,
    moments64,
    normalise,
    quantile,
    residuals,
    round_geman_mcclure,
    round_tukey,
    slopes,
    sort_out,
    spread,
    structure,
    two_quantiles,
    weigh,
)
from psstereo.kernels.robust_settings import (
    CONSISTENCY,
    FEW,
    LOG_CHANCE,
    LOSS_OF_FEW,
    MAD,
    MORE,
    QUARTILE,
    Kind,
    RobustFit,
    Settings,
)
from psstereo.types import Array, FloatArray, IntArray
from psstereo.verdict import Verdict

__all__ = ["robust_fit"]

F = np.float32
_ZERO, _HALF, _ONE, _TWO, _THREE = F(0), F(0.5), F(1), F(2), F(3)
_TOGETHER, _MORE = 16, MORE
_CONSISTENCY = np.array(CONSISTENCY, np.float32)
_MAD, _QUARTILE = F(MAD), F(QUARTILE)
_TUKEY, _TUKEY_TUNING = 4, 4.685
_WHITE, _PILED_UP, _STRUCTURED = Kind.WHITE, Kind.PILED_UP, Kind.STRUCTURED
_PLAIN, _UNSOLVED = Kind.PLAIN, Kind.UNSOLVED
_USED, _SHADOW, _HIGHLIGHT = int(Verdict.USED), int(Verdict.SHADOW), int(Verdict.HIGHLIGHT)
_DARK_OUTLIER, _UNUSABLE, _NOT_NEEDED = int(Verdict.DARK_OUTLIER), int(Verdict.UNUSABLE), int(Verdict.NOT_NEEDED)

_plain: Any = njit(nogil=True, cache=True, error_model="numpy")


@_plain
def _solve(o, x, out):
    """Solve the 3 × 3 system in o, and put x + solution into out; False if it is singular.

    L D Lᵀ instead of Cholesky: three divisions one after the other, and no roots.
    """
    a00, a01, a11, a02, a12, a22 = float(o[0]), float(o[1]), float(o[2]), float(o[3]), float(o[4]), float(o[5])
    tiny = 1e-7 * (a00 + a11 + a22)
    if not a00 > tiny:
        return False
    i0 = 1.0 / a00
    l10, l20 = a01 * i0, a02 * i0
    d1 = a11 - l10 * a01
    if not d1 > tiny:
        return False
    i1, t = 1.0 / d1, a12 - l20 * a01
    l21 = t * i1
    d2 = a22 - l20 * a02 - l21 * t
    if not d2 > tiny:
        return False
    z0 = float(o[6])
    z1 = float(o[7]) - l10 * z0
    z2 = float(o[8]) - l20 * z0 - l21 * z1
    s2 = z2 / d2
    s1 = z1 * i1 - l21 * s2
    s0 = z0 * i0 - l10 * s1 - l20 * s2
    out[0], out[1], out[2] = x[0] + s0, x[1] + s1, x[2] + s2
    return True


@_plain
def _albedo(r_inverse, x):
    """Return the length of the scaled normal."""
    total = 0.0
    for k in range(3):
        b = r_inverse[k, 0] * x[0] + r_inverse[k, 1] * x[1] + r_inverse[k, 2] * x[2]
        total += b * b
    return math.sqrt(total)


@_plain
def _round_any(loss, y, g, q, x, dark, inverse, work, o):
    """One round of any loss, in readable steps."""
    r, size, lit, w = work[0], work[1], work[2], work[3]
    residuals(y, g, q, x, dark, r, size, lit)
    weigh(loss, r, lit, inverse, w)
    moments(y, w, q, o)
    return spread(r, w)[0]


@_plain
def _iterate(loss, tuning, scale, frozen, floor, y, g, q, r_inverse, x, settings, rounds, work, o):
    """Run rounds of one loss from x; return the scale and whether they settled."""
    gate, cut = g, settings.dark
    for k in range(_MORE * rounds):
        if k == rounds:
            # What is lit, or the scale, goes back and forth. With both held each round lowers the loss.
            residuals(y, g, q, x, F(cut * _albedo(r_inverse, x)), work[0], work[1], work[4])
            gate, cut, frozen = work[4], -1e30, True
        dark = F(cut * _albedo(r_inverse, x))
        inverse = _ONE / F(tuning * scale)
        if loss == 3:
            square = round_geman_mcclure(y, gate, q, x, dark, inverse, o)
        elif loss == 4:
            square = round_tukey(y, gate, q, x, dark, inverse, o)
        else:
            square = _round_any(loss, y, gate, q, x, dark, inverse, work, o)
        before0, before1, before2 = x[0], x[1], x[2]
        x[0], x[1], x[2] = 0.0, 0.0, 0.0
        if not _solve(o, x, x):
            x[0], x[1], x[2] = before0, before1, before2
            return scale, False
        if not frozen:
            scale = max(F(math.sqrt(square / _CONSISTENCY[loss])), floor)
        step = (x[0] - before0) ** 2 + (x[1] - before1) ** 2 + (x[2] - before2) ** 2
        if step <= settings.tolerance**2 * (x[0] ** 2 + x[1] ** 2 + x[2] ** 2):
            return scale, True
    return scale, False


@_plain
def _judge(y, g, gate, x, w, lit, r, scale, albedo, q, dark, verdicts, j):
    """Write one verdict an observation."""
    for i in range(len(y)):
        p = q[0, i] * x[0] + q[1, i] * x[1] + q[2, i] * x[2]
        if g[i] == 0:
            verdicts[i, j] = _UNUSABLE
        elif p <= dark * albedo or y[i] <= dark * albedo:
            verdicts[i, j] = _SHADOW
        elif w[i] >= 0.25 * g[i]:
            verdicts[i, j] = _USED
        elif y[i] - p > 3 * scale:
            verdicts[i, j] = _HIGHLIGHT
        elif y[i] - p < -3 * scale:
            verdicts[i, j] = _DARK_OUTLIER
        else:
            verdicts[i, j] = _NOT_NEEDED if gate[i] == 0 else _USED


@_plain
def _fetch(values, weights, j, rows, heavy):
    """Transpose the next pixels."""
    few = min(_TOGETHER, values.shape[1] - j)
    for i in range(values.shape[0]):
        for k in range(few):
            rows[k, i] = values[i, j + k]
    if weights.size:
        for i in range(values.shape[0]):
            for k in range(few):
                heavy[k, i] = weights[i, j + k]


@_plain
def _start(y, g, q, r_inverse, s, given, work, o, gate, x):
    """Fit the middle ranks; return the verdict on the pixel so far, the first scale and its floor."""
    bright, size, lit = work[2], work[1], work[2]
    between(y, g, F(s.dark), _TWO, bright)
    number, mass = count(bright)
    if number < s.least:
        return _PLAIN, _ZERO, _ZERO, _ZERO
    low, high = two_quantiles(y, bright, _ONE, F(s.low) * mass, F(s.high) * mass, 4)
    between(y, bright, low - F(4e-3), high, gate)
    moments(y, gate, q, o)
    x[0], x[1], x[2] = 0.0, 0.0, 0.0
    if not _solve(o, x, x):
        return _UNSOLVED, _ZERO, _ZERO, _ZERO
    floor = F(s.floor) * high
    total, top = residuals(y, g, q, x, F(s.dark * _albedo(r_inverse, x)), work[0], size, lit)
    number, _ = count(lit)
    if number < s.least:
        return _PLAIN, _ZERO, _ZERO, _ZERO
    scale = max(_MAD * quantile(size, lit, top, _HALF * total, 4), floor)
    return _PILED_UP, given if given > 0 else scale, floor, high


@_plain
def _freedom(number):
    """Return by how much residuals of a fit are smaller than the errors, for the freedom that the fit took."""
    return F(math.sqrt(number / max(number - _THREE, _ONE)))


@_plain
def _tell(y, g, q, r_inverse, neighbours, s, floor, high, x, calm, work, o):
    """Return what the residuals are like, and their scale by the median; x is put where noise alone would be."""
    total, top = residuals(y, g, q, x, F(s.dark * _albedo(r_inverse, x)), work[0], work[1], work[2])
    by_median = max(_MAD * quantile(work[1], work[2], top, _HALF * total, 6), floor)
    if not by_median > F(s.small) * high:
        return _WHITE, by_median
    calm[0], calm[1], calm[2] = x[0], x[1], x[2]
    wide = by_median * _freedom(count(work[2])[0])
    _iterate(_TUKEY, _TUKEY_TUNING, wide, True, floor, y, g, q, r_inverse, calm, s, s.rounds, work, o)
    lit, highest = residuals(y, g, q, calm, F(s.dark * _albedo(r_inverse, calm)), work[0], work[1], work[2])
    calm_median = max(_MAD * quantile(work[1], work[2], highest, _HALF * lit, 6), floor) * _freedom(count(work[2])[0])
    moran, within = structure(work[0], work[1], work[2], neighbours, F(4) * calm_median, work[4])
    if not moran > s.structure * math.sqrt(96.0 / max(within, _ONE)):
        x[0], x[1], x[2] = calm[0], calm[1], calm[2]
        return _WHITE, calm_median
    residuals(y, g, q, x, F(s.dark * _albedo(r_inverse, x)), work[0], work[1], work[2])
    by_quartile = _QUARTILE * quantile(work[1], work[2], top, F(0.25) * total, 6)
    return (_STRUCTURED if by_quartile > F(s.piled) * by_median else _PILED_UP), by_median


@_plain
def _middle(y, g, mass, usable, s, gate):
    """Fill the weights of the middle ranks of brightness."""
    width = min(1.0, max(s.width, s.keep / usable))
    start = min(max(0.0, s.middle - width / 2), 1.0 - width)
    low, high = two_quantiles(y, g, _ONE, F(start) * mass, F(start + width) * mass, 6)
    between(y, g, low - F(5e-4), high, gate)


@_plain
def _polish(y64, y, gate, q64, q32, r_inverse, s, loss, inverse, exact, work, o64, x):
    """Solve once more in double precision with the weights as they are now; False if that cannot be done."""
    residuals(y, gate, q32, x, F(s.dark * _albedo(r_inverse, x)), work[0], work[1], work[2])
    weigh(loss, work[0], work[2], inverse, work[3])
    moments64(y64, work[3], q64, x, o64)
    if not _solve(o64, x, x):
        return False
    if exact:
        moments64(y64, work[3], q64, x, o64)
        _solve(o64, x, x)
    return True


@_plain
def _variance(loss, inverse, scale, looked, work):
    """Return the factor that makes the inverse of Σ q qᵀ a covariance, NaN if nothing is left over to tell it by."""
    if not looked > 3:
        return np.nan
    slopes(loss, work[0], inverse, work[1])
    mean, variance = mean_and_variance(work[1], work[2])
    if not mean > 0 or loss == 0:
        return np.pi / 2 * scale**2
    correction = 1 + 3.0 / looked * variance / (mean * mean)
    return correction * correction * spread(work[0], work[3])[1] / (looked - 3) / (mean * mean)


@_plain
def _doubt(y, q, scale, looked, x, calm, work, o):
    """Return the least variance where few observations agree no better than a choice among noise would."""
    lit = work[2]
    agree = 0
    for i in range(len(y)):
        agree += 1 if (lit[i] > 0 and abs(work[0][i]) < F(3) * scale) else 0
    moments(y, lit, q, o)
    calm[0], calm[1], calm[2] = 0.0, 0.0, 0.0
    if not _solve(o, calm, calm):
        calm[0], calm[1], calm[2] = x[0], x[1], x[2]
    total, top = residuals(y, lit, q, calm, F(-1e30), work[0], work[1], work[4])
    wide = float(_MAD * quantile(work[1], work[4], top, _HALF * total, 4)) * math.sqrt(looked / max(looked - 3.0, 1.0))
    n, k = float(looked), float(max(agree, 3))
    share = min(1.0, 2.4 * scale / max(wide, 1e-30))
    choices = math.log(max(n - 3, 1.0)) + math.lgamma(n + 1) - math.lgamma(n - k + 1) - math.lgamma(4.0)
    if choices - math.lgamma(k - 2) + (k - 3) * math.log(share) > LOG_CHANCE:
        return (1 + LOSS_OF_FEW / n * (1 - min(1.0, scale / max(wide, 1e-30)))) * wide**2
    return 0.0


@_plain
def _pixels(values, weights, q64, q32, r_inverse, neighbours, s, exact, x_out, matrix, facts, counts, verdicts):
    m, pixels = values.shape
    rows, heavy = np.zeros((_TOGETHER, m), values.dtype), np.ones((_TOGETHER, m))
    y, y64, g64 = np.zeros(m, np.float32), np.zeros(m), np.zeros(m)
    g, gate, work = np.zeros(m, np.float32), np.zeros(m, np.float32), np.zeros((5, m), np.float32)
    o, o64, x, calm = np.zeros(9, np.float32), np.zeros(9), np.zeros(3), np.zeros(3)
    adaptive, frozen = s.loss == 6, s.scale > 0
    first, first_tuning = (3, 1.0) if adaptive else (s.loss, s.tuning)
    for j in range(pixels):
        if j % _TOGETHER == 0:
            _fetch(values, weights, j, rows, heavy)
        usable = sort_out(rows[j % _TOGETHER], heavy[j % _TOGETHER], y64, g64)
        brightest = largest(y64)
        counts[0, j], counts[1, j], counts[2, j], counts[3, j] = 0, 0, _UNSOLVED, usable
        facts[0, j], facts[1, j] = np.nan, np.nan
        x_out[j, 0], x_out[j, 1], x_out[j, 2] = np.nan, np.nan, np.nan
        if verdicts.size:
            for i in range(m):
                verdicts[i, j] = _UNUSABLE if g64[i] == 0 else _USED
        if usable < 3 or not brightest > 0:
            continue
        mass = normalise(y64, g64, brightest, largest(g64), y, g)
        given = F(s.scale / brightest)
        kind, scale, floor, high = _start(y, g, q32, r_inverse, s, given, work, o, gate, x)
        if kind != _PILED_UP:
            counts[2, j] = kind
            continue
        for i in range(m):
            gate[i] = g[i]
        loss, tuning = first, first_tuning
        scale, settled = _iterate(loss, tuning, scale, frozen, floor, y, g, q32, r_inverse, x, s, s.rounds, work, o)
        if adaptive:
            kind, by_median = _tell(y, g, q32, r_inverse, neighbours, s, floor, high, x, calm, work, o)
            again = kind != _PILED_UP
            if kind == _WHITE:
                loss, tuning, scale = _TUKEY, _TUKEY_TUNING, given if frozen else by_median
            elif kind == _STRUCTURED:
                _middle(y, g, mass, usable, s, gate)
                scale = by_median
            if again:
                keep = frozen or kind == _WHITE
                scale, settled = _iterate(
                    loss, tuning, scale, keep, floor, y, gate, q32, r_inverse, x, s, s.rounds, work, o
                )
        inverse = _ONE / F(tuning * scale)
        if not settled or not _polish(y64, y, gate, q64, q32, r_inverse, s, loss, inverse, exact, work, o64, x):
            continue
        moments(y, work[2], q32, o)
        for k in range(6):
            matrix[j, k] = o[k]
        looked, used = count_used(work[2], work[3])
        if verdicts.size:
            _judge(y, g, gate, x, work[3], work[2], work[0], scale, _albedo(r_inverse, x), q64, s.dark, verdicts, j)
        variance = _variance(loss, inverse, scale, looked, work)
        if 3 < looked < FEW:
            variance = max(variance, _doubt(y, q32, scale, looked, x, calm, work, o))
        facts[0, j] = variance * brightest * brightest
        facts[1, j] = scale * brightest
        counts[0, j], counts[1, j], counts[2, j] = int(used), int(looked), kind if adaptive else _WHITE
        for k in range(3):
            x_out[j, k] = x[k] * brightest


def robust_fit(
    values: FloatArray,
    weights: FloatArray | None,
    q: FloatArray,
    r_inverse: FloatArray,
    neighbours: IntArray,
    settings: Settings,
    verdicts: bool,
) -> RobustFit:
    """Solve some pixels; see :func:`psstereo.kernels.robust.robust_fit`."""
    values = np.ascontiguousarray(values)  # one layout, so that there are fewer kinds to compile
    m, p = values.shape
    x, matrix, facts = np.zeros((p, 3)), np.zeros((p, 6)), np.zeros((2, p))
    counts = np.zeros((4, p), np.int64)
    judged: Array = np.zeros((m, p) if verdicts else (0, 0), np.uint8)
    heavy = np.zeros((0, 0)) if weights is None else np.ascontiguousarray(weights, np.float64)
    rows = np.ascontiguousarray(q.T)
    fine = values.dtype == np.float64  # then a second step of correction is worth its while
    single = rows.astype(np.float32)
    _pixels(values, heavy, rows, single, r_inverse, neighbours, settings, fine, x, matrix, facts, counts, judged)
    return RobustFit(x, matrix, facts[0], facts[1], counts[0], counts[1], counts[3], counts[2], judged)
