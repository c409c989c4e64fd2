"""Light in every image that comes from none of the lights, and a black level that is too high."""

from typing import ClassVar, Literal

import numpy as np

from psstereo.plan.diagnosis.case import Case
from psstereo.plan.diagnosis.check import Check
from psstereo.plan.diagnosis.finding import Finding
from psstereo.plan.diagnosis.patterns import shadow_floor, stray_pattern

__all__ = ["AmbientLeft"]

_LEAST = 0.03
"""Offset over the brightness of a surface that faces the light, from which it counts."""
_CONFIRMED = 0.4
"""Share of the offset that shadows must show."""


class AmbientLeft(Check):
    """A constant that no light explains, confirmed by what shadows show.

    It needs five lights that do not all lie on one circle: on a ring an offset looks like another normal.
    """

    name: ClassVar[str] = "ambient"
    summary: ClassVar[str] = "Light that belongs to none of the lights, or a pedestal, is in every image."
    stage: ClassVar[Literal["plain", "order", "fit"]] = "fit"

    def look(self, case: Case) -> Finding | None:
        """Return a finding if an offset explains much of the misfit; see :meth:`Check.look`."""
        patterns = case.patterns
        best = case.best_pattern()
        if best not in ("stray", "fill") or case.tone is not None:
            return None
        found = patterns[best]
        pattern = stray_pattern(case.sample, case.evidence) if best == "stray" else 1.0
        floor = shadow_floor(case.sample, case.evidence, pattern)
        if not found.size > 0 or not found.sure(_LEAST, 6.0, 0.25 if np.isfinite(floor) else 0.5):
            return None
        if np.isfinite(floor) and floor < _CONFIRMED * found.size:
            return None
        told = f", and shadows show {floor:.0%}" if np.isfinite(floor) else ""
        kind = "the same everywhere, like stray light or a pedestal" if best == "stray" else "like light of the room"
        sentence = (
            f"Every image holds {found.size:.1%} ± {found.error:.1%} of full brightness that none of the lights "
            f"explains, {kind}{told}; it is {found.share:.0%} of the misfit."
        )
        remedy = (
            "Take an image without any of the lights and give it as dark image (dark in capture.toml), or use a solver "
            "with an ambient term (psstereo solvers)."
        )
        severity: Literal["warning", "fault"] = "fault" if found.size > 0.1 else "warning"
        return self.finding(severity, (100 * found.size, "%"), (sentence, remedy), 0.9 if told else 0.7)
