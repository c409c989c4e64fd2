"""Multigrid on a pixel grid, compiled: the twin of :mod:`psstereo.kernels.multigrid`.

Loops run along rows without a branch and write to one row only, so that the compiler can take sixteen pixels at once;
what a pass needs of the rows around stays in the nearest cache.
"""

from typing import Any

import numba
import numpy as np

__all__ = ["correct_relax", "invert", "relax_first", "relax_last", "restrict_residual"]

_compile = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})


@_compile
def _residual_row(
    east: Any,
    south: Any,
    southeast: Any,
    southwest: Any,
    prior: Any,
    i: int,
    width: int,
    up: Any,
    mid: Any,
    down: Any,
    right_side: Any,
    out: Any,
) -> None:
    """Put right side minus A value on row i; the values come as three rows."""
    e, below, above = east[i], south[i], south[i - 1]
    for j in range(1, width + 1):
        out[j] = right_side[j] - e[j] * (mid[j] - mid[j + 1]) - e[j - 1] * (mid[j] - mid[j - 1])
    for j in range(1, width + 1):
        out[j] -= below[j] * (mid[j] - down[j]) + above[j] * (mid[j] - up[j])
    if southeast.size > 0:
        se, nw = southeast[i], southeast[i - 1]
        for j in range(1, width + 1):
            out[j] -= se[j] * (mid[j] - down[j + 1]) + nw[j - 1] * (mid[j] - up[j - 1])
        sw, ne = southwest[i], southwest[i - 1]
        for j in range(1, width + 1):
            out[j] -= sw[j] * (mid[j] - down[j - 1]) + ne[j + 1] * (mid[j] - up[j + 1])
    if prior.size > 0:
        held = prior[i]
        for j in range(1, width + 1):
            out[j] -= held[j] * mid[j]


@_compile
def invert(
    east: Any,
    south: Any,
    southeast: Any,
    southwest: Any,
    prior: Any,
    inverse: Any,
    tiny: float,
    first: int,
    last: int,
) -> None:
    """Fill the smoother's scale; see :func:`psstereo.kernels.multigrid.invert`."""
    width = east.shape[1] - 3
    for i in range(first, last):
        for j in range(1, width + 1):
            a, b, c, d = east[i, j], east[i, j - 1], south[i, j], south[i - 1, j]
            diagonal = a + b + c + d
            magnitude = abs(a) + abs(b) + abs(c) + abs(d)
            if southeast.size > 0:
                a, b, c, d = southeast[i, j], southeast[i - 1, j - 1], southwest[i, j], southwest[i - 1, j + 1]
                diagonal += a + b + c + d
                magnitude += abs(a) + abs(b) + abs(c) + abs(d)
            if prior.size > 0:
                diagonal += prior[i, j]
                magnitude += prior[i, j]
            if diagonal > tiny * magnitude:
                inverse[i, j] = 1.0 / max(diagonal, 0.5 * (diagonal + magnitude))
            else:
                inverse[i, j] = 0.0


@_compile
def _scaled_row(inverse: Any, right_side: Any, i: int, step: Any, width: int, out: Any) -> None:
    a, b = inverse[i], right_side[i]
    for j in range(1, width + 1):
        out[j] = step * a[j] * b[j]


@_compile
def relax_first(
    east: Any,
    south: Any,
    southeast: Any,
    southwest: Any,
    prior: Any,
    inverse: Any,
    right_side: Any,
    one: Any,
    two: Any,
    value: Any,
    first: int,
    last: int,
) -> None:
    """Do both steps of the smoother from zero; see :func:`psstereo.kernels.multigrid.relax_first`."""
    width = east.shape[1] - 3
    up, mid = np.zeros(width + 3, value.dtype), np.zeros(width + 3, value.dtype)
    down, out = np.zeros(width + 3, value.dtype), np.zeros(width + 3, value.dtype)
    _scaled_row(inverse, right_side, first - 1, one, width, up)
    _scaled_row(inverse, right_side, first, one, width, mid)
    for i in range(first, last):
        _scaled_row(inverse, right_side, i + 1, one, width, down)
        _residual_row(east, south, southeast, southwest, prior, i, width, up, mid, down, right_side[i], out)
        scale, found = inverse[i], value[i]
        for j in range(1, width + 1):
            found[j] = mid[j] + two * scale[j] * out[j]
        up, mid, down = mid, down, up


@_compile
def restrict_residual(
    east: Any,
    south: Any,
    southeast: Any,
    southwest: Any,
    prior: Any,
    shares: Any,
    value: Any,
    right_side: Any,
    coarse: Any,
    first: int,
    last: int,
) -> None:
    """Fill rows of the coarse right side; see :func:`psstereo.kernels.multigrid.restrict_residual`."""
    height, width, wide = east.shape[0] - 3, east.shape[1] - 3, coarse.shape[1] - 3
    above, here = np.zeros(width + 4, value.dtype), np.zeros(width + 4, value.dtype)
    below = np.zeros(width + 4, value.dtype)
    if first > 1:
        i = 2 * first - 2
        _residual_row(
            east,
            south,
            southeast,
            southwest,
            prior,
            i,
            width,
            value[i - 1],
            value[i],
            value[i + 1],
            right_side[i],
            above,
        )
    for k in range(first, last):
        i = 2 * k - 1
        _residual_row(
            east,
            south,
            southeast,
            southwest,
            prior,
            i,
            width,
            value[i - 1],
            value[i],
            value[i + 1],
            right_side[i],
            here,
        )
        i += 1
        if i <= height:
            _residual_row(
                east,
                south,
                southeast,
                southwest,
                prior,
                i,
                width,
                value[i - 1],
                value[i],
                value[i + 1],
                right_side[i],
                below,
            )
        else:
            below[:] = 0.0
        out = coarse[k]
        p0, p1, p2, p4, p5 = shares[0, k], shares[1, k], shares[2, k], shares[4, k], shares[5, k]
        p3, p6, p7 = shares[3, k - 1], shares[6, k - 1], shares[7, k - 1]
        for m in range(1, wide + 1):
            out[m] = here[2 * m - 1] + p0[m] * here[2 * m] + p1[m - 1] * here[2 * m - 2]
        for m in range(1, wide + 1):
            out[m] += p2[m] * below[2 * m - 1] + p4[m] * below[2 * m] + p5[m - 1] * below[2 * m - 2]
        for m in range(1, wide + 1):
            out[m] += p3[m] * above[2 * m - 1] + p6[m] * above[2 * m] + p7[m - 1] * above[2 * m - 2]
        above, below = below, above


@_compile
def _corrected_row(shares: Any, coarse: Any, value: Any, i: int, width: int, wide: int, out: Any) -> None:
    """Put row i of the values plus the interpolated coarse values."""
    row = value[i]
    if i % 2 == 1:
        k = (i + 1) // 2
        a, b, top = shares[0, k], shares[1, k], coarse[k]
        for m in range(1, wide + 1):
            out[2 * m - 1] = row[2 * m - 1] + top[m]
            out[2 * m] = row[2 * m] + a[m] * top[m] + b[m] * top[m + 1]
    else:
        k = i // 2
        u, v, a, b = shares[2, k], shares[3, k], shares[4, k], shares[5, k]
        c, d, top, bottom = shares[6, k], shares[7, k], coarse[k], coarse[k + 1]
        for m in range(1, wide + 1):
            out[2 * m - 1] = row[2 * m - 1] + u[m] * top[m] + v[m] * bottom[m]
            out[2 * m] = row[2 * m] + a[m] * top[m] + b[m] * top[m + 1] + c[m] * bottom[m] + d[m] * bottom[m + 1]
    out[width + 1] = 0.0


@_compile
def correct_relax(
    east: Any,
    south: Any,
    southeast: Any,
    southwest: Any,
    prior: Any,
    inverse: Any,
    shares: Any,
    coarse: Any,
    right_side: Any,
    step: Any,
    value: Any,
    result: Any,
    first: int,
    last: int,
) -> None:
    """Add the coarse correction and do a step; see :func:`psstereo.kernels.multigrid.correct_relax`."""
    height, width, wide = east.shape[0] - 3, east.shape[1] - 3, coarse.shape[1] - 3
    up, mid = np.zeros(width + 4, value.dtype), np.zeros(width + 4, value.dtype)
    down, out = np.zeros(width + 4, value.dtype), np.zeros(width + 3, value.dtype)
    if first > 1:
        _corrected_row(shares, coarse, value, first - 1, width, wide, up)
    _corrected_row(shares, coarse, value, first, width, wide, mid)
    for i in range(first, last):
        if i < height:
            _corrected_row(shares, coarse, value, i + 1, width, wide, down)
        else:
            down[:] = 0.0
        _residual_row(east, south, southeast, southwest, prior, i, width, up, mid, down, right_side[i], out)
        scale, found = inverse[i], result[i]
        for j in range(1, width + 1):
            found[j] = mid[j] + step * scale[j] * out[j]
        up, mid, down = mid, down, up


@_compile
def relax_last(
    east: Any,
    south: Any,
    southeast: Any,
    southwest: Any,
    prior: Any,
    inverse: Any,
    right_side: Any,
    step: Any,
    value: Any,
    result: Any,
    sums: Any,
    first: int,
    last: int,
) -> None:
    """Do the last step of the smoother; see :func:`psstereo.kernels.multigrid.relax_last`."""
    width = east.shape[1] - 3
    out = np.zeros(width + 3, value.dtype)
    for i in range(first, last):
        mid, own = value[i], right_side[i]
        _residual_row(east, south, southeast, southwest, prior, i, width, value[i - 1], mid, value[i + 1], own, out)
        scale, found = inverse[i], result[i]
        for j in range(1, width + 1):
            found[j] = mid[j] + step * scale[j] * out[j]
        if sums.size > 0:
            total = 0.0
            for j in range(1, width + 1):
                total += np.float64(found[j]) * np.float64(own[j])
            sums[i] = total
