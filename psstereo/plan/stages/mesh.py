"""Triangles."""

from typing import ClassVar

from psstereo.capture import Capture
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.stage import Decision, Skip, Stage, Use, refuse

__all__ = ["Mesh"]


class Mesh(Stage):
    """Makes triangles of the depth."""

    name: ClassVar[str] = "mesh"
    summary: ClassVar[str] = "make triangles of the depth"

    def decide(self, facts: Facts) -> Use | Skip:
        """Do it; see :meth:`Stage.decide`."""
        return Use(reason="Two triangles for each four pixels.", figure=f"{facts.pixels} pixels")

    def asked(self, options: Options, facts: Facts) -> Use | Skip | None:
        """Leave it out with the depth; see :meth:`Stage.asked`."""
        del facts
        return Skip(reason="Only normals were asked for.") if options.integrator is None else None

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Require a depth; see :meth:`Stage.apply`."""
        if decision.use and options.integrator is None:
            raise refuse(self, "it is on, and the depth is left out.")
        return capture, options
