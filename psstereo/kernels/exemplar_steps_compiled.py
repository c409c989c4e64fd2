"""Steps of the compiled exemplar fit: lobes, normal equations, and amounts that are not negative.

Loops over lights are branch-free, so that they become vector instructions.
"""

import math
from typing import Any

import numba
import numpy as np

from psstereo.kernels.bipolynomial_compiled import factor, select, solve_factored
from psstereo.kernels.exemplar_lobes import (
    BELL,
    CONSTANT,
    FACETED,
    GGX,
    GLAZE,
    GRAZING,
    LEAST_HALF,
    POWER,
    ROUGH,
)
from psstereo.kernels.exemplar_nnls import NOTHING, STEPS
from psstereo.kernels.exemplar_terms import WEAK

__all__ = [
    "fill_lobes",
    "fill_mixed",
    "fill_residuals",
    "fill_system",
    "fill_turns",
    "median",
    "minimum",
    "nnls",
    "reached",
    "weigh",
]

# Nothing in these loops is NaN or infinite (that is sorted out before), and sums may be taken in any fixed order.
_loop: Any = numba.njit(
    nogil=True, cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz", "arcp", "contract", "reassoc"}
)
_plain: Any = numba.njit(nogil=True, cache=True, error_model="numpy")


@_loop
def _gloss(s, amount, eye, cosine, half, out, by):
    """Fill a gloss and add its derivatives; one division and one root for all of them."""
    square = s * s
    rest, steep = 1.0 - square, 4.0 * (1.0 - square) / square
    seen = math.sqrt(eye * eye + square * (1.0 - eye * eye))
    sidelong = rest * eye / seen
    for i in range(len(out)):
        c, h = cosine[i], half[i]
        light = math.sqrt(c * c + square * (1.0 - c * c))
        below, narrow = max(c * seen + eye * light, 1e-9), 1.0 - rest * h * h
        share = 1.0 / (narrow * below * light)
        facets, under = square * (share * below * light), share * narrow * light
        bare = 2.0 * facets * facets * under if h > 0.0 else 0.0
        out[i] = c * bare
        bare *= amount
        by[0, i] += bare * (1.0 - c * (seen + eye * rest * c * (share * narrow * below)) * under)
        by[1, i] += bare * c * steep * h * facets
        by[2, i] -= bare * c * (c * sidelong + light) * under


@_loop
def _bell(s, amount, eye, cosine, half, out, by):
    """Fill a gloss with Gaussian facets and add its derivatives."""
    square = s * s
    rest, sharp = 1.0 - square, 1.0 / square
    seen = math.sqrt(eye * eye + square * (1.0 - eye * eye))
    sidelong = rest * eye / seen
    for i in range(len(out)):
        c, h = cosine[i], max(half[i], LEAST_HALF)
        light, inverse = math.sqrt(c * c + square * (1.0 - c * c)), 1.0 / (h * h)
        under = 1.0 / max(c * seen + eye * light, 1e-9)
        bare = 2.0 * math.exp((1.0 - inverse) * sharp) * inverse * inverse * under
        out[i] = c * bare
        bare *= amount
        by[0, i] += bare * (1.0 - c * (seen + eye * rest * c / light) * under)
        by[1, i] += bare * c * (2.0 * inverse * sharp - 4.0) / h if half[i] > LEAST_HALF else 0.0
        by[2, i] -= bare * c * (c * sidelong + light) * under


@_loop
def _power(s, amount, cosine, out, by):
    """Fill the cosine to a power; whole powers by products, since the general one costs more than all the rest."""
    whole = int(s)
    if whole == s and whole >= 1:
        out[:] = 1.0
        for _ in range(whole - 1):
            for i in range(len(out)):
                out[i] *= cosine[i]
    else:
        for i in range(len(out)):
            out[i] = (cosine[i] if cosine[i] > 0.0 else 1.0) ** (s - 1.0)
    for i in range(len(out)):
        by[0, i] += amount * s * out[i]
        out[i] *= cosine[i]


@_loop
def _matte(kind, s, amount, eye, cosine, table, out, by):
    """Fill a lobe without highlight and add its derivatives."""
    if kind == GLAZE:
        for i in range(len(out)):
            c = cosine[i]
            x = 1.0 - c
            fourth = x * x * x * x
            out[i] = c * (1.0 - fourth * x)
            by[0, i] += amount * (1.0 - fourth * x + 5.0 * c * fourth)
    elif kind == ROUGH:
        e = 1.0 - eye
        for i in range(len(out)):
            c = cosine[i]
            x = 1.0 - c
            retro, fourth = 2.0 * s * table[6, i] - 0.5, x * x * x * x
            lit, seen = 1.0 + retro * fourth * x, 1.0 + retro * e * e * e * e * e
            out[i] = c * lit * seen
            by[0, i] += amount * seen * (lit - 5.0 * c * retro * fourth)
            by[2, i] -= amount * 5.0 * c * lit * retro * e * e * e * e
    elif kind == FACETED:
        for i in range(len(out)):
            c = cosine[i]
            toward, larger = max(table[2, i] - c * eye, 0.0), 1.0 / max(c, eye)
            some, rest = 1.0 if toward > 0.0 else 0.0, toward * larger * larger
            by_light = some * eye * larger + (rest if c > eye else 0.0)
            by_eye = some * c * larger + (0.0 if c > eye else rest)
            out[i] = c * (1.0 + s * toward * larger)
            by[0, i] += amount * (1.0 + s * toward * larger - s * c * by_light)
            by[2, i] -= amount * s * c * by_eye
    elif kind == POWER:
        _power(s, amount, cosine, out, by)
    elif kind == CONSTANT:
        out[:] = 1.0
    else:
        for i in range(len(out)):
            out[i] = cosine[i]
            by[0, i] += amount


@_loop
def fill_lobes(n, table, kinds, shapes, mix, amounts, cosine, half, out, by):
    """Fill cosines, half cosines, lobes (k, m), and the derivatives of their sum (3, m).

    See :func:`psstereo.kernels.exemplar_lobes.lobes` and :func:`psstereo.kernels.exemplar_lobes.slopes`. A lobe that
    no exemplar has a part of is left as it is.
    """
    n0, n1, n2 = n[0], n[1], n[2]
    for i in range(table.shape[1]):
        cosine[i] = max(n0 * table[0, i] + n1 * table[1, i] + n2 * table[2, i], 0.0)
        half[i] = n0 * table[3, i] + n1 * table[4, i] + n2 * table[5, i]
    eye = max(n2, GRAZING)
    by[:] = 0.0
    for k in range(len(kinds)):
        has = mix.shape[0] == 0
        for q in range(mix.shape[0]):
            has |= mix[q, k] != 0.0
        if has and kinds[k] == GGX:
            _gloss(shapes[k], amounts[k], eye, cosine, half, out[k], by)
        elif has and kinds[k] == BELL:
            _bell(shapes[k], amounts[k], eye, cosine, half, out[k], by)
        elif has:
            _matte(kinds[k], shapes[k], amounts[k], eye, cosine, table, out[k], by)
    facing = 1.0 if n2 > GRAZING else 0.0
    for i in range(table.shape[1]):
        lit = 1.0 if cosine[i] > 0.0 else 0.0
        by[0, i] *= lit
        by[1, i] *= lit
        by[2, i] *= facing


@_loop
def fill_mixed(mix, parts, out):
    """Fill what each exemplar shows as a sum of lobes."""
    for q in range(mix.shape[0]):
        out[q] = 0.0
        for k in range(mix.shape[1]):
            share = mix[q, k]
            if share != 0.0:
                for i in range(out.shape[1]):
                    out[q, i] += share * parts[k, i]


@_loop
def fill_system(columns, w, y, ties, weighted, a, b):
    """Fill the normal equations, with ties; return the sum of weights."""
    count, m = columns.shape
    mass = 0.0
    for i in range(m):
        mass += w[i]
    for k in range(count):
        total = 0.0
        for i in range(m):
            v = w[i] * columns[k, i]
            weighted[i] = v
            total += v * y[i]
        b[k] = total
        for j in range(k, count):
            total = 0.0
            for i in range(m):
                total += weighted[i] * columns[j, i]
            a[k, j], a[j, k] = total, total
        a[k, k] += mass * (WEAK + (ties[k] if k < len(ties) else 0.0))
    return mass


@_plain
def minimum(a, b, passive, size, at, small, z):
    """Put the minimum over the free unknowns into z, zero elsewhere; False if the matrix is not definite."""
    n = 0
    for k in range(size):
        if passive[k]:
            at[n] = k
            n += 1
    for i in range(n):
        for j in range(i + 1):
            small[i, j] = a[at[i], at[j]]
        small[size, i] = b[at[i]]
    if not factor(small, n):
        return False
    solve_factored(small, small[size], n)
    for k in range(size):
        z[k] = 0.0
    for i in range(n):
        z[at[i]] = small[size, i]
    return True


@_plain
def nnls(a, b, size, unbounded, x, mass, passive, at, small, z):
    """Move x to the minimum; see :func:`psstereo.kernels.exemplar_nnls.nnls`. False if the matrix is not definite."""
    bounded = size - unbounded
    for k in range(size):
        passive[k] = x[k] > 0.0 or k >= bounded
    for _ in range(STEPS * size):
        if not minimum(a, b, passive, size, at, small, z):
            return False
        step, hit = np.inf, -1
        for k in range(bounded):
            if passive[k] and z[k] <= 0.0:
                share = x[k] / (x[k] - z[k] if x[k] > z[k] else 1.0)
                if share < step:
                    step, hit = share, k
        if hit >= 0:
            for k in range(size):
                x[k] += step * (z[k] - x[k])
            x[hit], passive[hit] = 0.0, False
            continue
        for k in range(size):
            x[k] = z[k]
        best, steepest = -1, NOTHING * mass
        for k in range(bounded):
            if not passive[k]:
                slope = b[k]
                for j in range(size):
                    slope -= a[k, j] * x[j]
                if slope > steepest:
                    best, steepest = k, slope
        if best < 0:
            return True
        passive[best] = True
    return True


@_loop
def fill_residuals(y, columns, x, size, r):
    """Fill what the exemplars leave."""
    for i in range(len(y)):
        r[i] = y[i]
    for k in range(size):
        v = x[k]
        if v != 0.0:
            for i in range(len(y)):
                r[i] -= v * columns[k, i]


@_loop
def weigh(r, g, cosine, dark, inverse, w):
    """Fill Geman–McClure weights of the lit observations; `inverse` is one over the squared scale."""
    for i in range(len(r)):
        v = 1.0 + r[i] * r[i] * g[i] * inverse
        w[i] = (g[i] if cosine[i] > dark else 0.0) / (v * v)


@_loop
def reached(g, cosine, dark):
    """Return how many observations are lit."""
    count = 0
    for i in range(len(g)):
        count += 1 if g[i] > 0.0 and cosine[i] > dark else 0
    return count


@_plain
def median(r, g, cosine, dark, sizes):
    """Return the median size of the lit residuals."""
    n = 0
    for i in range(len(r)):
        if g[i] > 0.0 and cosine[i] > dark:
            sizes[n] = abs(r[i]) * math.sqrt(g[i])
            n += 1
    return select(sizes, n, int(0.5 * (n - 1) + 0.5)) if n > 0 else 0.0


@_loop
def fill_turns(table, across, by, first, second):
    """Fill how the sum changes along the two tangents."""
    for e in range(2):
        out = first if e == 0 else second
        t0, t1, t2 = across[e, 0], across[e, 1], across[e, 2]
        for i in range(len(out)):
            light = t0 * table[0, i] + t1 * table[1, i] + t2 * table[2, i]
            half = t0 * table[3, i] + t1 * table[4, i] + t2 * table[5, i]
            out[i] = light * by[0, i] + half * by[1, i] + t2 * by[2, i]
