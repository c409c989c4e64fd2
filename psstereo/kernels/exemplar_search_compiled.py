"""Where to start a fit of exemplars from, compiled: the twin of :mod:`psstereo.kernels.exemplar_search`."""

import math
from typing import Any

import numba
import numpy as np

from psstereo.kernels.exemplar_search import LEAST_AMOUNT, LEAST_LOSS, WEAK, Candidates, SearchSettings
from psstereo.kernels.exemplar_steps_compiled import fill_residuals, nnls
from psstereo.types import FloatArray

__all__ = ["search"]

_loop: Any = numba.njit(
    nogil=True, cache=True, error_model="numpy", fastmath={"nnan", "nsz", "arcp", "contract", "reassoc"}
)
_plain: Any = numba.njit(nogil=True, cache=True, error_model="numpy")


@_loop
def _fill(columns, base, reached, y, ties, w, a, b):
    """Fill the normal equations; return the sum of weights."""
    size, m, mass = columns.shape[0], columns.shape[1], 0.0
    for i in range(m):
        mass += base[i] * reached[i]
    for k in range(size):
        total = 0.0
        for i in range(m):
            v = base[i] * reached[i] * columns[k, i]
            w[i] = v
            total += v * y[i]
        b[k] = total
        for j in range(k, size):
            total = 0.0
            for i in range(m):
                total += w[i] * columns[j, i]
            a[k, j], a[j, k] = total, total
        a[k, k] += mass * (WEAK + ties[k]) if mass > 0.0 else 1.0
    return mass


@_plain
def _loss(r, g, inverse):
    total, product = 0.0, 1.0
    for i in range(len(r)):
        product *= 1.0 + r[i] * r[i] * g[i] * inverse
        if product > 1e100:  # one logarithm for many factors
            total += math.log(product)
            product = 1.0
    return total + math.log(product)


@_plain
def _apart(loss, normals, s, found):
    for k in range(s.starts):
        best = 0
        for j in range(len(loss)):
            if loss[j] < loss[best]:
                best = j
        if not loss[best] < np.inf:
            found[k:] = found[0]
            return
        found[k] = normals[best]
        n0, n1, n2 = normals[best]
        for j in range(len(loss)):
            if n0 * normals[j, 0] + n1 * normals[j, 1] + n2 * normals[j, 2] > s.apart:
                loss[j] = np.inf


@_plain
def _search(y, g, usual, width, candidates, s, found):
    m, size, count = y.shape[1], len(candidates.ties), len(candidates.normals)
    base, w, r, loss = np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(count)
    a, b, x, z = np.zeros((size, size)), np.zeros(size), np.zeros(size), np.zeros(size)
    small, passive, at = np.zeros((size + 1, size)), np.zeros(size, np.bool_), np.zeros(size, np.int64)
    inverse = 1.0 / (s.yard * s.yard)
    for p in range(len(y)):
        for i in range(m):
            base[i] = g[p, i] / (s.soft * s.soft + y[p, i] * y[p, i])
        for j in range(count):
            columns = candidates.columns[j]
            mass = _fill(columns, base, candidates.reached[j], y[p], candidates.ties, w, a, b)
            x[:] = 0.0
            nnls(a, b, size, 0, x, mass, passive, at, small, z)
            fill_residuals(y[p], columns, x, size, r)
            total = 0.0
            for k in range(size - 1):
                total += x[k]
            away = (math.log(max(total, LEAST_AMOUNT)) - usual[p]) / width
            loss[j] = math.log(LEAST_LOSS + _loss(r, g[p], inverse)) + s.pull * math.log1p(away * away)
        _apart(loss, candidates.normals, s, found[p])


def search(
    y: FloatArray, g: FloatArray, usual: FloatArray, width: float, candidates: Candidates, s: SearchSettings
) -> FloatArray:
    """Return the normals to start from; see :func:`psstereo.kernels.exemplar_search.search`."""
    found = np.zeros((len(y), s.starts, 3))
    _search(y, g, usual, float(width), candidates, s, found)
    return found
