"""Usable pixels and steps between neighbours, compiled: the twin of :mod:`psstereo.kernels.poisson_steps`."""

import math
from typing import Any

import numba
import numpy as np

from psstereo.kernels.poisson_steps import (
    AWAY,
    BAD_WEIGHT,
    INSIDE,
    NO_NORMAL,
    SHORTEST,
    SMALLEST_COSINE,
    SMALLEST_WEIGHT,
    UNWEIGHED,
)

__all__ = ["classify", "components", "edge_row", "place_row", "steps", "unit_row"]

# NaN and infinity must be seen: only flags that keep them.
_compile = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz"})


@_compile
def _split_row(normals: Any, i: int, left: int, out: Any) -> None:
    """Put a row of vectors as three rows of components."""
    row, xs, ys, zs = normals[i], out[0], out[1], out[2]
    for j in range(out.shape[1]):
        xs[j] = row[left + j, 0]
        ys[j] = row[left + j, 1]
        zs[j] = row[left + j, 2]


@_compile
def unit_row(normals: Any, top: int, left: int, inside: Any, i: int, out: Any) -> None:
    """Put the unit normals of a row as three rows of components; zero outside."""
    _split_row(normals, top + i, left, out)
    used, xs, ys, zs = inside[i], out[0], out[1], out[2]
    for j in range(used.shape[0]):
        # By the largest component first, so that squares neither overflow nor vanish.
        scale = 1.0 / max(abs(xs[j]), abs(ys[j]), abs(zs[j]), SHORTEST)
        x, y, z = xs[j] * scale, ys[j] * scale, zs[j] * scale
        square = x * x + y * y + z * z
        scale = 1.0 / math.sqrt(square if square > 0.0 else 1.0)
        xs[j] = x * scale if used[j] else 0.0
        ys[j] = y * scale if used[j] else 0.0
        zs[j] = z * scale if used[j] else 0.0


@_compile
def place_row(matrix: Any, places: Any, i: int, out: Any) -> None:
    """Put the rays or points of a row as three rows of components."""
    for k in range(3):
        if places.size > 0:
            for j in range(out.shape[1]):
                out[k, j] = places[i, j, k]
        else:
            slope, constant = matrix[k, 0], i * matrix[k, 1] + matrix[k, 2]
            for j in range(out.shape[1]):
                out[k, j] = j * slope + constant


@_compile
def classify(
    normals: Any,
    wanted: Any,
    weights: Any,
    matrix: Any,
    rays: Any,
    state: Any,
    counts: Any,
    first: int,
    last: int,
) -> None:
    """Say of each pixel whether it can be used; see :func:`psstereo.kernels.poisson_steps.classify`."""
    width = wanted.shape[1]
    ray, part = np.zeros((3, width)), np.zeros((3, width))
    for i in range(first, last):
        place_row(matrix, rays, i, ray)
        _split_row(normals, i, 0, part)
        row, asked = state[i], wanted[i]
        for j in range(width):
            x, y, z = part[0, j], part[1, j], part[2, j]
            largest = max(abs(x), abs(y), abs(z))
            # The difference of an infinity or a NaN with itself is a NaN.
            known = (x - x) + (y - y) + (z - z) == 0.0 and largest >= SHORTEST
            scale = 1.0 / max(largest, SHORTEST)
            facing = x * scale * ray[0, j] + y * scale * ray[1, j] + z * scale * ray[2, j] < 0.0
            found = (INSIDE if facing else AWAY) if known else NO_NORMAL
            row[j] = found if asked[j] else 0
        if weights.size > 0:
            weight = weights[i]
            for j in range(width):
                if row[j] == INSIDE:
                    good = weight[j] >= 0.0 and math.isfinite(weight[j])
                    row[j] = (INSIDE if weight[j] > 0.0 else UNWEIGHED) if good else BAD_WEIGHT
        for k in range(6):
            count = 0
            for j in range(width):
                count += row[j] == k
            counts[i, k] = count


@_compile
def edge_row(
    central: bool,
    exponent: float,
    keen: float,
    normal: Any,
    other: Any,
    at: Any,
    place: Any,
    shift: int,
    pairs: Any,
    weight: Any,
    step: Any,
    heavy: Any,
    out: Any,
) -> int:
    """Fill steps and weights of one row of edges, from column j of the first row to j + shift of the other.

    `pairs` and `weight` say what the ends allow. Returns how many of those are lost.
    """
    count = step.shape[0]
    if central:
        for j in range(count):
            k = j + shift
            x, y, z = normal[0, j] + other[0, k], normal[1, j] + other[1, k], normal[2, j] + other[2, k]
            square = x * x + y * y + z * z
            a = -(x * at[0, j] + y * at[1, j] + z * at[2, j])
            b = -(x * place[0, k] + y * place[1, k] + z * place[2, k])
            far_a = at[0, j] * at[0, j] + at[1, j] * at[1, j] + at[2, j] * at[2, j]
            far_b = place[0, k] * place[0, k] + place[1, k] * place[1, k] + place[2, k] * place[2, k]
            out[j] = min(a / math.sqrt(far_a), b / math.sqrt(far_b)) / math.sqrt(square if square > 0.0 else 1.0)
            rise = x * (place[0, k] - at[0, j]) + y * (place[1, k] - at[1, j]) + z * (place[2, k] - at[2, j])
            step[j] = rise / b if out[j] > SMALLEST_COSINE else 0.0
        for j in range(count):
            step[j] = math.log1p(step[j]) if pairs[j] else 0.0
    else:
        for j in range(count):
            k = j + shift
            x, y, z = normal[0, j] + other[0, k], normal[1, j] + other[1, k], normal[2, j] + other[2, k]
            square = x * x + y * y + z * z
            out[j] = z / math.sqrt(square if square > 0.0 else 1.0)
            rise = x * (place[0, k] - at[0, j]) + y * (place[1, k] - at[1, j]) + z * (place[2, k] - at[2, j])
            step[j] = -rise / z if out[j] > SMALLEST_COSINE else 0.0
    if keen > 0.0:
        for j in range(count):
            k = j + shift
            x, y, z = normal[0, j] - other[0, k], normal[1, j] - other[1, k], normal[2, j] - other[2, k]
            loss = 1.0 + keen * (x * x + y * y + z * z)
            weight[j] /= loss * loss
    lost = 0
    if exponent == 2.0:
        for j in range(count):
            heavy[j] = out[j] * out[j] * weight[j]
    elif exponent == 0.0:
        for j in range(count):
            heavy[j] = weight[j]
    else:
        for j in range(count):
            heavy[j] = (max(out[j], 0.0) ** exponent) * weight[j]
    for j in range(count):
        usable = pairs[j] and out[j] > SMALLEST_COSINE and heavy[j] > SMALLEST_WEIGHT
        lost += pairs[j] and not usable
        step[j] = step[j] if usable else 0.0
        heavy[j] = heavy[j] if usable else 0.0
    return lost


@_compile
def _between(inside: Any, weights: Any, i: int, across: int, down: int, pairs: Any, weight: Any, count: int) -> None:
    """Put which edges have both ends in the domain, and the harmonic mean of the ends' weights."""
    a, b = inside[i], inside[i + down]
    for k in range(count):
        pairs[k] = a[k] and b[k + across]
    if weights.size > 0:
        own, next_to = weights[i], weights[i + down]
        for k in range(count):
            total = own[k] + next_to[k + across]
            weight[k] = 2.0 * own[k] * (next_to[k + across] / (total if total > 0.0 else 1.0))
    else:
        weight[:count] = 1.0


@_compile
def steps(
    normals: Any,
    top: int,
    left: int,
    inside: Any,
    weights: Any,
    matrix: Any,
    places: Any,
    central: bool,
    exponent: float,
    keen: float,
    right: Any,
    down: Any,
    right_weight: Any,
    down_weight: Any,
    lost: Any,
    first: int,
    last: int,
) -> None:
    """Fill the steps and weights of the edges; see :func:`psstereo.kernels.poisson_steps.steps`."""
    height, width = inside.shape
    normal, other = np.zeros((3, width)), np.zeros((3, width))
    at, place = np.zeros((3, width)), np.zeros((3, width))
    pairs, weight, out = np.zeros(width, np.bool_), np.zeros(width), np.zeros(width)
    unit_row(normals, top, left, inside, first, normal)
    place_row(matrix, places, first, at)
    for i in range(first, last):
        _between(inside, weights, i, 1, 0, pairs, weight, width - 1)
        lost[i] = edge_row(
            central, exponent, keen, normal, normal, at, at, 1, pairs, weight, right[i], right_weight[i], out
        )
        if i + 1 < height:
            unit_row(normals, top, left, inside, i + 1, other)
            place_row(matrix, places, i + 1, place)
            _between(inside, weights, i, 0, 1, pairs, weight, width)
            lost[i] += edge_row(
                central, exponent, keen, normal, other, at, place, 0, pairs, weight, down[i], down_weight[i], out
            )
            normal, other = other, normal
            at, place = place, at


@_compile
def _root(parents: Any, k: Any) -> Any:
    while parents[k] != k:
        parents[k] = parents[parents[k]]
        k = parents[k]
    return k


@_compile
def components(inside: Any, right_weight: Any, down_weight: Any, labels: Any) -> int:
    """Number the pieces that edges hold together; see :func:`psstereo.kernels.poisson_steps.components`."""
    height, width = inside.shape
    # A piece begins at a pixel with no edge to the left or above; there are no more provisional numbers than these.
    begins = 1
    for i in range(height):
        for j in range(width):
            held = (j > 0 and right_weight[i, j - 1] > 0) or (i > 0 and down_weight[i - 1, j] > 0)
            begins += inside[i, j] and not held
    parents = np.arange(begins).astype(np.int32)
    fresh = 0
    for i in range(height):
        for j in range(width):
            if not inside[i, j]:
                labels[i, j] = 0
                continue
            left = labels[i, j - 1] if j > 0 and right_weight[i, j - 1] > 0 else 0
            above = labels[i - 1, j] if i > 0 and down_weight[i - 1, j] > 0 else 0
            if left == 0 and above == 0:
                fresh += 1
                labels[i, j] = fresh
            elif min(left, above) == 0:
                labels[i, j] = max(left, above)
            else:
                a, b = _root(parents, left), _root(parents, above)
                low = min(a, b)
                parents[max(a, b)] = low
                labels[i, j] = low
    number = 0
    final = np.zeros(begins, np.int32)
    for k in range(1, fresh + 1):
        # A root is the smallest number of its piece, so that it comes first.
        root = _root(parents, k)
        if root == k:
            number += 1
            final[k] = number
        else:
            final[k] = final[root]
    for i in range(height):
        row = labels[i]
        for j in range(width):
            row[j] = final[row[j]]
    return number
