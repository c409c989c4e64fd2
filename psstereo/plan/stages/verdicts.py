"""Telling what was made of each observation."""

from dataclasses import replace
from typing import ClassVar

from psstereo.capture import Capture
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.stage import Decision, Skip, Stage, Use

__all__ = ["Verdicts"]


class Verdicts(Stage):
    """Tells what was made of each observation."""

    name: ClassVar[str] = "verdicts"
    summary: ClassVar[str] = "tell what was made of each observation"

    def decide(self, facts: Facts) -> Use | Skip:
        """Leave it out; see :meth:`Stage.decide`."""
        del facts
        return Skip(reason="Nobody asked for them.")

    def asked(self, options: Options, facts: Facts) -> Use | Skip | None:
        """Return what was asked for; see :meth:`Stage.asked`."""
        del facts
        return Use(reason="Asked for.") if options.verdicts else None

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Set it; see :meth:`Stage.apply`."""
        return capture, replace(options, verdicts=decision.use)
