"""Central projection."""

from dataclasses import replace
from typing import ClassVar

from psstereo.camera import Orthographic
from psstereo.capture import Capture
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.stage import Decision, Skip, Stage, Use, refuse

__all__ = ["Perspective"]


class Perspective(Stage):
    """Integrates along the lines of sight of a pinhole camera."""

    name: ClassVar[str] = "perspective"
    summary: ClassVar[str] = "integrate along the camera's lines of sight"

    def decide(self, facts: Facts) -> Use | Skip:
        """Do it where the camera is known to be a pinhole; see :meth:`Stage.decide`."""
        if facts.perspective:
            return Use(reason="The camera is a pinhole.")
        return Skip(reason="The camera is orthographic.")

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Take the camera for orthographic if it is left out; see :meth:`Stage.apply`."""
        parallel = isinstance(capture.camera, Orthographic)
        if decision.use and parallel:
            raise refuse(self, "it is on, and the capture's camera is orthographic.")
        return (capture if decision.use or parallel else replace(capture, camera=Orthographic())), options
