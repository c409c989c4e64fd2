"""Costs of matches and their smoothing along paths, compiled: the twin of :mod:`psstereo.kernels.matching`.

Sixteen bits a value, and labels innermost in memory: so the loops over labels become vector instructions. Indices there
are unsigned, or pieces of arrays are taken before, since an index that might be negative would keep them scalar.
"""

from typing import Any

import numpy as np
from numba import njit

__all__ = ["aggregate", "pair_costs", "winners"]

_U8, _U16, _I16, _U32 = np.uint8, np.uint16, np.int16, np.uint32
_INDEX = np.uintp
_ZERO = np.int16(0)
_FAR = np.uint16(30000)
_MOST = np.uint16(65535)

_loop: Any = njit(nogil=True, cache=True, error_model="numpy")


@_loop
def _add(total, count, value, low, high, others, channel, begin, top):
    """Add the truncated distance between a value and others, each known to lie within an interval."""
    for i in range(count):
        j = begin + _INDEX(i)
        o = others[channel, _INDEX(0), j]
        there = max(_I16(value - others[channel, _INDEX(2), j]), _I16(others[channel, _INDEX(1), j] - value))
        here = max(_I16(o - high), _I16(low - o))
        total[_INDEX(i)] = _I16(total[_INDEX(i)] + max(_ZERO, min(there, here, top)))


@_loop
def pair_costs(left, right, first, tops, multiplier, rows, cost):
    """Fill some rows of a cost volume; see :func:`psstereo.kernels.matching.pair_costs`."""
    count, width = cost.shape[2], left.shape[3]
    total = np.zeros(count, np.int16)
    sum_of_tops = np.int64(0)
    for k in range(len(tops)):
        sum_of_tops += tops[k]
    outside = _U8((sum_of_tops * np.int64(multiplier)) >> 16)
    for y in range(rows[0], rows[1]):
        here, there = left[y], right[y]
        for x in range(width):
            out = cost[y, x]
            a, b = max(0, x - width + 1 - first), min(count, x - first + 1)
            number = b - a
            if number < count:
                out[:] = outside
            if number <= 0:
                continue
            for i in range(number):
                total[_INDEX(i)] = _ZERO
            begin = _INDEX(width - 1 - x + first + a)
            for k in range(len(tops)):
                _add(total, number, here[k, 0, x], here[k, 1, x], here[k, 2, x], there, _INDEX(k), begin, tops[k])
            for i in range(number):
                out[_INDEX(a + i)] = _U8((_U32(total[_INDEX(i)]) * multiplier) >> _U32(16))


@_loop
def _step(cost, before, lowest, small, large, after, total, fresh):
    """Go one pixel along a path; return the lowest of the new values."""
    limit, least = _U16(lowest + large), _FAR
    for i in range(len(cost)):
        near = _U16(min(before[i], before[i + 2]) + small)
        v = _U16(_U16(cost[i]) + _U16(min(before[i + 1], limit, near) - lowest))
        after[i + 1] = v
        total[i] = v if fresh else _U16(total[i] + v)
        least = min(least, v)
    return least


@_loop
def aggregate(cost, small, across, along, forward, diagonal, total):
    """Sum the path costs of one half of the directions; see :func:`psstereo.kernels.matching.aggregate`."""
    height, width, count = cost.shape
    before = np.full((3, width + 2, count + 2), _FAR, np.uint16)
    after = np.full((3, width + 2, count + 2), _FAR, np.uint16)
    before[:, :, 1 : count + 1] = 0
    after[:, :, 1 : count + 1] = 0
    lowest, lower = np.zeros((3, width + 2), np.uint16), np.zeros((3, width + 2), np.uint16)
    run = np.full((2, count + 2), _FAR, np.uint16)
    step = _U16(small)
    for j in range(height):
        y = j if forward else height - 1 - j
        run[:, 1 : count + 1] = 0
        least, side = _U16(0), 0
        for i in range(width):
            x = i if forward else width - 1 - i
            c, t = cost[y, x], total[y, x]
            least = _step(c, run[side], least, step, across[y, x], run[1 - side], t, True)
            side = 1 - side
            large = along[y, x]
            lower[1, x + 1] = _step(c, before[1, x + 1], lowest[1, x + 1], step, large, after[1, x + 1], t, False)
            if diagonal:
                lower[0, x + 1] = _step(c, before[0, x], lowest[0, x], step, large, after[0, x + 1], t, False)
                lower[2, x + 1] = _step(c, before[2, x + 2], lowest[2, x + 2], step, large, after[2, x + 1], t, False)
        before, after = after, before
        lowest, lower = lower, lowest


@_loop
def _least(values, start):
    for i in range(len(values)):
        start = min(start, values[i])
    return start


@_loop
def _sum(a, b, out):
    for i in range(len(out)):
        out[i] = _U16(a[i] + b[i])


@_loop
def _lower(values, label, best, chosen):
    """Keep, for the pixels of the other image, the lowest value so far and its label; both run backwards."""
    last = len(values) - 1
    for i in range(len(values)):
        v = values[last - i]
        better = v < best[i]
        best[i] = v if better else best[i]
        chosen[i] = _I16(label + last - i) if better else chosen[i]


@_loop
def winners(one, two, first, paired, rows, label, margin, other):
    """Choose the cheapest label of each pixel; see :func:`psstereo.kernels.matching.winners`."""
    _, width, count = one.shape
    total = np.zeros(count, np.uint16)
    best, chosen = np.zeros(width, np.uint16), np.zeros(width, np.int16)
    for y in range(rows[0], rows[1]):
        best[:] = _MOST
        chosen[:] = -1
        for x in range(width):
            a, b = 0, count
            if paired:
                a, b = max(0, x - width + 1 - first), min(count, x - first + 1)
            if b <= a:
                label[y, x], margin[y, x] = np.nan, 0.0
                continue
            _sum(one[y, x], two[y, x], total)
            part = total[a:b]
            low = _least(part, _MOST)
            at = 0
            while part[at] != low:
                at += 1
            second = _least(part[: max(at - 1, 0)], _MOST)
            second = _least(part[at + 2 :], second)
            margin[y, x] = (float(second) - float(low)) / max(float(second), 1.0)
            shift = 0.0
            if 0 < at < len(part) - 1:
                before, behind = float(part[at - 1]) - float(low), float(part[at + 1]) - float(low)
                steeper = max(before, behind)
                shift = 0.5 * (before - behind) / steeper if steeper > 0 else 0.0
            label[y, x] = a + at + shift
            if paired:
                start = x - first - b + 1
                _lower(part, a, best[start : start + b - a], chosen[start : start + b - a])
        if paired:
            for x in range(width):
                other[y, x] = np.nan if chosen[x] < 0 else float(chosen[x])
