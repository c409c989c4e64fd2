"""Loops over the lights of one pixel, compiled: branch-free, in single precision, so that they become vector code."""

import math
from typing import Any

import numpy as np
from numba import njit

__all__ = [
    "between",
    "count",
    "count_used",
    "largest",
    "mean_and_variance",
    "moments",
    "moments64",
    "normalise",
    "quantile",
    "residuals",
    "round_geman_mcclure",
    "round_tukey",
    "slopes",
    "sort_out",
    "spread",
    "structure",
    "two_quantiles",
    "weigh",
]

F = np.float32
_ZERO, _QUARTER, _ONE, _TWO, _THREE, _FIVE = F(0), F(0.25), F(1), F(2), F(3), F(5)

# Nothing here is NaN or infinite (that is sorted out before), and sums may be taken in any fixed order.
_loop: Any = njit(
    nogil=True, cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz", "arcp", "contract", "reassoc"}
)
_clean: Any = njit(nogil=True, cache=True, error_model="numpy")


@_clean
def sort_out(row, weight, y, g):
    """Fill brightness and weights, both 0 where an observation cannot be used; return how many can."""
    usable = 0
    for i in range(len(row)):
        v = row[i]
        ok = abs(v) < np.inf and weight[i] > 0
        y[i] = v if ok else 0.0
        g[i] = weight[i] if ok else 0.0
        usable += 1 if ok else 0
    return usable


@_loop
def largest(a):
    """Return the largest entry, 0 if all are negative."""
    top = a[0]
    for i in range(len(a)):
        top = max(top, a[i])
    return max(top, top - top)


@_loop
def normalise(y64, g64, brightest, heaviest, y, g):
    """Divide brightness and weights by their largest, and copy them in single precision; return the sum of weights."""
    inverse, lighter, mass = 1.0 / brightest, 1.0 / heaviest, _ZERO
    for i in range(len(y)):
        v, w = y64[i] * inverse, F(g64[i] * lighter)
        y64[i], y[i], g[i] = v, F(v), w
        mass += w
    return mass


@_loop
def count(w):
    """Return how many weights are positive, and their sum."""
    number, total = _ZERO, _ZERO
    for i in range(len(w)):
        number += _ONE if w[i] > _ZERO else _ZERO
        total += w[i]
    return number, total


@_loop
def count_used(lit, w):
    """Return how many observations are lit, and how many of them have a quarter of their full weight or more."""
    looked, used = _ZERO, _ZERO
    for i in range(len(w)):
        looked += _ONE if lit[i] > _ZERO else _ZERO
        used += _ONE if (lit[i] > _ZERO and w[i] >= _QUARTER * lit[i]) else _ZERO
    return looked, used


@_loop
def quantile(a, g, top, want, steps):
    """Return the value below which `want` of the weights g lie, on 0 … top, a quarter of the range in each step."""
    low, width = _ZERO, top
    for _ in range(steps):
        quarter = _QUARTER * width
        t1, t2, t3 = low + quarter, low + _TWO * quarter, low + _THREE * quarter
        c1, c2, c3 = _ZERO, _ZERO, _ZERO
        for i in range(len(a)):
            c1 += g[i] if a[i] < t1 else _ZERO
            c2 += g[i] if a[i] < t2 else _ZERO
            c3 += g[i] if a[i] < t3 else _ZERO
        low += (F(c1 < want) + F(c2 < want) + F(c3 < want)) * quarter
        width = quarter
    return low + width


@_loop
def two_quantiles(a, g, top, want, other, steps):
    """Do the same for two shares at once."""
    low, high, width = _ZERO, _ZERO, top
    for _ in range(steps):
        quarter = _QUARTER * width
        t1, t2, t3 = low + quarter, low + _TWO * quarter, low + _THREE * quarter
        u1, u2, u3 = high + quarter, high + _TWO * quarter, high + _THREE * quarter
        c1, c2, c3, d1, d2, d3 = _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
        for i in range(len(a)):
            c1 += g[i] if a[i] < t1 else _ZERO
            c2 += g[i] if a[i] < t2 else _ZERO
            c3 += g[i] if a[i] < t3 else _ZERO
            d1 += g[i] if a[i] < u1 else _ZERO
            d2 += g[i] if a[i] < u2 else _ZERO
            d3 += g[i] if a[i] < u3 else _ZERO
        low += (F(c1 < want) + F(c2 < want) + F(c3 < want)) * quarter
        high += (F(d1 < other) + F(d2 < other) + F(d3 < other)) * quarter
        width = quarter
    return low + width, high + width


@_loop
def between(y, g, low, high, out):
    """Fill the weights of observations within a range of brightness, 0 elsewhere."""
    for i in range(len(y)):
        out[i] = g[i] if (y[i] >= low and y[i] <= high) else _ZERO


@_loop
def residuals(y, g, q, x, dark, r, size, lit):
    """Fill residuals, their sizes, and the weights of lit observations; return the sum of those, and the largest."""
    x0, x1, x2 = F(x[0]), F(x[1]), F(x[2])
    count, top = _ZERO, _ZERO
    for i in range(len(y)):
        p = q[0, i] * x0 + q[1, i] * x1 + q[2, i] * x2
        e = y[i] - p
        keep = g[i] if p > dark else _ZERO
        a = abs(e)
        r[i], size[i], lit[i] = e, a, keep
        count += keep
        top = max(top, a if keep > _ZERO else _ZERO)
    return count, top


@_loop
def weigh(loss, r, lit, inverse, w):
    """Fill the weights of a loss; `inverse` is 1 / (tuning · scale)."""
    if loss == 0:
        for i in range(len(r)):
            w[i] = lit[i] / max(abs(r[i] * inverse), F(1e-3))
    elif loss == 1:
        for i in range(len(r)):
            w[i] = lit[i] / max(abs(r[i] * inverse), _ONE)
    elif loss == 2:
        for i in range(len(r)):
            t = r[i] * inverse
            w[i] = lit[i] / (_ONE + t * t)
    elif loss == 3:
        for i in range(len(r)):
            t = r[i] * inverse
            v = _ONE + t * t
            w[i] = lit[i] / (v * v)
    elif loss == 4:
        for i in range(len(r)):
            t = r[i] * inverse
            v = max(_ONE - t * t, _ZERO)
            w[i] = lit[i] * v * v
    elif loss == 5:
        for i in range(len(r)):
            t = r[i] * inverse
            w[i] = lit[i] * math.exp(-t * t)
    else:
        for i in range(len(r)):
            w[i] = lit[i]


@_loop
def slopes(loss, r, inverse, d):
    """Fill the derivative of r · w(r)."""
    if loss == 1:
        for i in range(len(r)):
            t = r[i] * inverse
            d[i] = _ONE if t * t < _ONE else _ZERO
    elif loss == 2:
        for i in range(len(r)):
            v = (r[i] * inverse) ** 2
            d[i] = (_ONE - v) / ((_ONE + v) * (_ONE + v))
    elif loss == 3:
        for i in range(len(r)):
            v = (r[i] * inverse) ** 2
            d[i] = (_ONE - _THREE * v) / ((_ONE + v) * (_ONE + v) * (_ONE + v))
    elif loss == 4:
        for i in range(len(r)):
            v = (r[i] * inverse) ** 2
            d[i] = (_ONE - v) * (_ONE - _FIVE * v) if v < _ONE else _ZERO
    elif loss == 5:
        for i in range(len(r)):
            v = (r[i] * inverse) ** 2
            d[i] = (_ONE - _TWO * v) * math.exp(-v)
    else:
        for i in range(len(r)):
            d[i] = _ONE


@_loop
def mean_and_variance(d, lit):
    """Return both over the lit observations."""
    total, squares, number = _ZERO, _ZERO, _ZERO
    for i in range(len(d)):
        total += lit[i] * d[i]
        squares += lit[i] * d[i] * d[i]
        number += lit[i]
    mean = total / number
    return mean, squares / number - mean * mean


@_loop
def moments(y, w, q, out):
    """Fill Σ w q qᵀ (six entries) and Σ w q y (three)."""
    a0, a1, a2, a3, a4, a5 = _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
    b0, b1, b2 = _ZERO, _ZERO, _ZERO
    for i in range(len(y)):
        w0, w1, w2 = w[i] * q[0, i], w[i] * q[1, i], w[i] * q[2, i]
        a0 += w0 * q[0, i]
        a1 += w0 * q[1, i]
        a2 += w1 * q[1, i]
        a3 += w0 * q[2, i]
        a4 += w1 * q[2, i]
        a5 += w2 * q[2, i]
        b0 += w0 * y[i]
        b1 += w1 * y[i]
        b2 += w2 * y[i]
    out[0], out[1], out[2], out[3], out[4], out[5] = a0, a1, a2, a3, a4, a5
    out[6], out[7], out[8] = b0, b1, b2


@_loop
def moments64(y, w, q, x, out):
    """Fill Σ w q qᵀ and Σ w q (y − q·x) in double precision."""
    x0, x1, x2 = x[0], x[1], x[2]
    a0, a1, a2, a3, a4, a5, b0, b1, b2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(y)):
        v = np.float64(w[i])
        e = y[i] - (q[0, i] * x0 + q[1, i] * x1 + q[2, i] * x2)
        w0, w1, w2 = v * q[0, i], v * q[1, i], v * q[2, i]
        a0 += w0 * q[0, i]
        a1 += w0 * q[1, i]
        a2 += w1 * q[1, i]
        a3 += w0 * q[2, i]
        a4 += w1 * q[2, i]
        a5 += w2 * q[2, i]
        b0 += w0 * e
        b1 += w1 * e
        b2 += w2 * e
    out[0], out[1], out[2], out[3], out[4], out[5] = a0, a1, a2, a3, a4, a5
    out[6], out[7], out[8] = b0, b1, b2


@_loop
def round_geman_mcclure(y, g, q, x, dark, inverse, out):
    """Residuals, weights and sums of one round at once: the loss of the first rounds, where most of the time goes."""
    x0, x1, x2 = F(x[0]), F(x[1]), F(x[2])
    a0, a1, a2, a3, a4, a5 = _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
    b0, b1, b2, total, squares = _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
    for i in range(len(y)):
        p = q[0, i] * x0 + q[1, i] * x1 + q[2, i] * x2
        e = y[i] - p
        t = e * inverse
        v = _ONE + t * t
        w = g[i] / (v * v)
        w = w if p > dark else _ZERO
        w0, w1, w2 = w * q[0, i], w * q[1, i], w * q[2, i]
        a0 += w0 * q[0, i]
        a1 += w0 * q[1, i]
        a2 += w1 * q[1, i]
        a3 += w0 * q[2, i]
        a4 += w1 * q[2, i]
        a5 += w2 * q[2, i]
        b0 += w0 * y[i]
        b1 += w1 * y[i]
        b2 += w2 * y[i]
        total += w
        squares += w * e * e
    out[0], out[1], out[2], out[3], out[4], out[5] = a0, a1, a2, a3, a4, a5
    out[6], out[7], out[8] = b0, b1, b2
    return squares / max(total, F(1e-30))


@_loop
def round_tukey(y, g, q, x, dark, inverse, out):
    """Do the same for the loss of the last rounds."""
    x0, x1, x2 = F(x[0]), F(x[1]), F(x[2])
    a0, a1, a2, a3, a4, a5 = _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
    b0, b1, b2, total, squares = _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
    for i in range(len(y)):
        p = q[0, i] * x0 + q[1, i] * x1 + q[2, i] * x2
        e = y[i] - p
        t = e * inverse
        v = max(_ONE - t * t, _ZERO)
        w = g[i] * v * v
        w = w if p > dark else _ZERO
        w0, w1, w2 = w * q[0, i], w * q[1, i], w * q[2, i]
        a0 += w0 * q[0, i]
        a1 += w0 * q[1, i]
        a2 += w1 * q[1, i]
        a3 += w0 * q[2, i]
        a4 += w1 * q[2, i]
        a5 += w2 * q[2, i]
        b0 += w0 * y[i]
        b1 += w1 * y[i]
        b2 += w2 * y[i]
        total += w
        squares += w * e * e
    out[0], out[1], out[2], out[3], out[4], out[5] = a0, a1, a2, a3, a4, a5
    out[6], out[7], out[8] = b0, b1, b2
    return squares / max(total, F(1e-30))


@_loop
def spread(r, w):
    """Return Σ w r² / Σ w and Σ (w r)²."""
    total, squares, influence = _ZERO, _ZERO, _ZERO
    for i in range(len(r)):
        e = w[i] * r[i]
        total += w[i]
        squares += e * r[i]
        influence += e * e
    return squares / max(total, F(1e-30)), influence


@_loop
def structure(r, size, lit, neighbours, limit, kept):
    """Return Moran's statistic of the residuals within a limit, and their number; r is centred on the way."""
    count, total = _ZERO, _ZERO
    for i in range(len(r)):
        k = _ONE if (size[i] < limit and lit[i] > _ZERO) else _ZERO
        kept[i] = k
        count += k
        total += k * r[i]
    mean = total / max(count, _ONE)
    variance = _ZERO
    for i in range(len(r)):
        e = (r[i] - mean) * kept[i]
        r[i] = e
        variance += e * e
    products, pairs = _ZERO, _ZERO
    for k in range(neighbours.shape[1]):
        i, j, n = neighbours[0, k], neighbours[1, k], F(neighbours[2, k])
        products += n * r[i] * r[j]
        pairs += n * kept[i] * kept[j]
    return (products / max(pairs, _ONE)) / (variance / max(count, _ONE) + F(1e-30)), count
