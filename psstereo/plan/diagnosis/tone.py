"""The exponent of a tone curve that was not undone."""

from dataclasses import dataclass, replace

import numpy as np

from psstereo.plan.diagnosis.evidence import Evidence, evidence
from psstereo.plan.diagnosis.patterns import Pattern, shadow_floor, smooth_patterns
from psstereo.plan.sample import Sample

__all__ = ["Tone", "tone"]

_LEAST = 0.2
"""First-order bend from which it is worth a look."""
_CURVED = 1.5
"""Exponent from which it is believed: rough surfaces look like less."""
_LARGEST = 5.0
_ROUNDS = 4
_SETTLED = 0.02
_LEFT = 0.1
"""Bend that may be left."""
_BETTER = 0.85
"""Residual over that of an offset below which it is rather a curve."""
_AS_GOOD = 1.2
"""The same if shadows are too dark for an offset."""
_CONFIRMED = 0.4
"""Share of an offset that shadows must show."""


@dataclass(frozen=True, kw_only=True)
class Tone:
    """A curve value = light^(1 / exponent).

    Attributes
    ----------
    exponent, error : float
        The exponent and its standard error [1].
    share : float
        Share of the squared misfit that it explains, to first order [1].
    """

    exponent: float
    error: float
    share: float


def tone(sample: Sample, known: Evidence, patterns: dict[str, Pattern]) -> Tone | None:
    """Raise the values to higher powers until no bend is left, and compare that with an offset.

    Parameters
    ----------
    sample : Sample
        The sample.
    known : Evidence
        Its evidence.
    patterns : dict of str to Pattern
        What explains it.

    Returns
    -------
    Tone or None
        None if there is no such curve, or it is rather something else.
    """
    first = patterns.get("response")
    if first is None or not first.size < 0 or not first.sure(_LEAST, 5.0, 0.25):
        return None
    strength = sample.strengths.mean(axis=1, keepdims=True)
    exponent, last, residual = 1.0, first, float("inf")
    for _ in range(_ROUNDS):
        exponent *= min(max(1 - last.size, 0.5), 2.0)
        if exponent > _LARGEST:
            return None
        light = np.maximum(sample.values * strength, 0.0) ** exponent / strength
        raised = replace(sample, values=light, albedo=np.where(np.isfinite(sample.albedo), light.max(axis=0), np.nan))
        seen = evidence(raised)
        found = smooth_patterns(raised, seen).get("response")
        if found is None:
            return None
        last, residual = found, seen.residual() / exponent
        if abs(last.size) < _SETTLED:
            break
    if exponent < _CURVED or abs(last.size) > _LEFT or not residual < known.residual():
        return None
    if not _rather_than_offset(sample, known, patterns, residual):
        return None
    return Tone(exponent=exponent, error=exponent * last.error, share=first.share)


def _rather_than_offset(sample: Sample, known: Evidence, patterns: dict[str, Pattern], residual: float) -> bool:
    """Whether a curve leaves less than an offset does, or shadows contradict the offset."""
    offset = patterns.get("fill")
    if offset is None or offset.size < 0:
        return True
    share = max(offset.share, patterns["stray"].share)
    other = known.residual() * float(np.sqrt(max(1 - share, 0.0)))
    if residual < _BETTER * other:
        return True
    floor = shadow_floor(sample, known)
    return bool(np.isfinite(floor) and floor < _CONFIRMED * offset.size and residual < _AS_GOOD * other)
