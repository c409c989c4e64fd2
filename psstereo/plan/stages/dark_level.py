"""Subtracting a dark image."""

from dataclasses import replace
from typing import ClassVar

from psstereo.capture import Capture
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.stage import Decision, Skip, Stage, Use, refuse

__all__ = ["DarkLevel"]


class DarkLevel(Stage):
    """Takes off what the camera shows without any of the lights."""

    name: ClassVar[str] = "dark level"
    summary: ClassVar[str] = "subtract the image without lights"

    def decide(self, facts: Facts) -> Use | Skip:
        """Do it where there is such an image; see :meth:`Stage.decide`."""
        if facts.dark_frame:
            return Use(reason="A dark image was subtracted.")
        return Skip(reason="There is no dark image.")

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Leave the image alone if it is left out; see :meth:`Stage.apply`."""
        if decision.use and capture.dark is None:
            raise refuse(self, "it is on, and the capture has no dark image.")
        return (capture if decision.use else replace(capture, dark=None)), options
