"""Passes of conjugate gradients, compiled: the twin of :mod:`psstereo.kernels.multigrid_krylov`."""

from typing import Any

import numba
import numpy as np

__all__ = ["advance", "multiply", "residual", "turn"]

_compile = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})


@_compile
def residual(
    right_weight: Any,
    down_weight: Any,
    right: Any,
    down: Any,
    prior_weight: Any,
    prior: Any,
    value: Any,
    out: Any,
    first: int,
    last: int,
) -> None:
    """Fill rows of b − A value; see :func:`psstereo.kernels.multigrid_krylov.residual`."""
    height, width = value.shape
    flow = np.zeros(width + 1)
    for i in range(first, last):
        own, o = value[i], out[i]
        w, c = right_weight[i], right[i]
        for j in range(width - 1):
            flow[j + 1] = w[j] * (c[j] - (own[j + 1] - own[j]))
        for j in range(width):
            o[j] = flow[j] - flow[j + 1]
        if i + 1 < height:
            w, c, other = down_weight[i], down[i], value[i + 1]
            for j in range(width):
                o[j] -= w[j] * (c[j] - (other[j] - own[j]))
        if i > 0:
            w, c, other = down_weight[i - 1], down[i - 1], value[i - 1]
            for j in range(width):
                o[j] += w[j] * (c[j] - (own[j] - other[j]))
        if prior_weight.size > 0:
            w, c = prior_weight[i], prior[i]
            for j in range(width):
                o[j] += w[j] * (c[j] - own[j])


@_compile
def multiply(
    right_weight: Any,
    down_weight: Any,
    prior_weight: Any,
    direction: Any,
    out: Any,
    sums: Any,
    first: int,
    last: int,
) -> None:
    """Fill rows of A direction; see :func:`psstereo.kernels.multigrid_krylov.multiply`."""
    height, width = out.shape
    none = np.zeros(width)
    for i in range(first, last):
        up, mid, low = direction[i, 1 : width + 1], direction[i + 1, 1 : width + 1], direction[i + 2, 1 : width + 1]
        below = down_weight[i] if i < height - 1 else none
        above = down_weight[i - 1] if i > 0 else none
        o = out[i]
        for j in range(width):
            own = np.float64(mid[j])
            o[j] = below[j] * (own - np.float64(low[j])) + above[j] * (own - np.float64(up[j]))
        if width > 1:
            w = right_weight[i]
            for j in range(1, width - 1):
                own = np.float64(mid[j])
                o[j] += w[j] * (own - np.float64(mid[j + 1])) + w[j - 1] * (own - np.float64(mid[j - 1]))
            o[0] += w[0] * (np.float64(mid[0]) - np.float64(mid[1]))
            o[width - 1] += w[width - 2] * (np.float64(mid[width - 1]) - np.float64(mid[width - 2]))
        if prior_weight.size > 0:
            w = prior_weight[i]
            for j in range(width):
                o[j] += w[j] * np.float64(mid[j])
        total = 0.0
        for j in range(width):
            total += o[j] * np.float64(mid[j])
        sums[i] = total


@_compile
def advance(
    length: float,
    direction: Any,
    image: Any,
    scale: float,
    value: Any,
    left: Any,
    scaled: Any,
    first: int,
    last: int,
) -> None:
    """Go along the direction; see :func:`psstereo.kernels.multigrid_krylov.advance`."""
    width = value.shape[1]
    for i in range(first, last):
        step, along, x = direction[i + 1, 1 : width + 1], image[i], value[i]
        for j in range(width):
            x[j] += length * np.float64(step[j])
        r, o = left[i], scaled[i + 1, 1 : width + 1]
        for j in range(width):
            r[j] -= length * along[j]
        for j in range(width):
            o[j] = scale * r[j]


@_compile
def turn(value: Any, ratio: float, direction: Any, first: int, last: int) -> None:
    """Take the next direction; see :func:`psstereo.kernels.multigrid_krylov.turn`."""
    width = value.shape[1] - 3
    for i in range(first + 1, last + 1):
        z, p = value[i], direction[i]
        for j in range(1, width + 1):
            p[j] = z[j] + np.float32(ratio) * p[j]
