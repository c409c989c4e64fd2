"""Steps of the compiled exemplar fit: lobes, normal equations, and amounts that are not negative.

Loops over lights are branch-free, so that they become vector instructions.
"""

import math
from typing import Any

import numba
import numpy as np

from psstereo.kernels.bipolynomial_compiled import factor, select, solve_factored
from psstereo.kernels.exemplar import WEAK
from psstereo.kernels.exemplar_lobes import CONSTANT, FACETED, GGX, GLAZE, GRAZING, POWER, ROUGH
from psstereo.kernels.exemplar_nnls import NOTHING, STEPS

__all__ = [
    "fill_columns",
    "fill_residuals",
    "fill_system",
    "fill_turns",
    "lobes",
    "median",
    "minimum",
    "nnls",
    "slopes",
    "weigh",
]

# Nothing in these loops is NaN or infinite (that is sorted out before), and sums may be taken in any fixed order.
_loop: Any = numba.njit(
    nogil=True, cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz", "arcp", "contract", "reassoc"}
)
_plain: Any = numba.njit(nogil=True, cache=True, error_model="numpy")


@_loop
def _ggx(s, eye, cosine, half, out):
    square = s * s
    seen = math.sqrt(eye * eye + square * (1.0 - eye * eye))
    for i in range(len(out)):
        c, h = cosine[i], half[i]
        facets = square / ((square - 1.0) * h * h + 1.0)
        light = math.sqrt(c * c + square * (1.0 - c * c))
        v = c * facets * facets * 2.0 / max(c * seen + eye * light, 1e-9)
        out[i] = v if h > 0.0 else 0.0


@_loop
def _matte(kind, s, eye, cosine, table, out):
    """Fill the lobes without highlights."""
    if kind == GLAZE:
        for i in range(len(out)):
            c = cosine[i]
            x = 1.0 - c
            out[i] = c * (1.0 - x * x * x * x * x)
    elif kind == ROUGH:
        e = (1.0 - eye) ** 5
        for i in range(len(out)):
            c = cosine[i]
            x = 1.0 - c
            retro = 2.0 * s * table[6, i] - 0.5
            out[i] = c * (1.0 + retro * x * x * x * x * x) * (1.0 + retro * e)
    elif kind == FACETED:
        for i in range(len(out)):
            c = cosine[i]
            out[i] = c * (1.0 + s * max(table[2, i] - c * eye, 0.0) / max(c, eye))
    elif kind == POWER:
        for i in range(len(out)):
            out[i] = cosine[i] ** s
    elif kind == CONSTANT:
        for i in range(len(out)):
            out[i] = 1.0
    else:
        for i in range(len(out)):
            out[i] = cosine[i]


@_loop
def lobes(n, table, kinds, shapes, cosine, half, out):
    """Fill cosines, half cosines, and lobes (k, m); see :func:`psstereo.kernels.exemplar_lobes.lobes`."""
    n0, n1, n2 = n[0], n[1], n[2]
    for i in range(table.shape[1]):
        cosine[i] = max(n0 * table[0, i] + n1 * table[1, i] + n2 * table[2, i], 0.0)
        half[i] = n0 * table[3, i] + n1 * table[4, i] + n2 * table[5, i]
    eye = max(n2, GRAZING)
    for k in range(len(kinds)):
        if kinds[k] == GGX:
            _ggx(shapes[k], eye, cosine, half, out[k])
        else:
            _matte(kinds[k], shapes[k], eye, cosine, table, out[k])


@_loop
def fill_columns(n, table, kinds, shapes, mix, cosine, half, parts, out):
    """Fill what each exemplar shows."""
    lobes(n, table, kinds, shapes, cosine, half, out if mix.shape[0] == 0 else parts)
    for q in range(mix.shape[0]):
        for i in range(out.shape[1]):
            out[q, i] = 0.0
        for k in range(mix.shape[1]):
            share = mix[q, k]
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


@_plain
def median(r, g, cosine, dark, sizes):
    """Return the median size of the lit residuals, and their number."""
    n = 0
    for i in range(len(r)):
        if g[i] > 0.0 and cosine[i] > dark:
            sizes[n] = abs(r[i]) * math.sqrt(g[i])
            n += 1
    return (select(sizes, n, int(0.5 * (n - 1) + 0.5)) if n > 0 else 0.0), n


@_loop
def _gloss_slopes(amount, square, eye, cosine, half, out):
    """Add the derivatives of a gloss."""
    rest = 1.0 - square
    seen = math.sqrt(eye * eye + square * (1.0 - eye * eye))
    for i in range(out.shape[1]):
        c, h = cosine[i], half[i]
        facets = square / (1.0 - rest * h * h)
        light = math.sqrt(c * c + square * (1.0 - c * c))
        below = max(c * seen + eye * light, 1e-9)
        bare = amount * 2.0 * facets * facets / below if h > 0.0 else 0.0
        out[0, i] += bare * (1.0 - c * (seen + eye * rest * c / light) / below)
        out[1, i] += bare * c * 4.0 * rest * h * facets / square
        out[2, i] -= bare * c * (c * rest * eye / seen + light) / below


@_loop
def _matte_slopes(kind, s, amount, eye, cosine, table, out):
    """Add the derivatives of a lobe without highlight."""
    m = out.shape[1]
    if kind == GLAZE:
        for i in range(m):
            c = cosine[i]
            x = 1.0 - c
            out[0, i] += amount * (1.0 - x * x * x * x * x + 5.0 * c * x * x * x * x)
    elif kind == ROUGH:
        e = 1.0 - eye
        for i in range(m):
            c = cosine[i]
            x = 1.0 - c
            retro = 2.0 * s * table[6, i] - 0.5
            lit, seen = 1.0 + retro * x * x * x * x * x, 1.0 + retro * e * e * e * e * e
            out[0, i] += amount * seen * (lit - 5.0 * c * retro * x * x * x * x)
            out[2, i] -= amount * 5.0 * c * lit * retro * e * e * e * e
    elif kind == FACETED:
        for i in range(m):
            c = cosine[i]
            toward, larger = max(table[2, i] - c * eye, 0.0), max(c, eye)
            some, rest = 1.0 if toward > 0.0 else 0.0, toward / (larger * larger)
            by_light = some * eye / larger + (rest if c > eye else 0.0)
            by_eye = some * c / larger + (0.0 if c > eye else rest)
            out[0, i] += amount * (1.0 + s * toward / larger - s * c * by_light)
            out[2, i] -= amount * s * c * by_eye
    elif kind == POWER:
        for i in range(m):
            c = cosine[i] if cosine[i] > 0.0 else 1.0
            out[0, i] += amount * s * c ** (s - 1.0)
    elif kind != CONSTANT:
        for i in range(m):
            out[0, i] += amount


@_loop
def slopes(n, table, kinds, shapes, amounts, cosine, half, out):
    """Fill the derivatives of a sum of lobes, (3, m); see :func:`psstereo.kernels.exemplar_lobes.slopes`."""
    eye = max(n[2], GRAZING)
    for e in range(3):
        for i in range(out.shape[1]):
            out[e, i] = 0.0
    for k in range(len(kinds)):
        if amounts[k] > 0.0:
            if kinds[k] == GGX:
                _gloss_slopes(amounts[k], shapes[k] * shapes[k], eye, cosine, half, out)
            else:
                _matte_slopes(kinds[k], shapes[k], amounts[k], eye, cosine, table, out)
    for i in range(out.shape[1]):
        lit = 1.0 if cosine[i] > 0.0 else 0.0
        out[0, i] *= lit
        out[1, i] *= lit
        out[2, i] *= 1.0 if n[2] > GRAZING else 0.0


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
