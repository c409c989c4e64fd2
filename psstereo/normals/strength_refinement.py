"""Robust rounds that refine strengths of lights: weights from the fit, a Gauss–Newton step, and again."""

from dataclasses import dataclass, replace

import numpy as np

from psstereo.normals.low_rank_fit import LowRankFit, fit_normals, reweighted
from psstereo.normals.strength_steps import strength_system
from psstereo.types import BoolArray, FloatArray

__all__ = ["Refined", "SampleSet", "refine_strengths", "robust_spread"]

_ROUNDS = 60
_FREEZE = 8
"""Rounds after which the scale of a pixel's residuals stays as it is, so that the iteration can settle."""
_SETTLED = 0.02
"""Share of the expected error at which a step is too small to matter."""
_EXACT = 1e-11
_LONGEST_STEP = 0.7


@dataclass(frozen=True, eq=False)
class SampleSet:
    """Samples of one channel.

    Attributes
    ----------
    values : float64 array (m, p)
        Brightness, zero where not usable.
    usable : bool array (m, p)
        Which observations may be used.
    lit : float64 array (m, p)
        First guess of what is lit, as weights.
    directions : float64 array (m, 3)
        Unit directions of the lights.
    """

    values: FloatArray
    usable: BoolArray
    lit: FloatArray
    directions: FloatArray


@dataclass(frozen=True, eq=False)
class Refined:
    """Strengths and how well they fit.

    Attributes
    ----------
    strengths : float64 array (m,)
        With mean one [1].
    spread : float
        Median over pixels of the robust residual over the pixel's brightest value [1].
    determinacy : float
        Least share of information that is left when normals are unknown [1].
    rounds : int
        Rounds done.
    settled : bool
        Whether the last step was too small to matter.
    """

    strengths: FloatArray
    spread: float
    determinacy: float
    rounds: int
    settled: bool

    @property
    def expected_error(self) -> float:
        """Relative error if the residuals of all pixels conspired [1]."""
        return expected_error(self.spread, self.determinacy)


def expected_error(spread: float, determinacy: float) -> float:
    """Return the relative error of strengths that coherent residuals of this size bring about."""
    return spread / np.sqrt(determinacy) if determinacy > 0 else float("inf")


def refine_strengths(samples: SampleSet, start: FloatArray, prior: float = 0.0) -> Refined:
    """Refine strengths until steps are too small to matter.

    Parameters
    ----------
    samples : SampleSet
        Samples.
    start : float64 array (m,)
        Positive strengths to start from.
    prior : float
        Tie of the logarithms to zero; see :meth:`StrengthSystem.solve` [1].

    Returns
    -------
    Refined
        The strengths.
    """
    values, directions = samples.values, samples.directions
    strengths = start / start.mean()
    fit = fit_normals(values, strengths[:, None] * directions, samples.lit)
    frozen: FloatArray | None = None
    determinacy = 0.0
    for k in range(_ROUNDS):
        fit = _reweighted_fit(samples, strengths, fit, frozen)
        system = strength_system(values, strengths[:, None] * directions, fit)
        determinacy = system.determinacy()
        if not determinacy > 0:  # a light without information: no step can be told
            break
        step = np.clip(system.solve(prior, np.log(strengths)), -_LONGEST_STEP, _LONGEST_STEP)
        strengths = strengths * np.exp(step)
        strengths /= strengths.mean()
        fit = fit_normals(values, strengths[:, None] * directions, fit.weights)
        if k + 1 == _FREEZE:
            frozen = fit.spread
        if np.abs(step).max() < max(_EXACT, _SETTLED * expected_error(_middle(fit), determinacy)):
            return Refined(strengths, _middle(fit), determinacy, k + 1, settled=True)
    return Refined(strengths, _middle(fit), determinacy, k + 1, settled=False)


def robust_spread(samples: SampleSet, strengths: FloatArray, rounds: int = 8) -> float:
    """Return the median spread of a robust fit with given strengths; see `Refined`."""
    lights = strengths[:, None] * samples.directions
    fit = fit_normals(samples.values, lights, samples.lit)
    for _ in range(rounds):
        fit = _reweighted_fit(samples, strengths, fit, None)
    return _middle(fit)


def _reweighted_fit(
    samples: SampleSet, strengths: FloatArray, fit: LowRankFit, frozen: FloatArray | None
) -> LowRankFit:
    if frozen is not None:
        known = np.isfinite(frozen) & np.isfinite(fit.spread)
        fit = replace(fit, spread=np.where(known, frozen, fit.spread))
    weights = reweighted(samples.values, samples.usable, fit)
    return fit_normals(samples.values, strengths[:, None] * samples.directions, weights)


def _middle(fit: LowRankFit) -> float:
    fitted = np.isfinite(fit.spread)
    return float(np.median(fit.spread[fitted])) if fitted.any() else float("inf")
