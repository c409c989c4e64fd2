"""Which solvers are tried on a capture, in the order of what they cost, and no more of them than can pay.

The simplest law whose residuals are noise needs no rival: Lambert's, or Lambert's and a level of light from all around.
Where neither holds, a few solvers of growing richness are tried. The one for bivariate reflectances is not among them:
on path-traced scenes of many materials the exemplars were nearer to the truth nearly everywhere, in less time.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from psstereo.errors import PsstereoError
from psstereo.lights import Rig
from psstereo.normals import Gate, LeastSquares, NormalSolver, Robust, Samples
from psstereo.normals.ambient import AmbientLeastSquares
from psstereo.normals.bipolynomial import BiPolynomial
from psstereo.normals.exemplar import Exemplar
from psstereo.normals.response_bend import ResponseBend
from psstereo.normals.trimmed import Trimmed
from psstereo.plan.evidence import Evidence, evidence, trouble
from psstereo.plan.sample import Sample
from psstereo.plan.trials import Attempt, Trial, attempt, judged
from psstereo.types import FloatArray

__all__ = ["CONTESTANTS", "LAMBERT_HOLDS", "lambert_holds", "run_trials"]

CONTESTANTS: tuple[type[NormalSolver[Any]], ...] = (
    LeastSquares,
    Trimmed,
    AmbientLeastSquares,
    Robust,
    ResponseBend,
    BiPolynomial,
    Exemplar,
)
"""Solvers, the quickest first and the richest last."""

LAMBERT_HOLDS = 0.03
"""Share of pixels with structured residuals up to which least squares with its gate is as good as anything."""
_BRIGHT = 0.005
"""Share of observations brighter than the fit, beyond noise, up to which it has followed no shadow."""
_TRIED = 128
"""Pixels tried: materials cannot be told from many fewer."""
_PAIRS = 192
"""Pairs of neighbours on which a level beside Lambert's law is tested."""


def lambert_holds(misfit: float | None, bright_outliers: float | None) -> bool:
    """Return whether least squares with its gate needs no rival."""
    if misfit is None or bright_outliers is None:
        return False
    return misfit <= LAMBERT_HOLDS and bright_outliers <= _BRIGHT


def run_trials(
    sample: Sample, rig: Rig, said: Evidence, pixels: int, gate: Gate | None
) -> tuple[tuple[Trial, ...], tuple[float | None, float | None]]:
    """Try solvers on a few pixels of a sample, if least squares leaves more than noise.

    Parameters
    ----------
    sample : Sample
        The sample.
    rig : Rig
        Distant lights.
    said : Evidence
        What least squares leaves over.
    pixels : int
        Pixels of the capture.
    gate : Gate or None
        Gate of all solvers, if one was asked for.

    Returns
    -------
    trials : tuple of Trial
        One a solver that was tried; empty where least squares needs no rival, and that of the ambient solver alone
        where Lambert's law with a level needs none.
    ambient : (float or None, float or None)
        Ambient level over albedo, and its standard error; None where it was not looked for [1].
    """
    nothing: tuple[float | None, float | None] = (None, None)
    if len(rig) < Robust.pays_from or lambert_holds(said.misfit, said.bright_outliers):
        return (), nothing
    values, weights = _few(sample)
    kinds = [kind for kind in CONTESTANTS if len(rig) >= kind.pays_from]
    if _level_holds(sample, rig, gate):
        kinds = [AmbientLeastSquares]
    tried = [attempt(_gated(kind, gate), rig, values, pixels) for kind in kinds]
    found = [one for one in tried if one is not None]
    level = next((_level(one) for one in found if one.ambient is not None), nothing)
    return judged(found, rig, values, weights), level


def _gated(kind: type[NormalSolver[Any]], gate: Gate | None) -> NormalSolver[Any]:
    return kind() if gate is None else kind(gate=gate)


def _level_holds(sample: Sample, rig: Rig, gate: Gate | None) -> bool:
    """Return whether Lambert's law and a level of each pixel leave nothing but noise, by some pairs of neighbours."""
    first = np.flatnonzero((sample.neighbours[:, 0] >= 0) & np.isfinite(sample.albedo))
    if len(first) == 0:
        return False
    first = first[np.unique(np.linspace(0, len(first) - 1, min(_PAIRS, len(first))).astype(np.intp))]
    both, count = np.concatenate([first, sample.neighbours[first, 0]]), len(first)
    values = np.ascontiguousarray(sample.values[:, both])
    solver = _gated(AmbientLeastSquares, gate)
    try:
        found = solver.solve(solver.prepare(rig), Samples(values))
    except PsstereoError:  # lights on one circle, for instance, tell no level
        return False
    if found.ambient is None:
        return False
    albedo = np.linalg.norm(found.scaled, axis=1)
    beside = np.full((2 * count, 2), -1)
    beside[:count, 0] = np.arange(count, 2 * count)
    with np.errstate(invalid="ignore", divide="ignore"):
        normals = found.scaled / albedo[:, None]
    residual = values - np.maximum(rig.directions @ found.scaled.T, 0.0) - found.ambient
    pairs = replace(sample, values=values, neighbours=beside, normals=normals, albedo=albedo, residual=residual)
    said = evidence(pairs)
    return lambert_holds(said.misfit, said.bright_outliers)


def _few(sample: Sample) -> tuple[FloatArray, FloatArray]:
    """Return the samples of a few pixels with a fit, and for how many pixels each of them stands, 1 on average.

    Every other one is drawn evenly, the rest by what least squares leaves: where it leaves nothing all solvers agree,
    and shadows that only few pixels have decide about the mean error of all.
    """
    fitted = np.flatnonzero(np.isfinite(sample.albedo))
    left = trouble(sample)[fitted]
    mean = float(left.mean()) if len(left) else 0.0
    chance = 0.5 * (1.0 + left / mean) if mean > 0 else np.ones(len(fitted))
    count = min(_TRIED, len(fitted))
    steps = (np.arange(count) + 0.5) * chance.sum() / max(count, 1)
    drawn = np.minimum(np.searchsorted(np.cumsum(chance), steps), len(fitted) - 1)
    return np.ascontiguousarray(sample.values[:, fitted[drawn]]), 1.0 / chance[drawn]


def _level(found: Attempt) -> tuple[float | None, float | None]:
    """Return the median ambient level over albedo, and the standard error of that median."""
    if found.ambient is None:
        return None, None
    with np.errstate(invalid="ignore", divide="ignore"):
        share = found.ambient / np.linalg.norm(found.scaled, axis=1)
    share = share[np.isfinite(share)]
    if len(share) < 2:
        return None, None
    middle = float(np.median(share))
    spread = 1.4826 * float(np.median(np.abs(share - middle)))
    return middle, 1.2533 * spread / float(np.sqrt(len(share)))
