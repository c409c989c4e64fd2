"""Lamps that are too near to be taken as distant."""

from typing import ClassVar, Literal

from psstereo.plan.diagnosis.case import Case
from psstereo.plan.diagnosis.check import Check
from psstereo.plan.diagnosis.finding import Finding

__all__ = ["NearLight"]

_LEAST = 0.05
"""Half of the object's size over the distance of the lamps, from which it counts."""
_LIGHTS, _MANY = 7, 9
"""Lights below which highlights look the same, and from which they rarely do."""
_SHARE, _SHARE_OF_FEW = 0.3, 0.6
"""Share of the misfit that must be explained with many lights, and with few."""


class NearLight(Check):
    """Fall-off and turning of light over the field."""

    name: ClassVar[str] = "near-light"
    summary: ClassVar[str] = "Brightness falls off over the object as if the lamps stood near it."
    stage: ClassVar[Literal["plain", "order", "fit"]] = "fit"

    def look(self, case: Case) -> Finding | None:
        """Return a finding if a finite distance explains much of the misfit; see :meth:`Check.look`."""
        if case.near or len(case.sample.directions) < _LIGHTS or case.best_pattern() != "near":
            return None
        found = case.patterns["near"]
        share = _SHARE if len(case.sample.directions) >= _MANY else _SHARE_OF_FEW
        if not found.size > 0 or not found.sure(_LEAST, 5.0, share):
            return None
        distance = 1.0 / (2.0 * found.size)
        sentence = (
            f"Brightness changes over the object as if the lamps stood about {distance:.1f} times its size away; that "
            f"explains {found.share:.0%} of the misfit."
        )
        remedy = "Give the lamps' positions (a led file, --lights), or move them ten object sizes away or more."
        return self.finding("warning", (distance, "object sizes"), (sentence, remedy), min(0.9, 0.5 + found.share / 2))
