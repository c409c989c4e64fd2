"""One linearisation of shape from shading, compiled: the twin of :mod:`psstereo.kernels.shading_step`.

Each pass goes down its rows and keeps the flows of three rows, since a row's sum needs those above and below it.
"""

import math
from typing import Any

import numpy as np
from numba import njit

__all__ = ["gradient", "linearise", "multiply"]


@njit(nogil=True, cache=True, error_model="numpy")
def linearise(
    s: Any,
    east: Any,
    south: Any,
    target: Any,
    weight: Any,
    dark: Any,
    frame: Any,
    light: Any,
    bending: float,
    kappa: float,
    area: float,
    pull: Any,
    along: Any,
    down: Any,
    stiff: Any,
    tension: Any,
    sums: Any,
    first: int,
    last: int,
) -> None:
    """Fill rows; see :func:`psstereo.kernels.shading_step.linearise`."""
    width = s.shape[1]
    c0, b0, b1, b2 = light[0], light[1], light[2], light[3]
    qxx, qyy, qzz, qxy, qxz, qyz = light[4], light[5], light[6], light[7], light[8], light[9]
    for i in range(first, last):
        bright, bent, stretched = 0.0, 0.0, 0.0
        for j in range(width):
            e, w = east[i, j], j > 0 and east[i, j - 1]
            d, u = south[i, j], i > 0 and south[i - 1, j]
            own = s[i, j]
            right = s[i, j + 1] - own if e else 0.0
            left = own - s[i, j - 1] if w else 0.0
            below = s[i + 1, j] - own if d else 0.0
            above = own - s[i - 1, j] if u else 0.0
            share_x = 0.5 if e and w else 1.0
            share_y = 0.5 if d and u else 1.0
            p, q = share_x * (right + left), share_y * (below + above)
            ax = frame[0, 0, 0] + frame[0, 1, 0] * j + frame[0, 2, 0] * i
            ay = frame[0, 0, 1] + frame[0, 1, 1] * j + frame[0, 2, 1] * i
            az = frame[0, 0, 2] + frame[0, 1, 2] * j + frame[0, 2, 2] * i
            bx = frame[1, 0, 0] + frame[1, 1, 0] * j + frame[1, 2, 0] * i
            by = frame[1, 0, 1] + frame[1, 1, 1] * j + frame[1, 2, 1] * i
            bz = frame[1, 0, 2] + frame[1, 1, 2] * j + frame[1, 2, 2] * i
            nx = ax * p + bx * q + frame[2, 0, 0] + frame[2, 1, 0] * j + frame[2, 2, 0] * i
            ny = ay * p + by * q + frame[2, 0, 1] + frame[2, 1, 1] * j + frame[2, 2, 1] * i
            nz = az * p + bz * q + frame[2, 0, 2] + frame[2, 1, 2] * j + frame[2, 2, 2] * i
            square = nx * nx + ny * ny + nz * nz
            over = 1.0 / math.sqrt(square)
            na, nb = (nx * ax + ny * ay + nz * az) / square, (nx * bx + ny * by + nz * bz) / square
            nx, ny, nz = nx * over, ny * over, nz * over
            mx = qxx * nx + qxy * ny + qxz * nz
            my = qxy * nx + qyy * ny + qyz * nz
            mz = qxz * nx + qyz * ny + qzz * nz
            misfit = c0 + (b0 + mx) * nx + (b1 + my) * ny + (b2 + mz) * nz - target[i, j]
            tx, ty, tz = over * (b0 + 2.0 * mx), over * (b1 + 2.0 * my), over * (b2 + 2.0 * mz)
            off = tx * nx + ty * ny + tz * nz
            tx, ty, tz = tx - off * nx, ty - off * ny, tz - off * nz
            heavy = weight[i, j]
            if not ((e or w) and (d or u)) or (dark[i, j] and misfit <= 0.0):
                heavy = 0.0
            slope_p, slope_q = tx * ax + ty * ay + tz * az, tx * bx + ty * by + tz * bz
            curve = 0.0
            if e and w:
                curve += (right - left) ** 2
            if d and u:
                curve += (below - above) ** 2
            twist = 0.0
            if e and d and east[i + 1, j] and south[i, j + 1]:
                twist += (s[i + 1, j + 1] - s[i + 1, j] - right) ** 2
            if w and d and east[i + 1, j - 1] and south[i, j - 1]:
                twist += (s[i + 1, j] - s[i + 1, j - 1] - left) ** 2
            if e and u and east[i - 1, j] and south[i - 1, j + 1]:
                twist += (s[i - 1, j + 1] - s[i - 1, j] - right) ** 2
            if w and u and east[i - 1, j - 1] and south[i - 1, j - 1]:
                twist += (s[i - 1, j] - s[i - 1, j - 1] - left) ** 2
            curve += 0.5 * twist
            if kappa == 0.0:
                lagged = bending
            elif kappa == 1.0:
                lagged = bending / (square * square)
            else:
                lagged = bending * square ** (-2.0 * kappa)
            length = math.sqrt(1.0 + 0.5 * (right * right + left * left + below * below + above * above))
            fade = -2.0 * kappa * lagged * curve
            pull[0, i, j] = share_x * (heavy * misfit * slope_p + fade * na)
            pull[1, i, j] = share_y * (heavy * misfit * slope_q + fade * nb)
            root = math.sqrt(heavy)
            along[i, j] = share_x * root * slope_p
            down[i, j] = share_y * root * slope_q
            stiff[i, j] = lagged
            tension[i, j] = area / length
            bright += heavy * misfit * misfit
            bent += lagged * curve
            if e or w or d or u:
                stretched += area * (length - 1.0)
        sums[i, 0], sums[i, 1], sums[i, 2] = bright, bent, stretched


@njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _flows(
    v: Any, pad: int, east: Any, south: Any, stiff: Any, i: int, ex: Any, ey: Any, bx: Any, by: Any, tw: Any
) -> None:
    """Write a row's steps to the right and down, and its bending and twisting moments."""
    height, width = east.shape
    own = v[i + pad]
    for j in range(width - 1):
        ex[j + 1] = east[i, j] * (own[j + 1 + pad] - own[j + pad])
    if i + 1 < height:
        low = v[i + 1 + pad]
        for j in range(width):
            ey[j + 1] = south[i, j] * (low[j + pad] - own[j + pad])
    else:
        ey[:] = 0.0
    for j in range(1, width):
        bx[j + 1] = stiff[i, j] * (east[i, j] * east[i, j - 1]) * (ex[j + 1] - ex[j])
    if 0 < i < height - 1:
        high, low = v[i - 1 + pad], v[i + 1 + pad]
        for j in range(width):
            both = south[i, j] * south[i - 1, j]
            by[j + 1] = stiff[i, j] * both * (low[j + pad] - 2.0 * own[j + pad] + high[j + pad])
    else:
        by[:] = 0.0
    if i + 1 < height:
        low = v[i + 1 + pad]
        for j in range(width - 1):
            whole = east[i, j] * east[i + 1, j] * south[i, j] * south[i, j + 1]
            corners = stiff[i, j] + stiff[i, j + 1] + stiff[i + 1, j] + stiff[i + 1, j + 1]
            tw[j + 1] = 0.5 * corners * whole * (low[j + 1 + pad] - low[j + pad] - own[j + 1 + pad] + own[j + pad])
    else:
        tw[:] = 0.0


@njit(nogil=True, cache=True, error_model="numpy")
def gradient(
    s: Any,
    east: Any,
    south: Any,
    free: Any,
    pull: Any,
    stiff: Any,
    tension: Any,
    prior: Any,
    prior_weight: Any,
    out: Any,
    sums: Any,
    first: int,
    last: int,
) -> None:
    """Fill rows; see :func:`psstereo.kernels.shading_step.gradient`."""
    height, width = s.shape
    ex, ey, bx, by, tw = (
        np.zeros((3, width + 2)),
        np.zeros((3, width + 2)),
        np.zeros((3, width + 2)),
        np.zeros((3, width + 2)),
        np.zeros((3, width + 2)),
    )
    for k in range(max(first - 1, 0), first + 1):
        _flows(s, 0, east, south, stiff, k, ex[k % 3], ey[k % 3], bx[k % 3], by[k % 3], tw[k % 3])
    for i in range(first, last):
        if i + 1 < height:
            k = i + 1
            _flows(s, 0, east, south, stiff, k, ex[k % 3], ey[k % 3], bx[k % 3], by[k % 3], tw[k % 3])
        here, over, under = i % 3, (i + 2) % 3, (i + 1) % 3
        energy = 0.0
        flow = 0.0
        for j in range(width):
            before = flow
            flow = 0.0
            if east[i, j]:
                flow = pull[0, i, j] + pull[0, i, j + 1] + bx[here, j + 1] - bx[here, j + 2] - tw[here, j + 1]
                if i > 0:
                    flow += tw[over, j + 1]
                flow += 0.25 * (tension[i, j] + tension[i, j + 1]) * ex[here, j + 1]
            total = before - flow
            if south[i, j]:
                total -= pull[1, i, j] + pull[1, i + 1, j] + by[here, j + 1] - by[under, j + 1]
                total -= 0.25 * (tension[i, j] + tension[i + 1, j]) * ey[here, j + 1]
            if i > 0 and south[i - 1, j]:
                total += pull[1, i - 1, j] + pull[1, i, j] + by[over, j + 1] - by[here, j + 1]
                total += 0.25 * (tension[i - 1, j] + tension[i, j]) * ey[over, j + 1]
            if prior_weight.size > 0:
                away = s[i, j] - prior[i, j]
                total += prior_weight[i, j] * away
                energy += prior_weight[i, j] * away * away
            out[i, j] = -total if free[i, j] else 0.0
        sums[i] = energy


@njit(nogil=True, cache=True, error_model="numpy")
def multiply(
    east: Any,
    south: Any,
    free: Any,
    along: Any,
    down: Any,
    stiff: Any,
    tension: Any,
    diagonal: Any,
    direction: Any,
    out: Any,
    sums: Any,
    first: int,
    last: int,
) -> None:
    """Fill rows; see :func:`psstereo.kernels.shading_step.multiply`."""
    height, width = out.shape
    shape = (3, width + 2)
    ex, ey, bx, by, tw = (
        np.zeros(shape, np.float32),
        np.zeros(shape, np.float32),
        np.zeros(shape, np.float32),
        np.zeros(shape, np.float32),
        np.zeros(shape, np.float32),
    )
    fx, fy = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    flow_x, flow_y, flow_u = np.zeros(width + 1, np.float32), np.zeros(width, np.float32), np.zeros(width, np.float32)
    for k in range(max(first - 2, 0), last + 1):
        # Row k's steps first; its forces need the steps from above, which are those of row k − 1.
        if k < height:
            m = k % 3
            _flows(direction, 1, east, south, stiff, k, ex[m], ey[m], bx[m], by[m], tw[m])
            if k >= first - 1:
                above = ey[(k + 2) % 3]
                for j in range(width):
                    up = above[j + 1] if k > 0 else np.float32(0.0)
                    change = along[k, j] * (ex[m, j + 1] + ex[m, j]) + down[k, j] * (ey[m, j + 1] + up)
                    fx[m, j + 1] = along[k, j] * change
                    fy[m, j + 1] = down[k, j] * change
        i = k - 1
        if i < first - 1 or i < 0:
            continue
        here, over, under = i % 3, (i + 2) % 3, (i + 1) % 3
        quarter = np.float32(0.25)
        if i + 1 < height:
            for j in range(width):
                flow = fy[here, j + 1] + fy[under, j + 1] + by[here, j + 1] - by[under, j + 1]
                flow += quarter * (tension[i, j] + tension[i + 1, j]) * ey[here, j + 1]
                flow_y[j] = south[i, j] * flow
        else:
            flow_y[:] = 0.0
        if i >= first:
            for j in range(width - 1):
                flow = fx[here, j + 1] + fx[here, j + 2] + bx[here, j + 1] - bx[here, j + 2] - tw[here, j + 1]
                if i > 0:
                    flow += tw[over, j + 1]
                flow += quarter * (tension[i, j] + tension[i, j + 1]) * ex[here, j + 1]
                flow_x[j + 1] = east[i, j] * flow
            product = 0.0
            own = direction[i + 1]
            for j in range(width):
                right = flow_x[j + 1] if j < width - 1 else np.float32(0.0)
                total = flow_x[j] - right + flow_u[j] - flow_y[j] + diagonal[i, j] * own[j + 1]
                out[i, j] = free[i, j] * total
                product += out[i, j] * np.float64(own[j + 1])
            sums[i] = product
        flow_u[:] = flow_y
