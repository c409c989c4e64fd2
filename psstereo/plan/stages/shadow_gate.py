"""Leaving shadowed observations out."""

from dataclasses import replace
from typing import ClassVar

from psstereo.capture import Capture
from psstereo.normals import GATES, LeastSquares
from psstereo.plan.choice import choose_by_facts
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.stage import Decision, Skip, Stage, Use
from psstereo.plan.stages.gates import asked_gate, gate_of

__all__ = ["ShadowGate"]

_NONE = 1e-4
"""Share of observations in shadow up to which there are none."""


class ShadowGate(Stage):
    """Leaves out observations that the light does not reach."""

    name: ClassVar[str] = "shadow gate"
    summary: ClassVar[str] = "leave shadowed observations out"

    def decide(self, facts: Facts) -> Use | Skip:
        """Do it unless there is no shadow; see :meth:`Stage.decide`."""
        if facts.shadowed is None:
            return Use(reason="Observations in shadow are left out.")
        cast = facts.dark_outliers
        shares = f"{facts.shadowed:.2%} attached" + ("" if cast is None else f", {cast:.2%} too dark")
        bare = facts.shadowed <= _NONE and cast is not None and cast <= _NONE
        if bare and not facts.lamps and choose_by_facts(facts).solver == LeastSquares.name:
            return Skip(reason="The sample shows no shadow.", figure=shares)
        return Use(reason="Observations in shadow are left out.", figure=shares)

    def asked(self, options: Options, facts: Facts) -> Use | Skip | None:
        """Return what a gate means; see :meth:`Stage.asked`."""
        del facts
        gate = asked_gate(options)
        if gate is None:
            return None
        if gate.shadow:
            return Use(reason="Observations in shadow are left out.")
        return Skip(reason="The gate leaves shadowed observations in.")

    def whole(self, facts: Facts) -> Use | Skip:
        """Do it; see :meth:`Stage.whole`."""
        del facts
        return Use(reason="Observations in shadow are left out.")

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Set the gate's half; see :meth:`Stage.apply`."""
        saturation = (options.gate or GATES["auto"]).saturation
        return capture, replace(options, gate=gate_of(shadow=decision.use, saturation=saturation))
