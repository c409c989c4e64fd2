"""Exemplar materials fitted to every pixel: the readable reference.

A pixel's brightness over its `top` quantile is taken for ``Σ_k a_k e_k(n)`` with a_k ≥ 0, the sum of what exemplar
materials e_k would show under a candidate normal n [1]_. Each e_k is a sum of lobes
(:mod:`psstereo.kernels.exemplar_lobes`). The steps are these.

1. **Start.** From the normal that a simpler solver found, and amounts fitted to the lit observations without their
   darkest fifth, among which are cast shadows.
2. **Search.** Rounds of Gauss–Newton steps for the normal and all amounts together, amounts never negative, with the
   loss of Geman and McClure: what the fitted material contradicts loses its weight. The scale is the median of the
   lit residuals for the first `freeze` rounds; then it stays. Reweighting alone comes nearer by the same share in each
   round, so short steps are prolonged by the secant of the last two [3]_. Rounds end where what is left to go, by the
   rate at which steps become shorter, is far less than the residuals can tell.
3. **Second start.** Where the residuals' scale exceeds `poor`, the same from the mean of the half vectors, weighted by
   the cube of brightness: where a mirror would have to face. It is taken if its loss is clearly less.
4. **Spread.** The covariance of the normal with all amounts unknown that are not held at zero, and the variance by the
   influence of the residuals [2]_.

Observations up to `level` of the top are shadow and never take part; those that face away from the light by the fit
take no part in a round.

References
----------
.. [1] Z. Hui, A. C. Sankaranarayanan, "Shape and Spatially-Varying Reflectance Estimation from Virtual Exemplars",
   IEEE TPAMI 39(10), 2017. doi:10.1109/TPAMI.2016.2623613
.. [2] P. J. Huber, E. M. Ronchetti, "Robust Statistics", 2nd ed., Wiley, 2009. doi:10.1002/9780470434697
.. [3] D. G. Anderson, "Iterative Procedures for Nonlinear Integral Equations", Journal of the ACM 12(4), 1965.
   doi:10.1145/321296.321305
"""

from typing import NamedTuple

import numpy as np

from psstereo.kernels.exemplar_lobes import along, lobes, slopes, tangents
from psstereo.kernels.exemplar_nnls import nnls
from psstereo.kernels.exemplar_terms import (
    CUBED,
    DAMPING,
    DARK_SHARE,
    FAILED,
    LEAST_HEIGHT,
    LEAST_SLOPE,
    MAD,
    SETTLED,
    SHORT,
    UNSETTLED,
    WEAK,
    Dictionary,
    Fit,
    Settings,
    no_fit,
)
from psstereo.kernels.misfit import Sky, misfit_spread
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = [
    "CUBED",
    "DAMPING",
    "DARK_SHARE",
    "FAILED",
    "LEAST_HEIGHT",
    "LEAST_SLOPE",
    "MAD",
    "SETTLED",
    "SHORT",
    "UNSETTLED",
    "WEAK",
    "Dictionary",
    "Fit",
    "Settings",
    "fit_pixels",
]

_PART = 256
"""Pixels worked on at once, so that the working arrays stay small."""


def fit_pixels(
    values: FloatArray,
    weights: FloatArray,
    start: FloatArray,
    table: FloatArray,
    dictionary: Dictionary,
    settings: Settings,
    sky: Sky | None = None,
) -> Fit:
    """Fit exemplars to pixels.

    Parameters
    ----------
    values : float64 array (p, m)
        Brightness, a row a pixel; what is not finite is left out.
    weights : float64 array (p, m) or (0, 0)
        Inverse variances up to a factor; all 1 if empty.
    start : float64 array (p, 3)
        Scaled normals to start from; a pixel without one is not fitted.
    table : float64 array (7, m) or (p, 7, m)
        The lights, the same at every pixel or one table a pixel, in whose frame z points at the camera, and so does z
        of the answer; see :func:`psstereo.kernels.exemplar_lobes.lights_table` [1].
    dictionary : Dictionary
        The exemplars.
    settings : Settings
        Numbers of the fit.
    sky : Sky, optional
        How misfits at the lights hang together; the spread is that by noise alone if absent.

    Returns
    -------
    Fit
        Normals, amounts, and what is known of them.
    """
    p, m = values.shape
    out = no_fit(p, m, len(dictionary.ties))
    for first in range(0, p, _PART):
        part = slice(first, first + _PART)
        base = np.ones_like(values[part]) if weights.size == 0 else weights[part]
        model = _Model(table if table.ndim == 2 else table[part], dictionary, sky)
        _part(values[part], base, start[part], model, settings, out.part(part))
    return out


class _Descent(NamedTuple):
    normal: FloatArray  # (p, 3)
    amounts: FloatArray  # (p, q)
    scale: FloatArray  # (p,)
    loss: FloatArray
    step: FloatArray
    sound: BoolArray

    def part(self, pixels: IntArray) -> "_Descent":
        """Return some pixels."""
        normal, amounts, scale = self.normal[pixels], self.amounts[pixels], self.scale[pixels]
        return _Descent(normal, amounts, scale, self.loss[pixels], self.step[pixels], self.sound[pixels])


class _Model:
    """The exemplars under the lights."""

    def __init__(self, table: FloatArray, dictionary: Dictionary, sky: Sky | None = None) -> None:
        self.table, self.dictionary, self.sky = table, dictionary, sky

    def at(self, pixels: IntArray) -> "_Model":
        """Return the model at some pixels."""
        return self if self.table.ndim == 2 else _Model(self.table[pixels], self.dictionary, self.sky)

    def columns(self, normals: FloatArray) -> FloatArray:
        """Return what each exemplar shows, (p, q, m)."""
        d = self.dictionary
        shown = lobes(normals, self.table, d.kinds, d.shapes)
        return shown if d.mix.size == 0 else np.asarray(d.mix @ shown)

    def ties(self, scale: FloatArray, turns: int = 0) -> FloatArray:
        """Return the weight of each squared unknown, (p, q + turns)."""
        d = self.dictionary
        amounts = d.ties + d.noise_ties * scale[:, None] ** 2
        return np.concatenate([amounts, np.zeros((len(scale), turns))], axis=1) + WEAK

    def slopes(self, normals: FloatArray, amounts: FloatArray) -> FloatArray:
        """Return how the sum changes along the two tangents, (p, 2, m)."""
        d, across = self.dictionary, tangents(normals)
        parts = amounts if d.mix.size == 0 else amounts @ d.mix
        by = slopes(normals, self.table, d.kinds, d.shapes, parts)
        light, half = across @ self.table[..., :3, :], across @ self.table[..., 3:6, :]
        turned = light * by[:, :1] + half * by[:, 1:2]
        return np.asarray(turned + across[:, :, 2:] * by[:, 2:])


def _unit(a: FloatArray) -> FloatArray:
    return np.asarray(a / np.sqrt((a * a).sum(axis=1, keepdims=True)))


def _upright(normals: FloatArray) -> FloatArray:
    """Return the normals turned so far that they face the camera, as what it sees must."""
    return _unit(np.concatenate([normals[:, :2], np.maximum(normals[:, 2:], LEAST_HEIGHT)], axis=1))


def _sum(amounts: FloatArray, columns: FloatArray) -> FloatArray:
    return np.asarray((amounts[:, None] @ columns)[:, 0])


def _part(values: FloatArray, weights: FloatArray, start: FloatArray, model: _Model, s: Settings, out: Fit) -> None:
    """Go through the steps of the module's description for a few pixels side by side."""
    y, g, first, top = _prepare(values, weights, s)
    with np.errstate(invalid="ignore"):
        out.share[np.isfinite(values) & (weights > 0)] = DARK_SHARE
        rows = np.flatnonzero((top > 0) & np.isfinite(start).all(axis=1) & (start != 0).any(axis=1))
    if len(rows) == 0:
        return
    y, g, first, top, model = y[rows], g[rows], first[rows], top[rows], model.at(rows)
    found = _descend(y, g, first, _upright(_unit(start[rows])), model, s)
    again = np.flatnonzero(~found.sound | (found.scale > s.poor))
    if len(again):
        near = model.at(again)
        facing = _facing(y[again], g[again], near.table)
        other = _descend(y[again], g[again], first[again], facing, near, s)
        taken = other.sound & (~found.sound[again] | (other.loss < s.better * found.loss[again]))
        for mine, its in zip(found, other, strict=True):
            mine[again[taken]] = its[taken]
    out.outcome[rows] = np.where(found.sound, np.where(found.step <= s.settled, SETTLED, UNSETTLED), FAILED)
    keep = np.flatnonzero(found.sound)
    at = rows[keep]
    spread, share = _spread(y[keep], g[keep], found.part(keep), model.at(keep), s)
    out.normal[at], out.scale[at], out.loss[at] = found.normal[keep], found.scale[keep], found.loss[keep]
    out.amounts[at] = found.amounts[keep] * top[keep, None]
    out.spread[at] = spread
    out.share[at] = np.where(g[keep] > 0, share, out.share[at])
    shade = np.maximum(along(start[at], model.at(keep).table[..., :3, :]), 0.0)
    lambert = y[keep] - shade / top[keep, None]
    left = y[keep] - _sum(found.amounts[keep], model.at(keep).columns(found.normal[keep]))
    out.evidence[at] = _doubt(lambert, g[keep], out.scale[at]) - _doubt(left, g[keep], out.scale[at])


def _prepare(
    values: FloatArray, weights: FloatArray, s: Settings
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return brightness, gates, first weights, and the brightness taken for one, 0 where a pixel is left alone."""
    ok = np.isfinite(values) & (weights > 0)
    y, usable = np.where(ok, values, 0.0), ok.sum(axis=1)
    top = _rank(y, ok, s.top)
    left = (usable >= s.least) & (top > 0)
    top = np.where(left, top, 1.0)
    y = y / top[:, None]
    lit = ok & (y > s.level)
    count = lit.sum(axis=1)
    left &= count >= s.least
    g = np.where(lit, weights, 0.0)
    g *= (count / np.where(left, g.sum(axis=1), 1.0))[:, None]
    first = np.where(y >= _rank(y, lit, s.low)[:, None], g, 0.0)
    return y, g, first, np.where(left, top, 0.0)


def _rank(a: FloatArray, keep: BoolArray, share: float) -> FloatArray:
    """Return the value of a rank, as a share of the highest, among the numbers of each pixel that are kept."""
    count = keep.sum(axis=1)
    at = np.maximum(np.floor(share * (count - 1) + 0.5), 0).astype(np.intp)
    ordered = np.sort(np.where(keep, a, np.inf), axis=1)
    return np.where(count > 0, np.take_along_axis(ordered, at[:, None], axis=1)[:, 0], 0.0)


def _facing(y: FloatArray, g: FloatArray, table: FloatArray) -> FloatArray:
    """Return the mean of the half vectors, weighted by the cube of brightness; upright if there is none."""
    mean = along(np.where(g > 0, np.minimum(y, CUBED), 0.0) ** 3, np.swapaxes(table[..., 3:6, :], -1, -2))
    length = np.sqrt((mean * mean).sum(axis=1))
    lost = ~(length > 0) | ~(mean[:, 2] > 0)
    return np.where(lost[:, None], [0.0, 0.0, 1.0], mean / np.where(lost, 1.0, length)[:, None])


def _reaching(g: FloatArray, normals: FloatArray, model: _Model, s: Settings) -> BoolArray:
    """Return which observations are neither dark nor grazing."""
    return np.asarray((g > 0) & (along(normals, model.table[..., :3, :]) > s.dark))


def _descend(y: FloatArray, g: FloatArray, first: FloatArray, n: FloatArray, model: _Model, s: Settings) -> _Descent:
    """Run rounds from a normal; pixels that have arrived or failed are not looked at again."""
    p, size = len(y), len(model.dictionary.ties)
    ties = model.ties(np.full(p, s.floor))
    amounts = nnls(*_system(model.columns(n), first, y, ties), 0, np.zeros((p, size)), first.sum(axis=1))
    found = _Descent(n.copy(), amounts, np.full(p, s.floor), np.zeros(p), np.ones(p), np.ones(p, np.bool_))
    going: IntArray = np.arange(p)
    trail = _Trail(np.zeros((p, size + 3)), np.zeros((p, size + 3)), np.zeros(p, np.bool_))
    for k in range(s.rounds):
        if len(going) == 0:
            break
        going = _round(y, g, found, going, trail, k, model, s)
    r = y - _sum(found.amounts, model.columns(found.normal))
    found.loss[:] = _loss(r, g, np.full(p, s.yard))
    return found


class _Trail(NamedTuple):
    step: FloatArray  # of the round before, amounts and normal (p, q + 3)
    led: FloatArray  # where it led
    known: BoolArray


def _round(
    y: FloatArray, g: FloatArray, found: _Descent, going: IntArray, trail: _Trail, k: int, model: _Model, s: Settings
) -> IntArray:
    """Move the pixels that are going by one step; return those that have not arrived."""
    size, here = len(model.dictionary.ties), model.at(going)
    now, parts = found.normal[going], found.amounts[going]
    columns, lit = here.columns(now), _reaching(g[going], now, here, s)
    r = y[going] - _sum(parts, columns)
    if k < s.freeze:
        median = _rank(np.abs(r) * np.sqrt(g[going]), lit, 0.5)
        found.scale[going] = np.maximum(s.tuning * MAD * median, s.floor)
    sound = lit.sum(axis=1) >= s.least
    w = np.where(lit, g[going] / (1.0 + r * r * g[going] / found.scale[going, None] ** 2) ** 2, 0.0)
    w = np.where(sound[:, None], w, 1.0)
    full = np.concatenate([columns, here.slopes(now, parts)], axis=1)
    a, b = _system(full, w, y[going], model.ties(found.scale[going], 2))
    a[:, [size, size + 1], [size, size + 1]] *= 1.0 + DAMPING
    x = nnls(a, b, 2, np.concatenate([parts, np.zeros((len(going), 2))], axis=1), w.sum(axis=1))
    step = np.hypot(x[:, size], x[:, size + 1])
    turn = np.minimum(1.0, s.longest / np.maximum(step, 1e-300))[:, None] * x[:, size:]
    moved = _upright(now + (turn[:, None] @ tangents(now))[:, 0])
    arrived = step <= s.tolerance
    near = ~arrived & (step < s.near) & (k >= s.freeze)
    before, after = np.hstack([parts, now]), np.hstack([x[:, :size], moved])
    known = trail.known[going]
    further, more = _prolonged(before, after, trail.step[going], trail.led[going], known, s.reach)
    trail.step[going], trail.led[going], trail.known[going] = after - before, after, near
    after = np.where(near[:, None], further, after)
    told = np.einsum("pi,pij,pj->p", x[:, size:], a[:, size:, size:], x[:, size:])
    arrived |= near & known & ((1.0 + np.maximum(more, 0.0)) ** 2 * told <= (s.told * found.scale[going]) ** 2)
    found.sound[going] = sound
    at = going[sound]
    found.amounts[at], found.normal[at] = after[sound, :size], _upright(after[sound, size:])
    found.step[at] = step[sound]
    return np.asarray(going[sound & (~arrived | (k + 1 < s.freeze))])


def _prolonged(
    before: FloatArray, after: FloatArray, step: FloatArray, led: FloatArray, known: BoolArray, reach: float
) -> tuple[FloatArray, FloatArray]:
    """Return states prolonged by the secant of the last two steps, and by how much.

    Not where steps become longer, or an amount has come or gone: there the last two are of different kinds.
    """
    size = before.shape[1] - 3
    now, last = (after - before)[:, size:], step[:, size:]
    alike = ((after[:, :size] > 0) == (before[:, :size] > 0)).all(axis=1)
    known = known & alike & ((now * now).sum(axis=1) < (last * last).sum(axis=1))
    change = now - last
    bottom = (change * change).sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        more = np.clip(-(now * change).sum(axis=1) / bottom, -0.5, reach)
    more = np.where(known & (bottom > 0), more, 0.0)
    further = after + more[:, None] * (after - led)
    further[:, :size] = np.maximum(further[:, :size], 0.0)
    return further, more


def _loss(r: FloatArray, g: FloatArray, scale: FloatArray) -> FloatArray:
    """Return the sum of the logarithms of one plus the squared residuals over the scale."""
    return np.asarray(np.log1p(r * r * g / (scale * scale)[:, None]).sum(axis=1))


def _system(columns: FloatArray, w: FloatArray, y: FloatArray, ties: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the normal equations of the weighted sum of squares and the ties."""
    weighted = columns * w[:, None]
    tied = np.eye(ties.shape[1]) * (w.sum(axis=1)[:, None] * ties)[:, None]
    return weighted @ columns.transpose(0, 2, 1) + tied, (weighted @ y[..., None])[..., 0]


def _spread(y: FloatArray, g: FloatArray, found: _Descent, model: _Model, s: Settings) -> tuple[FloatArray, FloatArray]:
    """Return the covariance along the tangents, with all amounts unknown that are not zero, and signed weights."""
    columns, lit = model.columns(found.normal), _reaching(g, found.normal, model, s)
    r = y - _sum(found.amounts, columns)
    full = np.concatenate([columns, model.slopes(found.normal, found.amounts)], axis=1)
    a, _ = _system(full, np.where(lit, g, 0.0), y, model.ties(found.scale, 2))
    size = len(model.dictionary.ties)
    free = np.concatenate([found.amounts > 0, np.ones((len(y), 2), np.bool_)], axis=1)
    inverse = np.linalg.inv(np.where(free[:, :, None] & free[:, None], a, np.eye(size + 2)))
    v = r * r * g / found.scale[:, None] ** 2
    weight = np.where(lit, 1.0 / (1.0 + v) ** 2, 0.0)
    count, unknowns = lit.sum(axis=1), free.sum(axis=1)
    influence = (g * (r * weight) ** 2).sum(axis=1)
    slope = np.where(lit, (1.0 - 3.0 * v) / (1.0 + v) ** 3, 0.0).sum(axis=1) / np.maximum(count, 1)
    told = (count > unknowns) & (slope > LEAST_SLOPE)
    with np.errstate(invalid="ignore", divide="ignore"):
        factor = np.where(told, influence / (count - unknowns) / (slope * slope), np.nan)
    spread = np.stack([inverse[:, -2, -2], inverse[:, -2, -1], inverse[:, -1, -1]], axis=1) * factor[:, None]
    if model.sky is not None:
        pull = r * weight / np.where(told, slope, 1.0)[:, None]
        spread += misfit_spread(full, a, free, np.where(lit, g, 0.0), r, pull, found.scale, model.sky)
    return spread, np.where(r < 0, -weight, weight)


def _doubt(r: FloatArray, g: FloatArray, scale: FloatArray) -> FloatArray:
    """Return the sum of the squared residuals over the scale, none of which counts more than one."""
    square = r * r * g / (scale * scale)[:, None]
    return np.asarray((square / (1.0 + square)).sum(axis=1))
