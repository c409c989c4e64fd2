"""Solving piece by piece where memory is short."""

from dataclasses import replace
from typing import ClassVar

from psstereo.capture import Capture
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.stage import Decision, Skip, Stage, Use, refuse

__all__ = ["Tiling"]


class Tiling(Stage):
    """Keeps samples in a temporary file and solves them piece by piece."""

    name: ClassVar[str] = "tiling"
    summary: ClassVar[str] = "keep samples in a temporary file, solve piece by piece"
    keys: ClassVar[tuple[str, ...]] = ("max_memory",)

    def decide(self, facts: Facts) -> Use | Skip:
        """Do it where the samples exceed the limit; see :meth:`Stage.decide`."""
        size = f"{facts.sample_bytes / 1e6:.0f} MB"
        if facts.in_memory:
            return Skip(reason="The samples fit into memory.", figure=size)
        return Use(
            reason=f"The limit is {(facts.memory_limit or 0) / 1e6:.0f} MB.",
            figure=size,
            options={"max_memory": facts.memory_limit},
        )

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Set the limit; see :meth:`Stage.apply`."""
        limit = decision.options.get("max_memory")
        if not decision.use:
            return capture, replace(options, max_memory=None)
        if isinstance(limit, bool) or not isinstance(limit, int) or limit < 1:
            raise refuse(self, f"its limit is {limit!r}.", "Use a whole number of bytes.")
        return capture, replace(options, max_memory=limit)
