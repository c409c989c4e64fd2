"""Exemplar materials fitted to every pixel, compiled: the twin of :mod:`psstereo.kernels.exemplar`.

One pixel at a time, all its rounds within the nearest caches.
"""

import math
from typing import Any, NamedTuple

import numba
import numpy as np

from psstereo.kernels.bipolynomial_compiled import select
from psstereo.kernels.exemplar_spread_compiled import fill_spread, tie
from psstereo.kernels.exemplar_steps_compiled import (
    fill_lobes,
    fill_mixed,
    fill_residuals,
    fill_system,
    fill_turns,
    median,
    nnls,
    reached,
    weigh,
)
from psstereo.kernels.exemplar_terms import (
    CUBED,
    DAMPING,
    DARK_SHARE,
    FAILED,
    LEAST_HEIGHT,
    MAD,
    SETTLED,
    UNSETTLED,
    Dictionary,
    Fit,
    Settings,
    no_fit,
)
from psstereo.kernels.misfit import Sky
from psstereo.kernels.misfit_compiled import misfit_work
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["fit_pixels"]

_plain: Any = numba.njit(nogil=True, cache=True, error_model="numpy")


class _Work(NamedTuple):
    """Arrays that all pixels use in turn, so that none is made anew."""

    rows: FloatArray  # residuals, weights, sizes, cosines, half cosines, and three derivatives (8, m)
    parts: FloatArray  # lobes (k, m)
    columns: FloatArray  # exemplars, and how their sum changes along the tangents (q + 2, m)
    a: FloatArray
    b: FloatArray
    small: FloatArray
    z: FloatArray
    passive: BoolArray
    at: IntArray
    across: FloatArray  # tangents (2, 3)
    lobes: FloatArray  # amounts (k,)
    ties: FloatArray
    trail: FloatArray  # states of the last rounds (3, q + 3)


@_plain
def _tangents(n, across):
    """Fill two unit vectors across n; see :func:`psstereo.kernels.exemplar_lobes.tangents`."""
    level = n[0] * n[0] + n[1] * n[1]
    across[0, 0], across[0, 1], across[0, 2] = 1.0, 0.0, 0.0
    if level > 0.0:
        length = math.sqrt(level)
        across[0, 0], across[0, 1] = -n[1] / length, n[0] / length
    across[1, 0] = n[1] * across[0, 2] - n[2] * across[0, 1]
    across[1, 1] = n[2] * across[0, 0] - n[0] * across[0, 2]
    across[1, 2] = n[0] * across[0, 1] - n[1] * across[0, 0]


@_plain
def _columns(n, x, table, d, work):
    """Fill what each exemplar shows, and in the two last columns how the sum changes along the tangents."""
    size = len(d.ties)
    _tangents(n, work.across)
    for k in range(len(d.kinds)):
        work.lobes[k] = x[k] if d.mix.shape[0] == 0 else 0.0
        for q in range(d.mix.shape[0]):
            work.lobes[k] += x[q] * d.mix[q, k]
    own = work.columns[:size]
    parts = own if d.mix.shape[0] == 0 else work.parts
    by = work.rows[5:8]
    fill_lobes(n, table, d.kinds, d.shapes, d.mix, work.lobes, work.rows[3], work.rows[4], parts, by)
    fill_mixed(d.mix, work.parts, own)
    fill_turns(table, work.across, by, work.columns[size], work.columns[size + 1])


@_plain
def _loss(r, g, scale):
    """Return the sum of the logarithms of one plus the squared residuals over the scale."""
    total, product, inverse = 0.0, 1.0, 1.0 / (scale * scale)
    for i in range(len(r)):
        product *= 1.0 + r[i] * r[i] * g[i] * inverse
        if product > 1e100:  # one logarithm for many factors
            total += math.log(product)
            product = 1.0
    return total + math.log(product)


@_plain
def _evidence(y, g, start, table, top, scale, left, r):
    """Return how much less the loss is than that of Lambert's law with the start; r is overwritten."""
    for i in range(len(y)):
        shade = start[0] * table[0, i] + start[1] * table[1, i] + start[2] * table[2, i]
        r[i] = y[i] - max(shade, 0.0) / top
    total, inverse = 0.0, 1.0 / (scale * scale)
    for i in range(len(y)):
        mine, its = r[i] * r[i] * g[i] * inverse, left[i] * left[i] * g[i] * inverse
        total += mine / (1.0 + mine) - its / (1.0 + its)
    return total


@_plain
def _prolong(n, x, trail, known, s):
    """Prolong a step, in place, by the secant of the last two; return by how much.

    Not where steps become longer, or an amount has come or gone: there the last two are of different kinds.
    `trail` has a row each for the state before the step, for the step before, and for where that one led.
    """
    size = trail.shape[1] - 3
    top, bottom, square, last = 0.0, 0.0, 0.0, 0.0
    for e in range(3):
        step = n[e] - trail[0, size + e]
        change = step - trail[1, size + e]
        top += step * change
        bottom += change * change
        square += step * step
        last += trail[1, size + e] ** 2
    known = known and square < last
    for q in range(size):
        known = known and (x[q] > 0.0) == (trail[0, q] > 0.0)
    more = min(max(-top / bottom, -0.5), s.reach) if known and bottom > 0.0 else 0.0
    for q in range(size + 3):
        now = x[q] if q < size else n[q - size]
        further = now + more * (now - trail[2, q])
        trail[1, q], trail[2, q] = now - trail[0, q], now
        if q < size:
            x[q] = max(further, 0.0)
        else:
            n[q - size] = further
    return more


@_plain
def _round(y, g, first, table, d, s, n, x, k, scale, work):
    """Move n and x by one step; return scale and step, infinite if it fails, and whether the light serves."""
    r, w, sizes, cosine = work.rows[0], work.rows[1], work.rows[2], work.rows[3]
    a, b, size, turns = work.a, work.b, len(d.ties), 0 if k < 0 else 2
    if k < 0:
        w[:] = first
    else:
        if reached(g, cosine, s.dark) < s.least:
            return scale, 1.0, False
        if k < s.freeze:
            scale = max(s.tuning * MAD * median(r, g, cosine, s.dark, sizes), s.floor)
        weigh(r, g, cosine, s.dark, 1.0 / (scale * scale), w)
    tie(d, scale, work.ties)
    mass = fill_system(work.columns[: size + turns], w, y, work.ties, sizes, a, b)
    for q in range(size + 3):
        work.trail[0, q] = x[q] if q < size else n[q - size]
    for e in range(turns):
        a[size + e, size + e] *= 1.0 + DAMPING
        x[size + e] = 0.0
    if not nnls(a, b, size + turns, turns, x, mass, work.passive, work.at, work.small, work.z):
        return scale, 1.0, False
    if k < 0:
        return scale, 1.0, True
    step = math.hypot(x[size], x[size + 1])
    part = min(1.0, s.longest / max(step, 1e-300))
    _climb(n, work.across, part * x[size], part * x[size + 1])
    return scale, step, True


@_plain
def _descend(y, g, first, table, d, s, n, x, work):
    """Run rounds from n; return scale, loss, last step and whether it is sound. The first only fits the amounts."""
    size, a, r = len(d.ties), work.a, work.rows[0]
    x[:] = 0.0
    scale, step, known = s.floor, 1.0, False
    for k in range(-1, s.rounds):
        _columns(n, x, table, d, work)
        fill_residuals(y, work.columns, x, size, r)
        scale, step, sound = _round(y, g, first, table, d, s, n, x, k, scale, work)
        if not sound:
            return scale, 0.0, step, False
        if k + 1 < s.freeze:
            continue
        if step <= s.tolerance:
            break
        near = k >= s.freeze and step < s.near
        if near:
            more = _prolong(n, x, work.trail, known, s)
            _climb(n, work.across, 0.0, 0.0)
            u, v, whole = x[size], x[size + 1], 1.0 + max(more, 0.0)
            told = u * u * a[size, size] + 2.0 * u * v * a[size, size + 1] + v * v * a[size + 1, size + 1]
            if known and whole * whole * told <= (s.told * scale) ** 2:
                break
        known = near
    _columns(n, x, table, d, work)
    fill_residuals(y, work.columns, x, size, r)
    return scale, _loss(r, g, s.yard), step, True


@_plain
def _climb(n, across, first, second):
    """Turn a normal, in place, and keep it facing the camera."""
    for e in range(3):
        n[e] += first * across[0, e] + second * across[1, e]
    n[2] = max(n[2], LEAST_HEIGHT)
    length = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    for e in range(3):
        n[e] /= length


@_plain
def _prepare(row, weight, s, y, g, first, sizes):
    """Fill brightness, gates and first weights; return the brightness taken for one, 0 if the pixel is left alone."""
    usable = 0
    for i in range(len(row)):
        v = row[i]
        ok = v == v and abs(v) < np.inf and weight[i] > 0.0
        y[i] = v if ok else 0.0
        g[i] = weight[i] if ok else 0.0
        if ok:
            sizes[usable] = v
            usable += 1
    if usable < s.least:
        return 0.0
    top = select(sizes, usable, int(s.top * (usable - 1) + 0.5))
    if not top > 0.0:
        return 0.0
    count, mass = 0, 0.0
    for i in range(len(row)):
        lit = g[i] > 0.0 and y[i] / top > s.level
        y[i] /= top
        g[i] = g[i] if lit else 0.0
        if lit:
            sizes[count] = y[i]
            count += 1
            mass += g[i]
    if count < s.least:
        return 0.0
    low = select(sizes, count, int(s.low * (count - 1) + 0.5))
    for i in range(len(row)):
        g[i] *= count / mass
        first[i] = g[i] if y[i] >= low else 0.0
    return top


@_plain
def _facing(y, g, table, n):
    """Put the mean of the half vectors, weighted by the cube of brightness, into n; upright if there is none."""
    n[:] = 0.0
    for i in range(len(y)):
        v = min(y[i], CUBED) ** 3 if g[i] > 0.0 else 0.0
        for e in range(3):
            n[e] += v * table[3 + e, i]
    length = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    if length > 0.0 and n[2] > 0.0:
        for e in range(3):
            n[e] /= length
    else:
        n[0], n[1], n[2] = 0.0, 0.0, 1.0


@_plain
def _best(y, g, first, start, table, d, s, n, x, other, x_other, work):
    """Descend from the start, and if that is poor from where a mirror would face; n, x hold the better."""
    scale, loss, step, sound = s.floor, 0.0, 1.0, False
    length = math.sqrt(start[0] ** 2 + start[1] ** 2 + start[2] ** 2)
    for attempt in range(2):
        if attempt == 0:
            for k in range(3):
                other[k] = start[k] / length
            _climb(other, work.across, 0.0, 0.0)
        else:
            _facing(y, g, table, other)
        scale_now, loss_now, step_now, sound_now = _descend(y, g, first, table, d, s, other, x_other, work)
        if attempt == 0 or (sound_now and (not sound or loss_now < s.better * loss)):
            scale, loss, step, sound = scale_now, loss_now, step_now, sound_now
            n[:], x[:] = other, x_other
        if sound and scale <= s.poor:
            break
    return scale, loss, step, sound


@_plain
def _pixels(
    values, weights, start, tables, d, s, cell, alike, normal, amounts, spread, outcome, share, scales, evidence, losses
):
    p, m = values.shape
    size, count = len(d.ties), len(d.kinds)
    y, g, first, one = np.zeros(m), np.zeros(m), np.zeros(m), np.ones(m)
    n, other, x, x_other = np.zeros(3), np.zeros(3), np.zeros(size + 2), np.zeros(size + 2)
    work = _Work(
        np.zeros((8, m)),
        np.zeros((count, m)),
        np.zeros((size + 2, m)),
        np.zeros((size + 2, size + 2)),
        np.zeros(size + 2),
        np.zeros((size + 3, size + 2)),
        np.zeros(size + 2),
        np.zeros(size + 2, np.bool_),
        np.zeros(size + 2, np.int64),
        np.zeros((2, 3)),
        np.zeros(count),
        np.zeros(size),
        np.zeros((3, size + 3)),
    )
    tell, more = misfit_work(size + 2, m, len(alike)), np.zeros(3)
    for j in range(p):
        table = tables[j if len(tables) > 1 else 0]
        weight = weights[j] if weights.size else one
        for i in range(m):
            if values[j, i] - values[j, i] == 0.0 and weight[i] > 0.0:
                share[j, i] = DARK_SHARE
        top = _prepare(values[j], weight, s, y, g, first, work.rows[2])
        length = start[j, 0] ** 2 + start[j, 1] ** 2 + start[j, 2] ** 2
        if top == 0.0 or not (length > 0.0 and length < np.inf):
            continue
        scale, loss, step, sound = _best(y, g, first, start[j], table, d, s, n, x, other, x_other, work)
        outcome[j] = (SETTLED if step <= s.settled else UNSETTLED) if sound else FAILED
        if not sound:
            continue
        normal[j], scales[j], losses[j] = n, scale, loss
        for k in range(size):
            amounts[j, k] = x[k] * top
        _columns(n, x, table, d, work)
        fill_spread(y, g, x, size, d, s.dark, scale, work, cell, alike, tell, more, spread[j], share[j])
        evidence[j] = _evidence(y, g, start[j], table, top, scale, work.rows[0], work.rows[1])


def fit_pixels(
    values: FloatArray,
    weights: FloatArray,
    start: FloatArray,
    table: FloatArray,
    dictionary: Dictionary,
    settings: Settings,
    sky: Sky | None = None,
) -> Fit:
    """Fit exemplars to pixels; see :func:`psstereo.kernels.exemplar.fit_pixels`."""
    tables = np.ascontiguousarray(table if table.ndim == 3 else table[None])  # so that there is one kind to compile
    p, m = values.shape
    out = no_fit(p, m, len(dictionary.ties))
    cell, alike = (np.zeros(0, np.int64), np.zeros((0, 0))) if sky is None else sky
    _pixels(values, weights, start, tables, dictionary, settings, cell, alike, *out)
    return out
