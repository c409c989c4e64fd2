"""What a sample's first fit says: noise, shadows, outliers, and whether Lambert's law holds.

Noise is unrelated between neighbouring pixels; what a model gets wrong is nearly the same there. So the difference of
two neighbours' residuals is noise alone, and a pixel whose residuals are much larger than such differences is one where
the model is broken, whatever the noise is.
"""

from dataclasses import dataclass

import numpy as np

from psstereo.plan.sample import Sample
from psstereo.types import BoolArray, FloatArray

__all__ = ["Evidence", "colour_spread", "evidence", "saturated_share", "trouble"]

_LIT = 0.1
"""Cosine to the light from which an observation is judged."""
_DARK = 0.5
"""Share of what it should be below which an observation is in the shadow of something."""
_LEAST = 5
"""Observations that two neighbours must share to be compared."""
_BROKEN = 2.0
"""Ratio of residual to noise from which the model is broken at a pixel."""
_OUTLIER = 8.0
"""Standard deviations of the noise from which an observation is an outlier."""
_MAD = 1.4826


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """Figures of a sample; see :class:`psstereo.plan.facts.Facts`."""

    unusable: float
    shadowed: float
    dark_outliers: float | None
    bright_outliers: float | None
    noise: float | None
    residual: float | None
    misfit: float | None


def evidence(sample: Sample) -> Evidence:
    """Judge the residuals of a sample's least-squares fit.

    Parameters
    ----------
    sample : Sample
        The sample.

    Returns
    -------
    Evidence
        The figures; None where there is no redundancy to tell by, with three lights for instance.
    """
    cosines, share, front, lit = _parted(sample)
    known = np.isfinite(sample.values)
    unusable, shadowed = 1.0 - float(known.mean()), _mean((cosines <= 0)[:, np.isfinite(cosines).all(axis=0)])
    if len(sample.directions) < 4 or not lit.any():
        return Evidence(
            unusable=unusable,
            shadowed=shadowed,
            dark_outliers=None,
            bright_outliers=None,
            noise=None,
            residual=None,
            misfit=None,
        )
    difference, together = _differences(sample, share, lit)
    noise = None if difference is None else _MAD * float(np.median(np.abs(difference))) / np.sqrt(2.0)
    limit = _OUTLIER * max(noise or 0.0, _quantum(sample))
    return Evidence(
        unusable=unusable,
        shadowed=shadowed,
        dark_outliers=_mean(share[front] < -limit),
        bright_outliers=_mean(share[front] > limit),
        noise=noise,
        residual=float(np.sqrt(np.mean(share[lit] ** 2))),
        misfit=together,
    )


def trouble(sample: Sample) -> FloatArray:
    """Return how much least squares leaves at each pixel, noise and all.

    Parameters
    ----------
    sample : Sample
        The sample.

    Returns
    -------
    float64 array (n,)
        Root-mean-square residual of the observations that face their light, over the albedo, those beyond the albedo
        counted as one; 0 where there is no fit [1].
    """
    _, share, front, _ = _parted(sample)
    square = np.square(np.where(front, np.clip(share, -1.0, 1.0), 0.0)).sum(axis=0)
    return np.asarray(np.sqrt(square / np.maximum(front.sum(axis=0), 1)))


def _parted(sample: Sample) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray]:
    """Return cosines to the lights, residuals over the albedo, and which observations face a light and are lit."""
    cosines = sample.directions @ sample.normals.T
    with np.errstate(invalid="ignore", divide="ignore"):
        share = sample.residual / sample.albedo
        front = (cosines > _LIT) & np.isfinite(share)
        lit = front & (sample.values > _DARK * sample.albedo * cosines)
    return cosines, share, front, lit


def _mean(flags: BoolArray) -> float:
    return float(flags.mean()) if flags.size else 0.0


def _quantum(sample: Sample) -> float:
    """Return the standard deviation of rounding, over the albedo."""
    if sample.bits > 16:
        return 1e-6
    albedo = float(np.nanmedian(sample.albedo * sample.strengths.mean()))
    return 0.29 / sample.white / albedo if albedo > 0 else 1e-6


def _differences(sample: Sample, share: FloatArray, lit: BoolArray) -> tuple[FloatArray | None, float | None]:
    """Return differences of neighbours' residuals, and the share of pixels whose residuals are larger than those."""
    there = np.flatnonzero(sample.neighbours[:, 0] >= 0)
    other = sample.neighbours[there, 0]
    both = lit[:, there] & lit[:, other]
    enough = both.sum(axis=0) >= min(_LEAST, len(lit))
    if not enough.any():
        return None, None
    there, other, both = there[enough], other[enough], both[:, enough]
    one, two = np.where(both, share[:, there], 0.0), np.where(both, share[:, other], 0.0)
    apart = ((one - two) ** 2).sum(axis=0) + both.sum(axis=0) * _quantum(sample) ** 2
    ratio = np.sqrt((one**2 + two**2).sum(axis=0) / apart)
    return (one - two)[both], _mean(ratio > _BROKEN)


def saturated_share(sample: Sample, limit: float) -> float | None:
    """Return the share of raw observations with a channel from `limit` times full scale on; None without full scale."""
    if sample.raw is None or not sample.saturates:
        return None
    return float((sample.raw >= limit * sample.white).any(axis=2).mean())


def colour_spread(sample: Sample) -> float | None:
    """Return how far the pixels' chromaticities lie from their mean, root mean square; None without colour."""
    if sample.raw is None or sample.raw.shape[2] < 3:
        return None
    total = (sample.raw / sample.strengths[:, None, :]).sum(axis=0, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        chroma = total / total.sum(axis=1, keepdims=True)
    chroma = chroma[np.isfinite(chroma).all(axis=1)]
    return float(np.sqrt(((chroma - chroma.mean(axis=0)) ** 2).sum(axis=1).mean())) if len(chroma) else None
