"""Dark values that were cut off, and steps that are too coarse."""

from typing import ClassVar, Literal

import numpy as np

from psstereo.plan.diagnosis.case import Case
from psstereo.plan.diagnosis.check import Check
from psstereo.plan.diagnosis.cone import amplification
from psstereo.plan.diagnosis.finding import Finding
from psstereo.types import BoolArray

__all__ = ["ClippedBlack", "CoarseSteps"]

_LEAST = 0.08
"""Level that was taken off too much, over the brightness of a surface that faces the light."""
_LIT = 0.15
"""Model over albedo below which an observation is dim."""
_ZEROS = 0.2
"""Share of zeros among dim lit observations from which black was cut off."""
_SHADES = 64
"""Dim observations that must be there."""
_ANGLE = 1.0
"""Error of angle that rounding may make [deg]."""


class ClippedBlack(Check):
    """A black level that was set, or taken off, too high: dim light is lost."""

    name: ClassVar[str] = "clipped-black"
    summary: ClassVar[str] = "Black was set too high: what is dim is cut off at zero."
    stage: ClassVar[Literal["plain", "order", "fit"]] = "fit"

    def look(self, case: Case) -> Finding | None:
        """Return a finding if dim light shows zero and an offset is missing; see :meth:`Check.look`."""
        best = case.best_pattern()
        if best not in ("stray", "fill"):
            return None
        found = case.patterns[best]
        if not found.size < 0 or not found.sure(_LEAST, 6.0, 0.5):
            return None
        known = case.evidence
        seen = case.sample.values[:, known.chosen] / known.albedo
        dim: BoolArray = (known.model > -found.size / 4) & (known.model < max(_LIT, -found.size)) & np.isfinite(seen)
        zeros = float((seen[dim] <= 1e-6).mean()) if np.count_nonzero(dim) >= _SHADES else 0.0
        if zeros < _ZEROS:
            return None
        sentence = (
            f"{zeros:.0%} of the observations in dim light are zero, and {-found.size:.1%} ± {found.error:.1%} of full "
            "brightness is missing everywhere: the black level is too high."
        )
        remedy = "Set the camera's black level lower, or take off less: the level of a covered lens."
        return self.finding("warning", (-100 * found.size, "%"), (sentence, remedy), 0.8)


class CoarseSteps(Check):
    """Rounding of dim images: few steps between black and what is seen."""

    name: ClassVar[str] = "coarse-steps"
    summary: ClassVar[str] = "The images are so dark that rounding makes visible errors."
    stage: ClassVar[Literal["plain", "order", "fit"]] = "plain"

    def look(self, case: Case) -> Finding | None:
        """Return a finding if rounding alone makes errors above a degree; see :meth:`Check.look`."""
        sample = case.sample
        if sample.raw is None or sample.raw.dtype.kind != "u":
            return None
        step = _step(sample.raw)
        top = sample.raw.max(axis=(0, 2)).astype(np.float64) / step
        steps = float(np.median(top[top > 0])) if (top > 0).any() else 0.0
        factor = amplification(sample.directions)
        if steps <= 0 or not np.isfinite(factor):
            return None
        channels = sample.raw.shape[2]
        noise = 1.0 / np.sqrt(12.0 * channels) / steps
        angle = float(np.degrees(noise * factor * np.sqrt(6.0 / len(sample.directions))))
        if angle < _ANGLE:
            return None
        sentence = (
            f"Half of the pixels reach no more than {steps:.0f} steps of brightness; rounding alone makes errors of "
            f"{angle:.1f}° with these lights."
        )
        remedy = "Expose longer, save 16 bit, or average several exposures."
        return self.finding("warning", (angle, "°"), (sentence, remedy), 0.9)


def _step(raw: object) -> float:
    """Return the smallest difference between values: 8-bit values in a 16-bit file stand far apart."""
    found = np.unique(np.asarray(raw))
    return float(np.diff(found.astype(np.float64)).min()) if len(found) > 1 else 1.0
