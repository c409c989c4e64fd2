"""Leaving saturated observations out."""

from dataclasses import replace
from typing import ClassVar

from psstereo.capture import Capture
from psstereo.normals import GATES
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.stage import Decision, Skip, Stage, Use, refuse
from psstereo.plan.stages.gates import asked_gate, gate_of

__all__ = ["SaturationGate"]


class SaturationGate(Stage):
    """Leaves out observations whose true value is beyond full scale."""

    name: ClassVar[str] = "saturation gate"
    summary: ClassVar[str] = "leave saturated observations out"
    keys: ClassVar[tuple[str, ...]] = ("valid_range",)

    def decide(self, facts: Facts) -> Use | Skip:
        """Do it where values have a full scale; see :meth:`Stage.decide`."""
        if not facts.saturates:
            return Skip(reason="The images hold floating-point values without a full scale.")
        share = "" if facts.saturated is None else f"{facts.saturated:.2%} saturated"
        return Use(reason="Values from 0.98 of full scale on are left out.", figure=share)

    def asked(self, options: Options, facts: Facts) -> Use | Skip | None:
        """Return what a range or a gate means; see :meth:`Stage.asked`."""
        if options.valid_range is not None:
            low, high = options.valid_range
            reason = f"Values outside {low:.3g} to {high:.3g} of full scale are left out: asked for."
            return Use(reason=reason, options={"valid_range": [float(low), float(high)]})
        gate = asked_gate(options)
        if gate is None or gate.saturation:
            return None
        return (
            Skip(reason="No valid range was given, and the gate leaves saturated values in.")
            if (facts.saturates)
            else None
        )

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Set the gate's half, and the range; see :meth:`Stage.apply`."""
        valid = decision.options.get("valid_range")
        if valid is not None:
            sound = isinstance(valid, list) and len(valid) == 2
            if not sound or any(isinstance(one, bool) or not isinstance(one, int | float) for one in valid):
                raise refuse(self, f"its valid range is {valid!r}.", "Use two shares of full scale.")
        elif decision.use and not capture.stack.saturates:
            raise refuse(self, "it is on, and the images have no full scale.", "Leave it out, or give a valid_range.")
        shadow = (options.gate or GATES["auto"]).shadow
        range_of_values = None if valid is None else (float(valid[0]), float(valid[1]))
        saturation = decision.use or not capture.stack.saturates
        return capture, replace(
            options, gate=gate_of(shadow=shadow, saturation=saturation), valid_range=range_of_values
        )
