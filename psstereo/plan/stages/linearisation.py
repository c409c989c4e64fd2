"""Undoing the camera's response."""

from dataclasses import replace
from typing import ClassVar

from psstereo.capture import Capture
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.stage import Decision, Skip, Stage, Use, refuse
from psstereo.stack import LINEAR

__all__ = ["Linearisation"]


class Linearisation(Stage):
    """Makes pixel values proportional to light."""

    name: ClassVar[str] = "linearisation"
    summary: ClassVar[str] = "undo the camera's curve"

    def decide(self, facts: Facts) -> Use | Skip:
        """Do it where there is a curve; see :meth:`Stage.decide`."""
        if facts.linear:
            return Skip(reason="The images are linear.")
        return Use(reason=f"The camera's {facts.response} curve was removed.")

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Take the values as they are if it is left out; see :meth:`Stage.apply`."""
        if decision.use and capture.response.is_linear:
            raise refuse(self, "it is on, and the capture has no curve to undo.")
        return (capture if decision.use else replace(capture, response=LINEAR)), options
