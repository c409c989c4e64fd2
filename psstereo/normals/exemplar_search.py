"""Other starts for pixels that the exemplars fit badly: on metal, a Lambertian start leads many fits astray.

Where the residuals' scale is large, the fit is done again from the best of candidate normals all over the hemisphere,
and the best of all these fits is kept: by the loss that the solver compares starts with, and by how usual the sum of
amounts is on this object. Where two answers far apart are about as good, the error bar reaches from one to the other.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from psstereo.kernels.exemplar_lobes import lobes
from psstereo.kernels.exemplar_search import LEAST_AMOUNT, LEAST_LOSS, Candidates, SearchSettings
from psstereo.kernels.exemplar_terms import FAILED, MAD, Dictionary, Fit, Settings, no_fit
from psstereo.kernels.misfit import Sky
from psstereo.types import FloatArray, IntArray

__all__ = ["Widening", "candidates", "usual_amounts", "widen"]

_CANDIDATES, _STEEPEST = 250, 1.26
"""Candidate normals, and the tilt up to which they lie, evenly: 8° apart up to 72° [rad]."""

_GOLDEN = np.pi * (3.0 - np.sqrt(5.0))
"""Turn from one candidate to the next by which they lie evenly [rad]."""

_POOR = 0.02
"""Scale of the residuals from which other starts are tried, over the pixel's top [1]."""

_LEAD = 0.2
"""Lead that the solver's own start has over others, in the logarithm of the loss [1]."""

_DOUBT, _FAR = 0.1, 0.985
"""Difference of two answers' marks up to which both are held possible, and the cosine of the angle from which they are
two [1]."""

_LEAST_WIDTH = 0.1
"""Least spread of the logarithm of the amounts that is believed [1]."""

_SHARE = 0.25
"""Of the squared angle between two possible answers, what goes into the variance along each tangent [1]."""


@dataclass(frozen=True, eq=False)
class Widening:
    """What a wider search needs.

    Attributes
    ----------
    candidates : Candidates
        The normals.
    usual, width : float
        Mean logarithm of the sum of amounts on the object, and its spread; infinite if nothing is known [1].
    table : float64 array (7, m)
        The lights.
    dictionary : Dictionary
        The exemplars.
    settings : Settings
        Numbers of the fit.
    sky : Sky
        How misfits at the lights hang together.
    fit, search : callable
        The hot loops.
    """

    candidates: Candidates
    usual: float
    width: float
    table: FloatArray
    dictionary: Dictionary
    settings: Settings
    sky: Sky
    fit: Callable[..., Fit]
    search: Callable[..., FloatArray]


def candidates(table: FloatArray, dictionary: Dictionary, settings: Settings) -> Candidates:
    """Return normals all over the hemisphere and what the exemplars show under them.

    Parameters
    ----------
    table : float64 array (7, m)
        The lights.
    dictionary : Dictionary
        Few exemplars, the last of them light from the surroundings.
    settings : Settings
        Numbers of the fit.

    Returns
    -------
    Candidates
        The normals, evenly over the part of the sphere that faces the camera.
    """
    k = np.arange(_CANDIDATES) + 0.5
    away = 2.0 * np.sin(0.5 * _STEEPEST) ** 2 * k / _CANDIDATES
    level = np.sqrt(away * (2.0 - away))
    normals = np.stack([level * np.cos(_GOLDEN * k), level * np.sin(_GOLDEN * k), 1.0 - away], axis=1)
    reached = (normals @ table[:3] > settings.dark).astype(np.float64)
    return Candidates(normals, np.ascontiguousarray(_columns(normals, table, dictionary)), reached, dictionary.ties)


def usual_amounts(totals: FloatArray) -> tuple[float, float]:
    """Return the mean logarithm of the sum of amounts, and its spread, both robust.

    Parameters
    ----------
    totals : float64 array (k,)
        Sums of amounts at pixels all over the object, one or more [brightness over light strength].

    Returns
    -------
    tuple of float
        Median, and the standard deviation that the median absolute deviation tells, 0.1 or more [1].
    """
    logs = np.log(np.maximum(totals, LEAST_AMOUNT))
    middle = float(np.median(logs))
    return middle, max(MAD * float(np.median(np.abs(logs - middle))), _LEAST_WIDTH)


def widen(wide: Widening, values: FloatArray, weights: FloatArray, start: FloatArray, fit: Fit) -> None:
    """Fit the pixels with large residuals from other starts too, and put the best answers into `fit`, in place.

    Parameters
    ----------
    wide : Widening
        Candidates and loops.
    values : float64 array (p, m)
        Brightness.
    weights : float64 array (p, m) or (0, 0)
        Inverse variances up to a factor; all 1 if empty.
    start : float64 array (p, 3)
        Scaled normals by the simpler solver.
    fit : Fit
        From these.
    """
    s = wide.settings
    with np.errstate(invalid="ignore"):
        poor = np.flatnonzero((fit.outcome == FAILED) | ((fit.outcome < FAILED) & ~(fit.scale <= _POOR)))
    if len(poor) == 0:
        return
    values, weights = values[poor], weights[poor] if weights.size else weights
    y, g, top = _lit(values, weights, s)
    usual = wide.usual - np.log(top)
    starts = wide.search(y, g, usual, wide.width, wide.candidates, SearchSettings())
    answers = [Fit._make(a[poor] for a in fit)]
    for k in range(starts.shape[1]):
        answers.append(_again(wide, values, weights, starts[:, k], answers[0]))
    marks = np.array([_mark(wide, one) for one in answers])
    marks[0] -= _LEAD
    best = marks.argmin(axis=0)
    lambert = y - np.maximum(start[poor] @ wide.table[:3], 0.0) / top[:, None]
    for k in range(1, len(answers)):
        took = np.flatnonzero((best == k) & np.isfinite(marks[k]))
        # Error bars take a third of the time, and only what is taken needs them.
        part = _fit(wide, values, weights, answers[k].normal, took, sky=wide.sky)
        stands = np.flatnonzero(part.outcome < FAILED)
        took, part = took[stands], part.part(stands)
        left = _left(wide, part, y[took], top[took])
        part.evidence[:] = _doubt(lambert[took], g[took], part.scale) - _doubt(left, g[took], part.scale)
        for mine, its in zip(fit, part, strict=True):
            mine[poor[took]] = its
    normals = np.array([one.normal for one in answers])
    with np.errstate(invalid="ignore"):
        _hedge(fit, poor, normals, marks - marks[best, np.arange(len(poor))])


def _again(wide: Widening, values: FloatArray, weights: FloatArray, start: FloatArray, first: Fit) -> Fit:
    """Fit from another start, unless the first answer is so near to it that it would be found again."""
    one = no_fit(len(values), values.shape[1], first.amounts.shape[1])
    with np.errstate(invalid="ignore"):
        far = np.flatnonzero(~((start * first.normal).sum(axis=1) > _FAR))
    for mine, its in zip(one, _fit(wide, values, weights, start, far, sky=None), strict=True):
        mine[far] = its
    return one


def _fit(
    wide: Widening, values: FloatArray, weights: FloatArray, start: FloatArray, pixels: IntArray, *, sky: Sky | None
) -> Fit:
    """Fit some pixels from one start each; where a mirror would have to face was tried with the first."""
    settings = wide.settings._replace(poor=np.inf)
    heavy = weights[pixels] if weights.size else weights
    return wide.fit(values[pixels], heavy, start[pixels], wide.table, wide.dictionary, settings, sky)


def _hedge(fit: Fit, poor: IntArray, normals: FloatArray, behind: FloatArray) -> None:
    """Let the error bars reach to other answers that are about as good."""
    with np.errstate(invalid="ignore"):
        cosine = (normals * fit.normal[poor]).sum(axis=2)
        other = (behind <= _DOUBT) & (cosine < _FAR)
        angle = np.where(other, 2.0 * np.arcsin(np.sqrt(np.clip(0.5 * (1.0 - cosine), 0.0, 1.0))), 0.0).max(axis=0)
    two = np.flatnonzero(angle > 0)
    fit.spread[poor[two], 0] += _SHARE * angle[two] ** 2
    fit.spread[poor[two], 2] += _SHARE * angle[two] ** 2


def _columns(normals: FloatArray, table: FloatArray, dictionary: Dictionary) -> FloatArray:
    used = np.flatnonzero((dictionary.mix != 0).any(axis=0))
    shown = lobes(normals, table, dictionary.kinds[used], dictionary.shapes[used])
    return np.asarray(dictionary.mix[:, used] @ shown)


def _lit(values: FloatArray, weights: FloatArray, s: Settings) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return brightness over the top, weights of the lit observations, and the top."""
    ok = np.isfinite(values) if weights.size == 0 else np.isfinite(values) & (weights > 0)
    ordered, usable = np.sort(np.where(ok, values, np.inf), axis=1), ok.sum(axis=1)
    rank = np.maximum(np.floor(s.top * (usable - 1) + 0.5), 0).astype(np.intp)
    top = np.take_along_axis(ordered, rank[:, None], axis=1)[:, 0]
    y = np.where(ok, values, 0.0) / top[:, None]
    lit = ok & (y > s.level)
    g = np.where(lit, 1.0 if weights.size == 0 else weights, 0.0)
    return y, g * (lit.sum(axis=1) / g.sum(axis=1))[:, None], top


def _left(wide: Widening, fit: Fit, y: FloatArray, top: FloatArray) -> FloatArray:
    """Return what fits leave, over the top."""
    shown = _columns(fit.normal, wide.table, wide.dictionary)
    return np.asarray(y - (fit.amounts[:, None] @ shown)[:, 0] / top[:, None])


def _mark(wide: Widening, fit: Fit) -> FloatArray:
    """Return the logarithm of the loss, and what unusual amounts add to it; infinite where there is no fit."""
    with np.errstate(invalid="ignore"):
        loss = np.log(LEAST_LOSS + fit.loss)
        away = (np.log(np.maximum(fit.amounts[:, :-1].sum(axis=1), LEAST_AMOUNT)) - wide.usual) / wide.width
        mark = loss + SearchSettings().pull * np.log1p(away * away)
    return np.where(np.isfinite(mark), mark, np.inf)


def _doubt(r: FloatArray, g: FloatArray, scale: FloatArray) -> FloatArray:
    """Return the sum of the squared residuals over the scale, none of which counts more than one."""
    square = r * r * g / (scale * scale)[:, None]
    return np.asarray((square / (1.0 + square)).sum(axis=1))
