"""What a model that does not hold does to a fit, compiled: the twin of :mod:`psstereo.kernels.misfit`.

:func:`misfit` does one pixel, for other compiled loops to call when they know what :func:`misfit_spread` is told.
"""

import math
from typing import Any, NamedTuple

import numba
import numpy as np

from psstereo.kernels.misfit import CERTAIN, CHANCE, FAR, LEAST, NEGLIGIBLE, Sky
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["MisfitWork", "misfit", "misfit_spread", "misfit_work"]

_plain: Any = numba.njit(nogil=True, cache=True, error_model="numpy")
_loop: Any = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})


class MisfitWork(NamedTuple):
    """Arrays that all pixels use in turn, so that none is made anew."""

    at: IntArray  # unknowns that are not held (c,)
    rows: FloatArray  # roots of the gate, residuals, what one full step leaves (3, m)
    gathered: FloatArray  # columns, what is left, and the gate, by cells (c + 2, k)
    related: FloatArray  # the same times the correlation, or its square (c + 2, k)
    factor: FloatArray  # of the matrix (c, c)
    inverse: FloatArray
    product: FloatArray  # X K Xᵀ
    once: FloatArray  # its product with the inverse
    step: FloatArray  # (c,)


@_plain
def misfit_work(unknowns, lights, cells):
    """Return working arrays for so many unknowns, lights and cells."""
    square = (unknowns, unknowns)
    return MisfitWork(
        np.zeros(unknowns, np.int64),
        np.zeros((3, lights)),
        np.zeros((unknowns + 2, cells)),
        np.zeros((unknowns + 2, cells)),
        np.zeros(square),
        np.zeros(square),
        np.zeros(square),
        np.zeros(square),
        np.zeros(unknowns),
    )


@_plain
def _invert(a, at, size, factor, inverse):
    """Fill the inverse of the part of a symmetric matrix that is not held; return whether it has one."""
    for i in range(size):
        for j in range(i + 1):
            rest = a[at[i], at[j]]
            for k in range(j):
                rest -= factor[i, k] * factor[j, k]
            if i > j:
                factor[i, j] = rest / factor[j, j]
            elif not (rest > 0.0 and rest < np.inf):
                return False
            else:
                factor[i, i] = math.sqrt(rest)
    for j in range(size):  # the factor's inverse below the diagonal of `inverse`, then its product with itself
        for i in range(j, size):
            rest = 1.0 if i == j else 0.0
            for k in range(j, i):
                rest -= factor[i, k] * inverse[k, j]
            inverse[i, j] = rest / factor[i, i]
    for i in range(size):
        for j in range(i + 1):
            total = 0.0
            for k in range(i, size):
                total += inverse[k, i] * inverse[k, j]
            factor[i, j] = total
    for i in range(size):
        for j in range(i + 1):
            inverse[i, j] = inverse[j, i] = factor[i, j]
    return True


@_loop
def _dot(a, b):
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@_loop
def _dot3(a, b, c):
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i] * c[i]
    return total


@_loop
def _gather(columns, gate, root, left, cell, at, size, gathered):
    """Put columns and what is left, times the gate's root, and the gate itself into cells."""
    for k in range(size + 2):
        for i in range(gathered.shape[1]):
            gathered[k, i] = 0.0
    for i in range(len(cell)):
        g = cell[i]
        for k in range(size):
            gathered[k, g] += columns[at[k], i] * gate[i]
        gathered[size, g] += left[i] * root[i]
        gathered[size + 1, g] += gate[i]


@_loop
def _relate(gathered, correlation, size, related):
    """Fill the products of the gathered rows with the correlation, of the last with its square."""
    for k in range(size + 2):
        for i in range(len(correlation)):
            related[k, i] = 0.0
    for j in range(len(correlation)):
        row = correlation[j]
        if gathered[size + 1, j] == 0.0:  # no light of this cell takes part
            continue
        for k in range(size + 1):
            value, to = gathered[k, j], related[k]
            for i in range(len(row)):
                to[i] += value * row[i]
        value, to = gathered[size + 1, j], related[size + 1]
        for i in range(len(row)):
            to[i] += value * row[i] * row[i]


@_plain
def _variance(size, spare, plain, work):
    """Return τ², between zero and what explains all that is left over; fills the product ``X K Xᵀ``."""
    mass = work.gathered[size + 1]
    for a in range(size):
        for b in range(a + 1):
            work.product[a, b] = work.product[b, a] = _dot(work.related[a], work.gathered[b])
    trace, twice = 0.0, _dot(work.related[size + 1], mass)
    for i in range(len(mass)):
        trace += mass[i]
    for a in range(size):
        for b in range(size):
            work.once[a, b] = _dot(work.inverse[a, :size], work.product[b, :size])
        trace -= work.once[a, a]
    for a in range(size):
        for b in range(size):
            twice += work.once[a, b] * work.once[b, a]
        twice -= 2.0 * work.inverse[a, a] * _dot3(work.related[a], work.related[a], mass)
        for b in range(a):
            twice -= 4.0 * work.inverse[a, b] * _dot3(work.related[a], work.related[b], mass)
    alike = _dot(work.related[size], work.gathered[size])
    determinant = spare * twice - trace * trace
    if not (plain > 0.0 and trace > 0.0 and determinant > NEGLIGIBLE * spare * twice):
        return 0.0
    by_chance = math.sqrt(2.0 * determinant / (spare + 2.0)) / spare
    rise = ((alike / plain - trace / spare) / by_chance - CHANCE) / (CERTAIN - CHANCE)
    rise = min(max(rise, 0.0), 1.0)
    found = min(max((spare * alike - trace * plain) / determinant, 0.0), plain / trace)
    return found * rise * rise * (3.0 - 2.0 * rise)


@_plain
def _full_step(columns, gate, residuals, far, size, work):
    """Fill the step with the full weight of all observations, and what it leaves."""
    root, r, left = work.rows[0], work.rows[1], work.rows[2]
    for i in range(len(gate)):
        root[i] = math.sqrt(gate[i])
        r[i] = residuals[i] * root[i] if gate[i] > 0.0 else 0.0
        r[i] /= 1.0 + (r[i] / far) ** 2
        left[i] = r[i]
    for a in range(size):
        work.once[0, a] = _dot3(columns[work.at[a]], root, r)
    for a in range(size):
        work.step[a] = _dot(work.inverse[a, :size], work.once[0, :size])
    for a in range(size):
        column, step = columns[work.at[a]], work.step[a]
        for i in range(len(gate)):
            left[i] -= step * column[i] * root[i]


@_plain
def misfit(columns, matrix, free, gate, residuals, influence, scale, cell, correlation, work, told):
    """Write what one pixel's covariance lacks; see :func:`psstereo.kernels.misfit.misfit_spread`."""
    for e in range(3):
        told[e] = 0.0
    size, count, sound = 0, 0, True
    for k in range(len(free)):
        if free[k]:
            work.at[size] = k
            size += 1
    for i in range(len(gate)):
        count += 1 if gate[i] > 0.0 else 0
        sound &= influence[i] - influence[i] == 0.0
    spare = count - size
    if spare < LEAST or not sound or not _invert(matrix, work.at, size, work.factor, work.inverse):
        return
    _full_step(columns, gate, residuals, FAR * scale, size, work)
    left = work.rows[2]
    _gather(columns, gate, work.rows[0], left, cell, work.at, size, work.gathered)
    _relate(work.gathered, correlation, size, work.related)
    variance = _variance(size, spare, _dot(left, left), work)
    for e in range(2):
        for k in range(size):
            work.once[e, k] = _dot(work.inverse[size - 2 + e, :size], work.product[k, :size])
    unlike = 0.0
    for i in range(len(gate)):
        if gate[i] > 0.0:
            unlike += (work.rows[1, i] - influence[i] * work.rows[0, i]) ** 2
    one, two = work.step[size - 2], work.step[size - 1]
    chance = unlike / spare * (work.inverse[size - 2, size - 2] + work.inverse[size - 1, size - 1])
    square = one * one + two * two
    share = 1.0 - chance / square if square > chance else 0.0
    told[0] = variance * _dot(work.once[0, :size], work.inverse[size - 2, :size]) + share * one * one
    told[1] = variance * _dot(work.once[0, :size], work.inverse[size - 1, :size]) + share * one * two
    told[2] = variance * _dot(work.once[1, :size], work.inverse[size - 1, :size]) + share * two * two


@_plain
def _pixels(columns, matrix, free, gate, residuals, influence, scale, cell, correlation, told):
    _, c, m = columns.shape
    work = misfit_work(c, m, len(correlation))
    for j in range(len(gate)):
        misfit(
            columns[j],
            matrix[j],
            free[j],
            gate[j],
            residuals[j],
            influence[j],
            scale[j],
            cell,
            correlation,
            work,
            told[j],
        )


def misfit_spread(
    columns: FloatArray,
    matrix: FloatArray,
    free: BoolArray,
    gate: FloatArray,
    residuals: FloatArray,
    influence: FloatArray,
    scale: FloatArray,
    sky: Sky,
) -> FloatArray:
    """Return what a fit's covariance lacks; see :func:`psstereo.kernels.misfit.misfit_spread`."""
    told = np.zeros((len(gate), 3))
    given = [np.ascontiguousarray(a) for a in (columns, matrix, free, gate, residuals, influence, scale)]
    _pixels(*given, sky.cell, sky.correlation, told)  # of one layout each, so that there is one kind to compile
    return told
