"""Fits with a bent response at every pixel, compiled: the twin of :mod:`psstereo.kernels.response_bend`.

All rounds of a pixel run before the next pixel is looked at, within the first-level cache; loops over lights are
branch-free, so that they become vector instructions. Sixteen pixels are transposed at a time, since a column of a
(m, p) block lies in as many cache lines.
"""

import math
from typing import Any

import numpy as np
from numba import njit

from psstereo.kernels.response_bend import BISECTIONS, MAD, REFERENCE, TOO_FEW_BRIGHT, BendFit, Settings
from psstereo.types import FloatArray, IntArray

__all__ = ["response_bend"]

_TOGETHER = 16
_ABOVE = 1e300  # more than any number here, and not infinite
_BISECTIONS, _MAD, _REFERENCE, _TOO_FEW_BRIGHT = BISECTIONS, MAD, REFERENCE, TOO_FEW_BRIGHT

# Nothing in these loops is NaN or infinite (that is sorted out before), and sums may be taken in any fixed order.
_loop: Any = njit(
    nogil=True, cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz", "arcp", "contract", "reassoc"}
)
_plain: Any = njit(nogil=True, cache=True, error_model="numpy")


@_loop
def _quantile(a, rank, top):
    """Return the value of a rank by bisection on 0 … top, from above; what is not to count is `_ABOVE`."""
    low, high = 0.0, top
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        below = 0.0
        for i in range(len(a)):
            below += 1.0 if a[i] <= middle else 0.0
        if below > rank:
            high = middle
        else:
            low = middle
    return high


@_loop
def _kept(a, keep, out):
    """Fill a copy for quantiles, without what is not kept."""
    for i in range(len(a)):
        out[i] = a[i] if keep[i] > 0.0 else _ABOVE


@_loop
def _normal_equations(columns, w, r, weighted, a, b):
    """Fill the lower triangle of Σ w d dᵀ, and Σ w d r; return Σ w. Three sums at a time share what they read."""
    count, m = columns.shape
    mass = 0.0
    for k in range(count):
        total = 0.0
        for i in range(m):
            v = w[i] * columns[k, i]
            weighted[i] = v
            total += v * r[i]
        b[k] = total
        j = k
        while j + 2 < count:
            s0, s1, s2 = 0.0, 0.0, 0.0
            for i in range(m):
                v = weighted[i]
                s0 += v * columns[j, i]
                s1 += v * columns[j + 1, i]
                s2 += v * columns[j + 2, i]
            a[j, k], a[j + 1, k], a[j + 2, k] = s0, s1, s2
            j += 3
        while j < count:
            total = 0.0
            for i in range(m):
                total += weighted[i] * columns[j, i]
            a[j, k] = total
            j += 1
    for i in range(m):
        mass += w[i]
    return mass


@_loop
def _residuals(columns, y, solution, r, front):
    """Fill the residuals, and the cosine part of the prediction."""
    extra = columns.shape[0] - 3
    x0, x1, x2 = solution[extra], solution[extra + 1], solution[extra + 2]
    for i in range(len(y)):
        p = columns[extra, i] * x0 + columns[extra + 1, i] * x1 + columns[extra + 2, i] * x2
        front[i] = p
        r[i] = y[i] - p
    for k in range(extra):
        c = solution[k]
        for i in range(len(y)):
            r[i] -= c * columns[k, i]


@_loop
def _weigh(r, g, front, dark, inverse, w):
    """Fill Geman–McClure weights of the lit observations; `inverse` is one over the squared scale."""
    for i in range(len(r)):
        v = 1.0 + r[i] * r[i] * g[i] * inverse
        w[i] = (g[i] if front[i] > dark else 0.0) / (v * v)


@_plain
def _factor(a, size):
    """Cholesky in place, lower triangle; False if a pivot is negligible against its diagonal entry."""
    for j in range(size):
        whole = a[j, j]
        d = whole
        for k in range(j):
            d -= a[j, k] * a[j, k]
        if not d > 1e-10 * whole:
            return False
        d = math.sqrt(d)
        a[j, j] = d
        for i in range(j + 1, size):
            v = a[i, j]
            for k in range(j):
                v -= a[i, k] * a[j, k]
            a[i, j] = v / d
    return True


@_plain
def _solve(a, b, size):
    """Solve with a factor, in place."""
    for i in range(size):
        v = b[i]
        for k in range(i):
            v -= a[i, k] * b[k]
        b[i] = v / a[i, i]
    for i in range(size - 1, -1, -1):
        v = b[i]
        for k in range(i + 1, size):
            v -= a[k, i] * b[k]
        b[i] = v / a[i, i]


@_plain
def _length(r_inverse, x):
    total = 0.0
    for k in range(3):
        b = r_inverse[k, 0] * x[0] + r_inverse[k, 1] * x[1] + r_inverse[k, 2] * x[2]
        total += b * b
    return math.sqrt(total)


@_plain
def _step(columns, ridge, work, solution, a, b):
    """Move the solution to the minimum for the weights; return how far the normal went, -1 if singular."""
    size = len(solution)
    mass = _normal_equations(columns, work[0], work[1], work[4], a, b)
    for k in range(size - 3):
        a[k, k] += ridge[k] * mass
        b[k] -= ridge[k] * mass * solution[k]
    if not _factor(a, size):
        return -1.0
    _solve(a, b, size)
    moved, total = 0.0, 0.0
    for k in range(size):
        solution[k] += b[k]
        if k >= size - 3:
            moved += b[k] * b[k]
            total += solution[k] * solution[k]
    return math.sqrt(moved / total) if total > 0 else -1.0


@_loop
def _lit_sizes(g, work, dark):
    """Fill work[3] with the sizes of the lit residuals; return their number and the largest."""
    r, front, sizes, count, largest = work[1], work[2], work[3], 0.0, 0.0
    for i in range(len(r)):
        lit = (1.0 if g[i] > 0.0 else 0.0) * (1.0 if front[i] > dark else 0.0)
        size = abs(r[i]) * math.sqrt(g[i])
        sizes[i] = size if lit > 0.0 else _ABOVE
        count += lit
        largest = max(largest, size * lit)
    return count, largest


@_plain
def _median_scale(g, work, dark, floor):
    """Return the scale of the lit residuals, and their number."""
    count, largest = _lit_sizes(g, work, dark)
    if _MAD * largest <= floor:
        return floor, int(count)
    return max(_MAD * _quantile(work[3], int(0.5 * (count - 1) + 0.5), largest), floor), int(count)


@_plain
def _iterate(columns, ridge, y, g, r_inverse, s, rounds, least, solution, work, a, b):
    """Run rounds from the weights in work[0]; return scale, level of shadow, lit observations and the last step."""
    extra = len(solution) - 3
    scale, dark, lit, step = s.floor, 0.0, 0, 1.0
    _residuals(columns, y, solution, work[1], work[2])
    for k in range(rounds):
        step = _step(columns, ridge, work, solution, a, b)
        if step < 0:
            return scale, dark, 0, step
        _residuals(columns, y, solution, work[1], work[2])
        dark = s.dark * _length(r_inverse, solution[extra:])
        if k < s.freeze:
            scale, lit = _median_scale(g, work, dark, s.floor)
            if lit < least:
                return scale, dark, 0, step
        _weigh(work[1], g, work[2], dark, 1.0 / (scale * scale), work[0])
        if step <= s.tolerance:
            break
    return scale, dark, lit, step


@_plain
def _structure(g, work, dark, scale, pairs):
    """Return Moran's statistic of the lit residuals, cut at three scales, and their number; 0 if nothing is left."""
    r, front, clipped = work[1], work[2], work[3]
    square, n = 0.0, 0
    for i in range(len(r)):
        clipped[i] = 0.0
        if g[i] > 0 and front[i] > dark:
            e = min(3.0, max(-3.0, r[i] * math.sqrt(g[i]) / scale))
            clipped[i] = e
            square += e * e
            n += 1
    product, count = 0.0, 0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        if g[i] > 0 and g[j] > 0 and front[i] > dark and front[j] > dark:
            product += clipped[i] * clipped[j]
            count += 1
    if count == 0 or not square > 1e-12 * n:
        return 0.0, max(n, 1)
    return product / count / (square / n), max(n, 1)


@_plain
def _prepare(row, weight, s, y, g, work):
    """Fill brightness, gates and first weights; return the brightness taken for one, 0 if the pixel is left alone."""
    usable, mass, largest = 0, 0.0, 0.0
    for i in range(len(row)):
        v = row[i]
        ok = v == v and abs(v) < np.inf and weight[i] > 0
        y[i] = v if ok else 0.0
        g[i] = weight[i] if ok else 0.0
        usable += 1 if ok else 0
        mass += g[i]
        largest = max(largest, y[i])
    if usable < s.least or not largest > 0:
        return 0.0
    _kept(y, g, work[3])
    top = _quantile(work[3], int(s.top * (usable - 1) + 0.5), largest)
    if top < _TOO_FEW_BRIGHT * largest:
        return 0.0
    n = 0
    for i in range(len(row)):
        y[i] /= top
        g[i] *= usable / mass if y[i] > s.level else 0.0
        n += 1 if g[i] > 0 else 0
    if n < s.least:
        return 0.0
    _kept(y, g, work[3])
    low = _quantile(work[3], int(s.low * (n - 1) + 0.5), largest / top)
    high = _quantile(work[3], int(s.high * (n - 1) + 0.5), largest / top)
    for i in range(len(row)):
        work[0][i] = g[i] if (y[i] >= low and y[i] <= high) else 0.0
    return top


@_loop
def _bend_columns(y, segments, columns):
    """Fill the rows of a design: tents of the brightness, and the offset; they stand on the left, hence the sign."""
    for k in range(1, segments):
        knot = k / segments
        for i in range(len(y)):
            columns[k - 1, i] = -min(y[i] / knot, (1.0 - y[i]) / (1.0 - knot))
    for i in range(len(y)):
        columns[segments - 1, i] = -1.0


@_loop
def _influence(g, work, dark, inverse):
    """Return Σ g (w r)² and Σ of the derivative of w r, over the lit observations; and how many are used, and lit."""
    r, front, influence, slope, used, count = work[1], work[2], 0.0, 0.0, 0.0, 0.0
    for i in range(len(r)):
        v = r[i] * r[i] * g[i] * inverse
        u = 1.0 / (1.0 + v)
        lit = (1.0 if g[i] > 0.0 else 0.0) * (1.0 if front[i] > dark else 0.0)
        influence += lit * r[i] * r[i] * g[i] * u * u * u * u
        slope += lit * (1.0 - 3.0 * v) * u * u * u
        used += lit if u >= 0.5 else 0.0
        count += lit
    return influence, slope, int(used), int(count)


@_plain
def _spread(columns, ridge, g, scale, dark, work, a, b, matrix, facts, j):
    """Write variance and matrix of the normal's error with all else unknown; return the observations used, and lit."""
    size = len(b)
    influence, slope, used, lit = _influence(g, work, dark, 1.0 / (scale * scale))
    for i in range(len(g)):
        work[0][i] = g[i] if work[2][i] > dark else 0.0
    mass = _normal_equations(columns, work[0], work[1], work[4], a, b)
    for k in range(size - 3):
        a[k, k] += ridge[k] * mass
    if _factor(a, size) and lit > size and slope > 0:
        at = 0
        for row in range(size - 3, size):
            for column in range(size - 3, row + 1):
                total = 0.0
                for k in range(size - 3, column + 1):
                    total += a[row, k] * a[column, k]
                matrix[j, at] = total
                at += 1
        facts[1, j] = influence / (lit - size) * (lit / slope) ** 2
    return used, lit


@_plain
def _pixels(values, weights, q, r_inverse, pairs, s, solution, matrix, facts, counts):
    m, pixels = values.shape
    size = s.segments + 3
    rows, heavy = np.zeros((_TOGETHER, m)), np.ones((_TOGETHER, m))
    y, g, work = np.zeros(m), np.zeros(m), np.zeros((5, m))
    columns, a, b = np.zeros((size, m)), np.zeros((size, size)), np.zeros(size)
    columns[s.segments :] = q
    ridge, x, all_unknowns = np.full(size, s.tie), np.zeros(3), np.zeros(size)
    ridge[s.segments - 1] = s.offset_tie
    for j in range(pixels):
        if j % _TOGETHER == 0:
            few = min(_TOGETHER, pixels - j)
            for i in range(m):
                for k in range(few):
                    rows[k, i] = values[i, j + k]
                    if weights.size:
                        heavy[k, i] = weights[i, j + k]
        top = _prepare(rows[j % _TOGETHER], heavy[j % _TOGETHER], s, y, g, work)
        if top == 0:
            continue
        x[:] = 0.0
        scale, dark, lit, step = _iterate(q, ridge, y, g, r_inverse, s, s.first_rounds, s.least, x, work, a, b[:3])
        if lit == 0:
            continue
        moran, lit = _structure(g, work, dark, scale, pairs)
        share = (moran - s.white * math.sqrt(_REFERENCE / lit)) / s.ramp
        share = min(1.0, max(0.0, share))
        if share == 0:
            continue
        _bend_columns(y, s.segments, columns)
        all_unknowns[:] = 0.0
        all_unknowns[s.segments :] = x
        scale, dark, lit, step = _iterate(
            columns, ridge, y, g, r_inverse, s, s.rounds, size + 3, all_unknowns, work, a, b
        )
        if lit == 0:
            continue
        facts[0, j] = share * share * (3.0 - 2.0 * share)
        facts[2, j], facts[3, j] = scale, top
        facts[4, j] = 1.0 if step <= s.settled else 0.0
        counts[0, j], counts[1, j] = _spread(columns, ridge, g, scale, dark, work, a, b, matrix, facts, j)
        solution[j] = all_unknowns


def response_bend(
    values: FloatArray,
    weights: FloatArray | None,
    q: FloatArray,
    r_inverse: FloatArray,
    pairs: IntArray,
    settings: Settings,
) -> BendFit:
    """Solve some pixels; see :func:`psstereo.kernels.response_bend.response_bend`."""
    values = np.ascontiguousarray(values)  # one layout, so that there are fewer kinds to compile
    p, size = values.shape[1], settings.segments + 3
    solution, matrix = np.full((p, size), np.nan), np.full((p, 6), np.nan)
    facts, counts = np.zeros((5, p)), np.zeros((2, p), np.int64)
    facts[1:4] = np.nan
    heavy = np.zeros((0, 0)) if weights is None else np.ascontiguousarray(weights, np.float64)
    _pixels(values, heavy, np.ascontiguousarray(q.T), r_inverse, pairs, settings, solution, matrix, facts, counts)
    return BendFit(solution, matrix, facts[1], facts[0], facts[2], facts[3], counts[0], counts[1], facts[4] > 0)
