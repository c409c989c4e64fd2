"""Values at full scale, whose true brightness nobody knows."""

from typing import ClassVar, Literal

import numpy as np

from psstereo.plan.diagnosis.case import Case
from psstereo.plan.diagnosis.check import Check, listed
from psstereo.plan.diagnosis.finding import Finding

__all__ = ["Saturated"]

_WHITE = 0.98
"""Share of full scale from which a value counts as saturated."""
_NOTE, _WARNING = 0.01, 0.05
"""Share of observations."""
_LOST = 0.01
"""Share of pixels without three sound observations from which it is a fault."""


class Saturated(Check):
    """Share of saturated observations, and of pixels that have too few others."""

    name: ClassVar[str] = "saturation"
    summary: ClassVar[str] = "Many values are at full scale."
    stage: ClassVar[Literal["plain", "order", "fit"]] = "plain"

    def look(self, case: Case) -> Finding | None:
        """Return a finding if the share is large; see :meth:`Check.look`."""
        sample = case.sample
        if sample.raw is None or not sample.saturates:
            return None
        full = (sample.raw >= _WHITE * sample.white).any(axis=2)
        share = float(full.mean()) if full.size else 0.0
        lost = float(((~full).sum(axis=0) < 3).mean()) if full.size else 0.0
        if share < _NOTE and lost < _LOST:
            return None
        by_image = full.mean(axis=1)
        worst = tuple(int(i) for i in np.argsort(-by_image)[:3] if by_image[i] > 0)
        sentence = (
            f"{share:.1%} of the observations are at full scale, most in images {listed(worst, sample.names)} with "
            f"{by_image.max():.0%}; {lost:.1%} of the pixels have fewer than three others."
        )
        severity: Literal["note", "warning", "fault"] = (
            "fault" if lost >= _LOST else "warning" if share >= _WARNING else "note"
        )
        remedy = "Expose less, so that nothing but highlights comes above nine tenths of full scale."
        return self.finding(severity, (100 * share, "%"), (sentence, remedy), 1.0, worst)
