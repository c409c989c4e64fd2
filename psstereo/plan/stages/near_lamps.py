"""Lamps at places near the object."""

from dataclasses import replace
from typing import ClassVar

from psstereo.capture import Capture
from psstereo.near import wants_near
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.stage import Decision, Skip, Stage, Use, refuse

__all__ = ["NearLamps"]


class NearLamps(Stage):
    """Finds normals and depth together, since each lamp's direction and fall-off depend on the depth."""

    name: ClassVar[str] = "near lamps"
    summary: ClassVar[str] = "find normals and depth together under lamps at places"
    keys: ClassVar[tuple[str, ...]] = ("distance",)

    def decide(self, facts: Facts) -> Use | Skip:
        """Do it where a light has a place; see :meth:`Stage.decide`."""
        if facts.lamps:
            return Use(reason="The lights have places.")
        return Skip(reason="All lights are distant.")

    def asked(self, options: Options, facts: Facts) -> Use | Skip | None:
        """Leave it out for a solver that was named, and take a distance; see :meth:`Stage.asked`."""
        if options.solver is not None:
            return Skip(reason="A solver for distant lights was asked for.") if facts.lamps else None
        if facts.lamps and options.distance is not None:
            return Use(reason="The lights have places.", options={"distance": options.distance})
        return None

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Set the distance; see :meth:`Stage.apply`."""
        if decision.use and not wants_near(capture):
            raise refuse(self, "it is on, and no light of the capture has a place.")
        distance = decision.options.get("distance")
        if distance is not None and (isinstance(distance, bool) or not isinstance(distance, int | float)):
            raise refuse(self, f"its distance is {distance!r}.", "Use a number, in the unit of the lamps.")
        return capture, replace(options, distance=distance)
