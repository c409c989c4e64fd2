"""Lights that are not as strong as they are said to be."""

from typing import ClassVar, Literal

import numpy as np

from psstereo.plan.diagnosis.case import Case
from psstereo.plan.diagnosis.check import Check, listed
from psstereo.plan.diagnosis.finding import Finding

__all__ = ["UnequalStrengths"]

_STRONG = 0.2
"""Root-mean-square departure from which the normals are spoilt."""


class UnequalStrengths(Check):
    """Strengths that the images tell, over those that were given."""

    name: ClassVar[str] = "strengths"
    summary: ClassVar[str] = "The lights differ in strength from what is said of them."
    stage: ClassVar[Literal["plain", "order", "fit"]] = "fit"

    def look(self, case: Case) -> Finding | None:
        """Return a finding if strengths are off beyond doubt; see :meth:`Check.look`."""
        found = case.strengths
        if found is None or not case.strengths_off or case.near:
            return None
        departure = np.log(found.strengths)
        rms = float(np.sqrt(np.mean(departure**2)))
        given = case.sample.strengths.mean(axis=1)
        told = float(np.ptp(given)) > 1e-6 * float(given.max())
        low, high = float(found.strengths.min()), float(found.strengths.max())
        worst = tuple(int(i) for i in np.argsort(-np.abs(departure))[:3])
        sentence = (
            f"The lights are {low:.2f} to {high:.2f} times as strong as "
            f"{'given' if told else 'each other on average, and no strengths are given'} ({100 * rms:.0f} % off on "
            f"average, told within {100 * found.expected_error:.1g} %), most at images "
            f"{listed(worst, case.sample.names)}."
        )
        remedy = "Let the strengths be found (--strengths unknown), or measure them on a white card."
        return self.finding("fault" if rms > _STRONG else "warning", (100 * rms, "%"), (sentence, remedy), 0.9, worst)
