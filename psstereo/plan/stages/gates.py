"""The two halves of a gate."""

from psstereo.normals import GATES, Gate
from psstereo.plan.options import Options

__all__ = ["asked_gate", "gate_of"]


def asked_gate(options: Options) -> Gate | None:
    """Return the gate that was asked for, by itself or with a solver; None if there is none."""
    if options.gate is not None:
        return options.gate
    return None if options.solver is None else options.solver.gate


def gate_of(*, shadow: bool, saturation: bool) -> Gate:
    """Return the gate with these halves."""
    return next(one for one in GATES.values() if one.shadow is shadow and one.saturation is saturation)
