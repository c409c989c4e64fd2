"""Around the cosine transform, compiled: the twin of :mod:`psstereo.kernels.poisson_transform`."""

from typing import Any

import numba
import numpy as np

from psstereo.kernels.poisson_steps import SMALLEST_COSINE
from psstereo.kernels.poisson_steps_compiled import edge_row, place_row, unit_row

__all__ = ["divergence", "divide", "mismatch"]

_SMALLEST_SQUARE = SMALLEST_COSINE**2
_compile = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})


@_compile
def _rise_row(normal: Any, other: Any, at: Any, place: Any, shift: int, step: Any) -> int:
    """Fill the steps of one row of edges in parallel projection; return how many are unusable."""
    lost = 0
    for j in range(step.shape[0]):
        k = j + shift
        x, y, z = normal[0, j] + other[0, k], normal[1, j] + other[1, k], normal[2, j] + other[2, k]
        usable = z > 0.0 and z * z > _SMALLEST_SQUARE * (x * x + y * y + z * z)
        rise = x * (place[0, k] - at[0, j]) + y * (place[1, k] - at[1, j]) + z * (place[2, k] - at[2, j])
        step[j] = -rise / z if usable else 0.0
        lost += 0 if usable else 1
    return lost


@_compile
def divergence(
    normals: Any,
    top: int,
    left: int,
    inside: Any,
    matrix: Any,
    places: Any,
    central: bool,
    out: Any,
    lost: Any,
    first: int,
    last: int,
) -> None:
    """Fill rows of the right side; see :func:`psstereo.kernels.poisson_transform.divergence`."""
    height, width = inside.shape
    normal, other = np.zeros((3, width)), np.zeros((3, width))
    at, place = np.zeros((3, width)), np.zeros((3, width))
    pairs, weight = np.ones(width, np.bool_), np.ones(width)
    cosine, heavy, step = np.zeros(width), np.zeros(width), np.zeros(width)
    begin = max(first - 1, 0)
    unit_row(normals, top, left, inside, begin, normal)
    place_row(matrix, places, begin, at)
    if first > 0:
        out[first] = 0.0
    for i in range(begin, last):
        gone = 0
        if i == 0:
            out[0] = 0.0
        if i >= first:
            along = step[: width - 1]
            if central:
                gone += edge_row(central, 0.0, 0.0, normal, normal, at, at, 1, pairs, weight, along, heavy, cosine)
            else:
                gone += _rise_row(normal, normal, at, at, 1, along)
            row = out[i]
            for j in range(width - 1):
                row[j] -= along[j]
            for j in range(width - 1):
                row[j + 1] += along[j]
        if i + 1 < height:
            unit_row(normals, top, left, inside, i + 1, other)
            place_row(matrix, places, i + 1, place)
            if central:
                more = edge_row(central, 0.0, 0.0, normal, other, at, place, 0, pairs, weight, step, heavy, cosine)
            else:
                more = _rise_row(normal, other, at, place, 0, step)
            gone += more
            if i >= first:
                row = out[i]
                for j in range(width):
                    row[j] -= step[j]
            if i + 1 < last:
                row = out[i + 1]
                if i + 1 > first:
                    row[:] = 0.0
                for j in range(width):
                    row[j] += step[j]
            normal, other = other, normal
            at, place = place, at
        if i >= first:
            lost[i] = gone


@_compile
def divide(spectrum: Any, rows: Any, columns: Any, first: int, last: int) -> None:
    """Divide by the eigenvalues; see :func:`psstereo.kernels.poisson_transform.divide`."""
    for i in range(first, last):
        own, row = rows[i], spectrum[i]
        begin = 0
        if own == 0.0:
            row[0], begin = 0.0, 1
        for j in range(begin, columns.shape[0]):
            row[j] /= own + columns[j]


@_compile
def mismatch(value: Any, right_side: Any, sums: Any, first: int, last: int) -> None:
    """Sum squares; see :func:`psstereo.kernels.poisson_transform.mismatch`."""
    height, width = value.shape
    left = np.zeros(width)
    for i in range(first, last):
        own, wanted = value[i], right_side[i]
        up, low = value[max(i - 1, 0)], value[min(i + 1, height - 1)]
        for j in range(width):
            left[j] = wanted[j] - (own[j] - up[j]) - (own[j] - low[j])
        for j in range(1, width):
            left[j] -= own[j] - own[j - 1]
        for j in range(width - 1):
            left[j] -= own[j] - own[j + 1]
        a = b = 0.0
        for j in range(width):
            a += left[j] * left[j]
            b += wanted[j] * wanted[j]
        sums[i, 0], sums[i, 1] = a, b
