"""Leaving observations out by hand."""

from typing import ClassVar

from psstereo.capture import Capture
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.stage import Decision, Skip, Stage, Use, refuse

__all__ = ["ObservationMask"]


class ObservationMask(Stage):
    """Leaves out what a person has marked."""

    name: ClassVar[str] = "observation mask"
    summary: ClassVar[str] = "leave out observations that a person marked"

    def decide(self, facts: Facts) -> Use | Skip:
        """Do it where there is a mask; see :meth:`Stage.decide`."""
        if facts.masked_by_hand:
            return Use(reason="Observations were left out by hand.")
        return Skip(reason="There is no mask of observations.")

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Require the mask that the plan speaks of; see :meth:`Stage.apply`."""
        if decision.use is not (options.observation_mask is not None):
            said = "it is on, and no mask is given" if decision.use else "it is left out, and a mask is given"
            raise refuse(self, f"{said}.", "Give the mask with --observation-mask, or leave the stage out.")
        return capture, options
