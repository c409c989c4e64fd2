"""Causes that bend brightness smoothly, and how much of the misfit each explains.

They look alike: a curve of tones, an offset, and lamps near a ball all make brightness another function of the cosine.
"""

from dataclasses import dataclass

import numpy as np

from psstereo.plan.diagnosis.evidence import Evidence
from psstereo.plan.diagnosis.relief import smooth_relief
from psstereo.plan.sample import Sample
from psstereo.types import FloatArray

__all__ = ["Pattern", "shadow_floor", "smooth_patterns", "stray_pattern"]

_FOUR = 0.02
"""Smallest over largest singular value of (L, 1) from which an offset can be told from a normal."""
_SHADOWED = 50
"""Observations in attached shadow from which they are asked."""


@dataclass(frozen=True, kw_only=True)
class Pattern:
    """How well one cause explains the misfit.

    Attributes
    ----------
    size, error : float
        Size of the cause and its standard error, in its own unit.
    share : float
        Share of the squared misfit that it takes away [1].
    """

    size: float
    error: float
    share: float

    def sure(self, least: float, times: float, share: float) -> bool:
        """Whether it is large, beyond chance, and explains much."""
        return abs(self.size) >= least and abs(self.size) >= times * self.error and self.share >= share


def smooth_patterns(sample: Sample, known: Evidence) -> dict[str, Pattern]:
    """Fit each cause alone.

    Parameters
    ----------
    sample : Sample
        The sample.
    known : Evidence
        Its evidence.

    Returns
    -------
    dict of str to Pattern
        ``"response"``, the exponent that brightness seems to have, less one, to first order; ``"near"``, reach over the
        distance of the lamps; ``"stray"`` and ``"fill"``, an offset over the brightness of a surface that faces the
        light, the same everywhere or following the albedo, where the lights can tell one. Empty if there is no
        redundancy.
    """
    if not known.redundant:
        return {}
    bright = np.maximum(known.values, 1e-6)
    columns = np.hstack([known.lights, np.ones((len(known.lights), 1))])
    singular = np.linalg.svd(columns, compute_uv=False)
    found = {"response": _pattern(known, bright * np.log(bright)), "near": _near(known)}
    if len(known.lights) > 4 and float(singular[-1]) > _FOUR * float(singular[0]):
        found["stray"] = _pattern(known, stray_pattern(sample, known))
        found["fill"] = _pattern(known, np.ones(known.values.shape))
    return found


def stray_pattern(sample: Sample, known: Evidence) -> FloatArray:
    """Return the same raw value everywhere as the evidence sees it, (m, n), of mean one."""
    strength = sample.strengths.mean(axis=1, keepdims=True)
    stray = (1.0 / strength) * (np.median(known.albedo) / known.albedo)
    return np.asarray(stray / stray.mean())


def shadow_floor(sample: Sample, known: Evidence, pattern: FloatArray | float = 1.0) -> float:
    """Return what observations in attached shadow show, over a pattern; NaN if there are too few."""
    values = sample.values[:, known.chosen] / known.albedo / pattern
    dark = (known.model < -0.1) & np.isfinite(values)
    return float(np.median(values[dark])) if np.count_nonzero(dark) >= _SHADOWED else float("nan")


def _pattern(known: Evidence, pattern: FloatArray) -> Pattern:
    found = known.explain(pattern[None])
    return Pattern(size=float(found.size[0]), error=float(found.error[0]), share=found.share)


def _near(known: Evidence) -> Pattern:
    """Return what lamps at the distance D explain, to first order in reach over distance.

    A lamp in the direction l sends ``(l − x / D) · b / |l − x / D|³`` to the place x, which is
    ``l·b + (3 (l·x) (l·b) − x·b) / D`` to first order. At which height the directions were measured is not known, so
    that the pattern of a common height is fitted as well.
    """
    place = np.vstack([known.place, smooth_relief(known.place, known.normals)])
    along = 3 * (known.lights @ place) * known.model - (known.normals * place).sum(axis=0)
    height = 3 * known.lights[:, 2:] * known.model - known.normals[2]
    found = known.explain(np.stack([along, height]))
    return Pattern(size=float(found.size[0]), error=float(found.error[0]), share=found.share)
