"""Robust rounds that refine strengths of lights: weights from the fit, a Gauss–Newton step, and again.

Everything is judged on brightness divided by the strengths found so far, so that neither the weights nor the answer
depend on how strong the lights happened to be.
"""

from dataclasses import dataclass, replace

import numpy as np

from psstereo.normals.low_rank_fit import LowRankFit, fit_normals
from psstereo.normals.strength_steps import StrengthSystem, strength_system
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Refined", "SampleSet", "brightness", "first_lit", "refine_strengths", "robust_spread"]

_ROUNDS = 200
_FREEZE = 8
"""Rounds after which the scale of a pixel's residuals stays as it is, so that the iteration can settle."""
_SETTLED = 1e-2
"""Share of the residual's spread at which a step is too small to matter."""
_EXACT = 1e-11
_LONGEST_STEP = 0.7
_DARK = 0.02
"""Share of a pixel's brightest value below which an observation counts as shadow."""
_DARK_AT_FIRST = 0.1
"""The same before anything is fitted, when images are only roughly made equally bright."""
_WIDTH = 3.0
"""Residuals over their scale at which the Geman–McClure weight is a quarter: narrower ones follow their own start."""
_FLOOR = 1e-3
"""Least scale of a pixel's residuals, as a share of its brightest value: no image is better than that."""
_AGREED = 5.0
"""Error of strengths over what regions of the image disagree about: two to eight on most captures of known strengths,
since what is wrong with a model is mostly wrong everywhere; far more where all regions are wrong alike."""
_NOISE_SHARE = 8.0
"""Determinacy that residuals alone can feign, over their square: they scatter the normals of a plane."""


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
    regions : int array (p,)
        Part of the image in which each pixel lies, from 0.
    """

    values: FloatArray
    usable: BoolArray
    lit: FloatArray
    directions: FloatArray
    regions: IntArray


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
    disagreement : float
        Root-mean-square error of the strengths that the disagreement between regions of the image tells; infinite where
        strengths cannot be told [1].
    rounds : int
        Rounds done.
    settled : bool
        Whether the last step was too small to matter.
    """

    strengths: FloatArray
    spread: float
    determinacy: float
    disagreement: float
    rounds: int
    settled: bool

    @property
    def expected_error(self) -> float:
        """Relative error to be expected of the strengths [1].

        From what regions of the image disagree about, and from the least that images of real things are wrong by, as if
        that conspired.
        """
        told = self.determinacy - _NOISE_SHARE * self.spread**2
        return float(np.hypot(_AGREED * self.disagreement, _FLOOR / np.sqrt(told))) if told > 0 else float("inf")


def first_lit(values: FloatArray) -> FloatArray:
    """Return weights (m, p) that leave out what is dark against its pixel after images are made equally bright.

    Parameters
    ----------
    values : float64 array (m, p)
        Brightness, NaN where not usable; each row has a positive value.
    """
    usable = np.isfinite(values)
    even = np.where(usable, values, 0.0) / brightness(values)[:, None]
    brightest = np.maximum(np.quantile(even, 0.9, axis=0), np.finfo(np.float64).tiny)
    return np.asarray(even > _DARK_AT_FIRST * brightest, np.float64)


def brightness(values: FloatArray) -> FloatArray:
    """Return how bright each image is where it shows anything, (m,): a light that reaches little is not thereby weak.

    Parameters
    ----------
    values : float64 array (m, p)
        Brightness, NaN where not usable; each row has a positive value.
    """
    return np.array([np.quantile(row[row > 0], 0.9) for row in values])


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
    strengths = start / start.mean()
    weights, frozen, settled = samples.lit, None, False
    for k in range(_ROUNDS):
        corrected = samples.values / strengths[:, None]
        fit = fit_normals(corrected, samples.directions, weights)
        fit = fit_normals(corrected, samples.directions, _weights(corrected, samples.usable, _held(fit, frozen)))
        weights = fit.weights
        system = strength_system(corrected, samples.directions, fit)
        if settled or not system.determinacy() > 0:  # done, or a light without information: no step can be told
            break
        step = np.clip(system.solve(prior, np.log(strengths)), -_LONGEST_STEP, _LONGEST_STEP)
        strengths = strengths * np.exp(step)
        strengths /= strengths.mean()
        frozen = fit.spread if k + 1 == _FREEZE else frozen
        settled = bool(np.abs(step).max() < max(_EXACT, _SETTLED * _middle(fit)))
    return Refined(
        strengths=strengths,
        spread=_middle(fit),
        determinacy=system.determinacy(),
        disagreement=_disagreement(system, corrected, fit, samples.regions),
        rounds=k if settled else k + 1,
        settled=settled,
    )


def robust_spread(samples: SampleSet, strengths: FloatArray, rounds: int = 8) -> float:
    """Return the median spread of a robust fit with given strengths; see `Refined`."""
    corrected = samples.values / strengths[:, None]
    fit = fit_normals(corrected, samples.directions, samples.lit)
    for _ in range(rounds):
        fit = fit_normals(corrected, samples.directions, _weights(corrected, samples.usable, fit))
    return _middle(fit)


def _weights(values: FloatArray, usable: BoolArray, fit: LowRankFit) -> FloatArray:
    """Return weights (m, p): Geman–McClure on what the fit says is lit, over the brightness.

    What is left of real surfaces grows with brightness, so that bright observations get less weight than a constant
    error would give them. Badly fitted pixels lose their say, and bright pixels have no more than others.
    """
    fitted = np.isfinite(fit.spread)
    brightest = np.where(fitted, fit.model.max(axis=0), 1.0)
    threshold = _DARK * brightest
    lit = usable & fitted & (fit.model > threshold) & (values > threshold)
    scale = np.where(fitted, np.maximum(fit.spread, _FLOOR), 1.0)
    middle = np.median(scale[fitted]) if fitted.any() else 1.0
    t = (values - fit.model) / (_WIDTH * scale * brightest)
    say = 1.0 / (brightest * (1.0 + (scale / middle) ** 2) * np.where(lit, fit.model, brightest))
    return np.asarray(lit * say / (1.0 + t * t) ** 2)


def _held(fit: LowRankFit, frozen: FloatArray | None) -> LowRankFit:
    """Return the fit with the scale of earlier rounds where both have one."""
    if frozen is None:
        return fit
    return replace(fit, spread=np.where(np.isfinite(frozen) & np.isfinite(fit.spread), frozen, fit.spread))


def _disagreement(system: StrengthSystem, values: FloatArray, fit: LowRankFit, regions: IntArray) -> float:
    """Return the root-mean-square error of the strengths from how far regions of the image pull them apart.

    The pulls of all pixels cancel at the solution; those of a region need not. Noise averages out over a region, a
    reflectance or a light that is not what the model says does not: the covariance ``H⁻¹ Σ_g s_g s_gᵀ H⁻¹`` of pulls
    s_g that are independent between regions holds for both.
    """
    if not system.determinacy() > 0:
        return float("inf")
    pulls = fit.weights * fit.model * (values - fit.model)
    count = int(regions.max()) + 1
    sums = np.array([np.bincount(regions, row, count) for row in pulls], np.float64)
    errors = np.stack([system.free_step(sums[:, g]) for g in range(count)])
    return float(np.sqrt((errors * errors).sum(axis=0).mean() * count / max(count - 1, 1)))


def _middle(fit: LowRankFit) -> float:
    fitted = np.isfinite(fit.spread)
    return float(np.median(fit.spread[fitted])) if fitted.any() else float("inf")
