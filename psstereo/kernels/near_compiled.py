"""Fits under lamps near the surface: the compiled twin of :mod:`psstereo.kernels.near`, pixel after pixel."""

import math
from typing import Any

import numpy as np
from numba import njit

from psstereo.kernels.near import FEW, FLOOR, GEMAN_MCCLURE, GRAZING, REACH, SINGULAR, NearFit
from psstereo.types import FloatArray

__all__ = ["fit_near"]


def fit_near(
    values: FloatArray,
    points: FloatArray,
    motion: FloatArray,
    lamps: FloatArray,
    start: FloatArray,
    scale: FloatArray,
    rounds: int,
    loss: int,
) -> NearFit:
    """Fit some pixels; see :func:`psstereo.kernels.near.fit_near`."""
    count = values.shape[1]
    scaled, moments, sums = np.zeros((count, 3)), np.zeros((count, 6)), np.zeros((count, 6))
    numbers = np.zeros((count, 2), np.int64)
    _fit_all(values, points, motion, lamps, start, scale, rounds, loss == GEMAN_MCCLURE, scaled, moments, sums, numbers)
    return NearFit(scaled, moments, *sums.T, *numbers.T)


@njit(nogil=True, cache=True, error_model="numpy")
def _solve(moments: Any, rhs: Any, out: Any) -> None:
    xx, xy, yy, xz, yz, zz = moments[0], moments[1], moments[2], moments[3], moments[4], moments[5]
    tiny = SINGULAR * (xx + yy + zz)
    out[:] = math.nan
    if not xx > tiny:
        return
    l11 = math.sqrt(xx)
    l21, l31 = xy / l11, xz / l11
    d2 = yy - l21 * l21
    if not d2 > tiny:
        return
    l22 = math.sqrt(d2)
    l32 = (yz - l31 * l21) / l22
    d3 = zz - l31 * l31 - l32 * l32
    if not d3 > tiny:
        return
    l33 = math.sqrt(d3)
    u1 = rhs[0] / l11
    u2 = (rhs[1] - l21 * u1) / l22
    u3 = (rhs[2] - l31 * u1 - l32 * u2) / l33
    out[2] = u3 / l33
    out[1] = (u2 - l32 * out[2]) / l22
    out[0] = (u1 - l21 * out[1] - l31 * out[2]) / l11


@njit(nogil=True, cache=True, error_model="numpy")
def _light(point: Any, motion: Any, lamp: Any, a: Any, da: Any) -> None:
    """Write the light vector of one lamp and its derivative along the motion."""
    x, y, z = lamp[0] - point[0], lamp[1] - point[1], lamp[2] - point[2]
    square = x * x + y * y + z * z
    a[:] = 0.0
    da[:] = 0.0
    if not square > 0.0:
        return
    distance = math.sqrt(square)
    cosine = -(lamp[3] * x + lamp[4] * y + lamp[5] * z) / distance
    exponent = lamp[6]
    if not cosine > 0.0:
        return
    lobe = 1.0 if exponent == 0.0 else (cosine if exponent == 1.0 else cosine**exponent)
    along = (x * motion[0] + y * motion[1] + z * motion[2]) / square
    turn = (lamp[3] * motion[0] + lamp[4] * motion[1] + lamp[5] * motion[2]) / distance + cosine * along
    slope = exponent * lobe * turn / cosine
    cube = square * distance
    factor = slope + 3.0 * lobe * along
    a[0], a[1], a[2] = lobe * x / cube, lobe * y / cube, lobe * z / cube
    da[0] = (factor * x - lobe * motion[0]) / cube
    da[1] = (factor * y - lobe * motion[1]) / cube
    da[2] = (factor * z - lobe * motion[2]) / cube


@njit(nogil=True, cache=True, error_model="numpy")
def _accumulate(y: Any, a: Any, weights: Any, moments: Any, rhs: Any) -> None:
    moments[:] = 0.0
    rhs[:] = 0.0
    for i in range(len(y)):
        w = weights[i]
        if w != 0.0:
            x0, x1, x2 = a[i, 0], a[i, 1], a[i, 2]
            moments[0] += w * x0 * x0
            moments[1] += w * x0 * x1
            moments[2] += w * x1 * x1
            moments[3] += w * x0 * x2
            moments[4] += w * x1 * x2
            moments[5] += w * x2 * x2
            rhs[0] += w * y[i] * x0
            rhs[1] += w * y[i] * x1
            rhs[2] += w * y[i] * x2


@njit(nogil=True, cache=True, error_model="numpy")
def _weigh(
    y: Any,
    usable: Any,
    bright: Any,
    a: Any,
    b: Any,
    scale: float,
    geman: bool,
    weights: Any,
    new: Any,
    lit: Any,
    front: Any,
) -> None:
    albedo = math.sqrt(b[0] * b[0] + b[1] * b[1] + b[2] * b[2])
    total = 0.0
    for i in range(len(y)):
        predicted = a[i, 0] * b[0] + a[i, 1] * b[1] + a[i, 2] * b[2]
        limit = 2.0 * GRAZING * math.sqrt(a[i, 0] ** 2 + a[i, 1] ** 2 + a[i, 2] ** 2) * albedo
        lit[i] = usable[i] and predicted > 0.0 and (geman or y[i] > 0.5 * limit)
        front[i] = min(predicted / limit, 1.0) if lit[i] else 0.0
        total += front[i]
    trust = min(max(total - FEW, 0.0), 1.0)
    for i in range(len(y)):
        new[i] = max(front[i], FLOOR) if geman and bright[i] else front[i]
        if new[i] > 0.0 and trust > 0.0:
            t = (y[i] - (a[i, 0] * b[0] + a[i, 1] * b[1] + a[i, 2] * b[2])) / scale
            share = 1.0 / (1.0 + t * t) if geman else max(0.0, 1.0 - (t / REACH) ** 2)
            new[i] *= share * share if trust == 1.0 else (share * share) ** trust
    count = 0
    for i in range(len(y)):
        count += new[i] > 0.0
    if count >= 3:
        weights[:] = new


@njit(nogil=True, cache=True, error_model="numpy")
def _cost(y: Any, usable: Any, a: Any, b: Any, scale: float, geman: bool) -> float:
    total = 0.0
    for i in range(len(y)):
        if usable[i]:
            predicted = a[i, 0] * b[0] + a[i, 1] * b[1] + a[i, 2] * b[2]
            t = (y[i] - (predicted if predicted > 0.0 else 0.0)) / scale
            square = t * t
            total += 1.0 - (1.0 / (1.0 + square) if geman else max(0.0, 1.0 - square / REACH**2) ** 3)
    return total


@njit(nogil=True, cache=True, error_model="numpy")
def _summary(
    y: Any,
    a: Any,
    da: Any,
    b: Any,
    weights: Any,
    lit: Any,
    geman: bool,
    moment: Any,
    room: Any,
    sums: Any,
    numbers: Any,
) -> None:
    """Write what a pixel's final weights tell of the energy along its line of sight, and of its residuals."""
    across, response, rhs, magnitude = room[0, :3], room[1, :3], room[2, :3], room[3]
    room[:] = 0.0
    squares, power, bend, slide = 0.0, 0.0, 0.0, 0.0
    count, used = 0, 0
    for i in range(len(y)):
        residual = y[i] - (a[i, 0] * b[0] + a[i, 1] * b[1] + a[i, 2] * b[2])
        w = weights[i]
        if w > 0.0:
            change = da[i, 0] * b[0] + da[i, 1] * b[1] + da[i, 2] * b[2]
            used += lit[i] or not geman
            bend += w * change * change
            slide += w * change * residual
            squares += w * residual * residual
            power += w * y[i] * y[i]
            for k in range(3):
                across[k] += w * change * a[i, k]
                rhs[k] += w * residual * a[i, k]
        if lit[i]:
            magnitude[count] = abs(residual)
            count += 1
    _solve(moment, across, response)
    stiffness = bend - across[0] * response[0] - across[1] * response[1] - across[2] * response[2]
    sums[1] = slide - response[0] * rhs[0] - response[1] * rhs[1] - response[2] * rhs[2]
    sums[2] = max(stiffness, 0.0) if math.isfinite(stiffness) else math.nan
    sums[3] = squares
    sums[4] = power
    sums[5] = np.sort(magnitude[:count])[(count - 1) // 2] if count > 0 else math.nan
    numbers[1] = used


@njit(nogil=True, cache=True, error_model="numpy")
def _begin(values: Any, point: Any, motion: Any, lamps: Any, y: Any, usable: Any, bright: Any, a: Any, da: Any) -> int:
    """Write a pixel's brightness and light vectors, and return how many observations are numbers."""
    brightest, count = 0.0, 0
    for i in range(len(values)):
        usable[i] = math.isfinite(values[i])
        y[i] = values[i] if usable[i] else 0.0
        brightest = max(brightest, y[i])
        count += usable[i]
        _light(point, motion, lamps[i], a[i], da[i])
    for i in range(len(values)):
        reached = a[i, 0] ** 2 + a[i, 1] ** 2 + a[i, 2] ** 2 > 0.0
        bright[i] = usable[i] and reached and y[i] > GRAZING * brightest
    return count


@njit(nogil=True, cache=True, error_model="numpy")
def _fit_all(
    values: Any,
    points: Any,
    motion: Any,
    lamps: Any,
    start: Any,
    scale: Any,
    rounds: int,
    geman: bool,
    scaled: Any,
    moments: Any,
    sums: Any,
    numbers: Any,
) -> None:
    m = len(values)
    y, weights, new, front = np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m)
    usable, bright, lit = np.zeros(m, np.bool_), np.zeros(m, np.bool_), np.zeros(m, np.bool_)
    a, da, room = np.zeros((m, 3)), np.zeros((m, 3)), np.zeros((4, max(m, 3)))
    begun, rhs = np.zeros(3), np.zeros(3)
    for p in range(values.shape[1]):
        numbers[p, 0] = _begin(values[:, p], points[p], motion[p], lamps, y, usable, bright, a, da)
        for i in range(m):
            weights[i] = 1.0 if bright[i] else 0.0
        b, moment = scaled[p], moments[p]
        b[:] = start[p]
        if not (math.isfinite(b[0]) and math.isfinite(b[1]) and math.isfinite(b[2])):
            _accumulate(y, a, weights, moment, rhs)
            _solve(moment, rhs, b)
        begun[:] = b
        for _ in range(rounds):
            _weigh(y, usable, bright, a, b, scale[p], geman, weights, new, lit, front)
            _accumulate(y, a, weights, moment, rhs)
            _solve(moment, rhs, b)
        if not _cost(y, usable, a, b, scale[p], geman) <= _cost(y, usable, a, begun, scale[p], geman):
            b[:] = begun
        _weigh(y, usable, bright, a, b, scale[p], geman, weights, new, lit, front)
        _accumulate(y, a, weights, moment, rhs)
        _summary(y, a, da, b, weights, lit, geman, moment, room, sums[p], numbers[p])
        sums[p, 0] = _cost(y, usable, a, b, scale[p], geman)
        sums[p, 1] /= scale[p] * scale[p]
        sums[p, 2] /= scale[p] * scale[p]
