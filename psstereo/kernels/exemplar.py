"""Exemplar materials fitted to every pixel: the readable reference.

A pixel's brightness over its `top` quantile is taken for ``Σ_k a_k e_k(n)`` with a_k ≥ 0, the sum of what exemplar
materials e_k would show under a candidate normal n [1]_. Each e_k is a sum of lobes
(:mod:`psstereo.kernels.exemplar_lobes`). The steps are these.

1. **Start.** From the normal that a simpler solver found, and amounts fitted to the lit observations without their
   darkest fifth, among which are cast shadows.
2. **Search.** Rounds of Gauss–Newton steps for the normal and all amounts together, amounts never negative, with the
   loss of Geman and McClure: what the fitted material contradicts loses its weight. The scale is the median of the
   lit residuals for the first `freeze` rounds; then it stays.
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
"""

from typing import NamedTuple

import numpy as np

from psstereo.kernels.exemplar_lobes import lobes, slopes, tangents
from psstereo.kernels.exemplar_nnls import nnls
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

SETTLED, UNSETTLED, FAILED, SHORT = 0, 1, 2, 3
"""Outcomes: converged; not; nothing fits; too few lit observations or no start."""
MAD = 1.4826022185056018
"""Standard deviation over the median of the absolute value, of Gaussian noise [1]."""
DAMPING = 1e-3
"""Share by which the normal's diagonal entries are raised."""
WEAK = 1e-8
"""Tie of every unknown, so that amounts of exemplars that look alike are determined."""
LEAST_HEIGHT = 0.02
"""Least z of a normal before it is made a unit vector again."""
CUBED = 3.0
"""Brightness over the top up to which it counts for the mean half vector."""
LEAST_SLOPE = 0.05
"""Mean slope of the residuals' influence from which their variance can be told."""
DARK_SHARE = 3.0
"""What stands for the weight of an observation in shadow."""
_PART = 256
"""Pixels worked on at once, so that the working arrays stay small."""


class Settings(NamedTuple):
    """Numbers of a fit; a plain tuple, so that compiled code takes it as it is."""

    level: float = 0.02  # brightness, as a share of the pixel's top, up to which it counts as shadow
    top: float = 0.95
    low: float = 0.2  # rank of brightness from which observations take part in the start
    dark: float = 0.02  # cosine up to which a light counts as grazing
    tuning: float = 1.0  # where the loss turns, in standard deviations of the residuals
    floor: float = 2e-3  # of the scale, as a share of the top
    poor: float = 0.02  # scale from which a second start is tried
    better: float = 0.6  # loss of the second start, over that of the first, from which on it is taken
    yard: float = 0.02  # scale of the residuals by which two starts are compared
    longest: float = 0.15  # longest step of the normal in a round [rad]
    tolerance: float = 1e-5  # step of the normal at which rounds stop [rad]
    settled: float = 2e-3  # last step up to which a fit counts as converged [rad]
    rounds: int = 24
    freeze: int = 4
    least: int = 12  # lit observations that a fit needs


class Dictionary(NamedTuple):
    """Exemplar materials as sums of lobes; a plain tuple, so that compiled code takes it as it is.

    Attributes
    ----------
    kinds, shapes : int64, float64 arrays (k,)
        The lobes; see :func:`psstereo.kernels.exemplar_lobes.lobes`.
    mix : float64 array (q, k)
        Amount of each lobe in each exemplar; (0, 0) where every lobe is an exemplar of its own.
    ties : float64 array (q,)
        Weight of each squared amount, against a squared residual with the top for one [1].
    noise_ties : float64 array (q,)
        The same in units of the squared scale of the residuals: what the data tell badly is held the more [1].
    """

    kinds: IntArray
    shapes: FloatArray
    mix: FloatArray
    ties: FloatArray
    noise_ties: FloatArray


class Fit(NamedTuple):
    """What was found at some pixels.

    Attributes
    ----------
    normal : float64 array (p, 3)
        Unit normals; NaN where there is no fit.
    amounts : float64 array (p, q)
        Of each exemplar, in the unit of the values.
    spread : float64 array (p, 3)
        Covariance of the normal along :func:`psstereo.kernels.exemplar_lobes.tangents`, entries 11, 12, 22; NaN where
        it cannot be told [rad²].
    outcome : int64 array (p,)
        `SETTLED`, `UNSETTLED`, `FAILED` or `SHORT`.
    share : float64 array (p, m)
        Weight of each observation, 0 … 1, negative for values below the fit; 3 where it is dark, NaN where it is not
        usable.
    scale : float64 array (p,)
        Where the loss turns: `tuning` standard deviations of the residuals that are not outliers, over the top [1].
    evidence : float64 array (p,)
        How much less there is in doubt than by Lambert's law with the start: the sum of the squared residuals over the
        scale, none of which counts more than one, so that a highlight which a robust fit left out is little [1].
    """

    normal: FloatArray
    amounts: FloatArray
    spread: FloatArray
    outcome: IntArray
    share: FloatArray
    scale: FloatArray
    evidence: FloatArray

    def part(self, pixels: slice) -> "Fit":
        """Return views of some pixels' arrays."""
        normal, amounts, spread = self.normal[pixels], self.amounts[pixels], self.spread[pixels]
        outcome, share, scale = self.outcome[pixels], self.share[pixels], self.scale[pixels]
        return Fit(normal, amounts, spread, outcome, share, scale, self.evidence[pixels])


def fit_pixels(
    values: FloatArray,
    weights: FloatArray,
    start: FloatArray,
    table: FloatArray,
    dictionary: Dictionary,
    settings: Settings,
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
    table : float64 array (7, m)
        The lights; see :func:`psstereo.kernels.exemplar_lobes.lights_table`.
    dictionary : Dictionary
        The exemplars.
    settings : Settings
        Numbers of the fit.

    Returns
    -------
    Fit
        Normals, amounts, and what is known of them.
    """
    (p, m), size = values.shape, len(dictionary.ties)
    out = Fit(
        np.full((p, 3), np.nan),
        np.full((p, size), np.nan),
        np.full((p, 3), np.nan),
        np.full(p, SHORT),
        np.full((p, m), np.nan),
        np.full(p, np.nan),
        np.zeros(p),
    )
    for first in range(0, p, _PART):
        part = slice(first, first + _PART)
        base = np.ones_like(values[part]) if weights.size == 0 else weights[part]
        _part(values[part], base, start[part], _Model(table, dictionary), settings, out.part(part))
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

    def __init__(self, table: FloatArray, dictionary: Dictionary) -> None:
        self.table, self.dictionary = table, dictionary

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
        turned = (across @ self.table[:3]) * by[:, :1] + (across @ self.table[3:6]) * by[:, 1:2]
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
    y, g, first, top = y[rows], g[rows], first[rows], top[rows]
    found = _descend(y, g, first, _upright(_unit(start[rows])), model, s)
    again = np.flatnonzero(~found.sound | (found.scale > s.poor))
    if len(again):
        other = _descend(y[again], g[again], first[again], _facing(y[again], g[again], model.table), model, s)
        taken = other.sound & (~found.sound[again] | (other.loss < s.better * found.loss[again]))
        for mine, its in zip(found, other, strict=True):
            mine[again[taken]] = its[taken]
    out.outcome[rows] = np.where(found.sound, np.where(found.step <= s.settled, SETTLED, UNSETTLED), FAILED)
    keep = np.flatnonzero(found.sound)
    at = rows[keep]
    spread, share = _spread(y[keep], g[keep], found.part(keep), model, s)
    out.normal[at], out.scale[at] = found.normal[keep], found.scale[keep]
    out.amounts[at] = found.amounts[keep] * top[keep, None]
    out.spread[at] = spread
    out.share[at] = np.where(g[keep] > 0, share, out.share[at])
    lambert = y[keep] - np.maximum(start[at] @ model.table[:3], 0.0) / top[keep, None]
    left = y[keep] - _sum(found.amounts[keep], model.columns(found.normal[keep]))
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
    mean = np.where(g > 0, np.minimum(y, CUBED), 0.0) ** 3 @ table[3:6].T
    length = np.sqrt((mean * mean).sum(axis=1))
    lost = ~(length > 0) | ~(mean[:, 2] > 0)
    return np.where(lost[:, None], [0.0, 0.0, 1.0], mean / np.where(lost, 1.0, length)[:, None])


def _reaching(g: FloatArray, normals: FloatArray, model: _Model, s: Settings) -> BoolArray:
    """Return which observations are neither dark nor grazing."""
    return np.asarray((g > 0) & (normals @ model.table[:3] > s.dark))


def _descend(y: FloatArray, g: FloatArray, first: FloatArray, n: FloatArray, model: _Model, s: Settings) -> _Descent:
    """Run rounds from a normal; pixels that have arrived or failed are not looked at again."""
    p, size = len(y), len(model.dictionary.ties)
    ties = model.ties(np.full(p, s.floor))
    amounts = nnls(*_system(model.columns(n), first, y, ties), 0, np.zeros((p, size)), first.sum(axis=1))
    found = _Descent(n.copy(), amounts, np.full(p, s.floor), np.zeros(p), np.ones(p), np.ones(p, np.bool_))
    going = np.arange(p)
    for k in range(s.rounds):
        if len(going) == 0:
            break
        now, parts = found.normal[going], found.amounts[going]
        columns, lit = model.columns(now), _reaching(g[going], now, model, s)
        r = y[going] - _sum(parts, columns)
        if k < s.freeze:
            median = _rank(np.abs(r) * np.sqrt(g[going]), lit, 0.5)
            found.scale[going] = np.maximum(s.tuning * MAD * median, s.floor)
        sound = lit.sum(axis=1) >= s.least
        w = np.where(lit, g[going] / (1.0 + r * r * g[going] / found.scale[going, None] ** 2) ** 2, 0.0)
        w = np.where(sound[:, None], w, 1.0)
        full = np.concatenate([columns, model.slopes(now, parts)], axis=1)
        a, b = _system(full, w, y[going], model.ties(found.scale[going], 2))
        a[:, [size, size + 1], [size, size + 1]] *= 1.0 + DAMPING
        x = nnls(a, b, 2, np.concatenate([parts, np.zeros((len(going), 2))], axis=1), w.sum(axis=1))
        step = np.hypot(x[:, size], x[:, size + 1])
        turn = np.minimum(1.0, s.longest / np.maximum(step, 1e-300))[:, None] * x[:, size:]
        moved = now + (turn[:, None] @ tangents(now))[:, 0]
        found.sound[going] = sound
        at = going[sound]
        found.normal[at], found.amounts[at] = _upright(moved[sound]), x[sound, :size]
        found.step[at] = step[sound]
        going = going[sound & ((step > s.tolerance) | (k + 1 < s.freeze))]
    r = y - _sum(found.amounts, model.columns(found.normal))
    found.loss[:] = _loss(r, g, np.full(p, s.yard))
    return found


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
    return spread, np.where(r < 0, -weight, weight)


def _doubt(r: FloatArray, g: FloatArray, scale: FloatArray) -> FloatArray:
    """Return the sum of the squared residuals over the scale, none of which counts more than one."""
    square = r * r * g / (scale * scale)[:, None]
    return np.asarray((square / (1.0 + square)).sum(axis=1))
