"""Gates: which observations are left out before a solver fits them."""

from dataclasses import dataclass

from psstereo.catalogue import choose

__all__ = ["GATES", "Gate", "gate"]


@dataclass(frozen=True, kw_only=True)
class Gate:
    """A choice of observations to leave out.

    Attributes
    ----------
    name : str
        Name at the command.
    shadow : bool
        Leave out observations in attached and cast shadow; a Lambertian fit would take their zeros for data.
    saturation : bool
        Leave out observations with a channel at or near full scale, whose true value is unknown.
    sentence : str
        What it does, for a person.
    """

    name: str
    shadow: bool
    saturation: bool
    sentence: str


GATES: dict[str, Gate] = {
    gate.name: gate
    for gate in (
        Gate(name="none", shadow=False, saturation=False, sentence="Every observation is used as it is."),
        Gate(name="shadow", shadow=True, saturation=False, sentence="Shadowed observations are left out."),
        Gate(name="saturation", shadow=False, saturation=True, sentence="Saturated observations are left out."),
        Gate(name="auto", shadow=True, saturation=True, sentence="Shadowed and saturated observations are left out."),
    )
}
"""Every gate, by name."""


def gate(name: str) -> Gate:
    """Look a gate up.

    Raises
    ------
    OptionError
        If no gate has this name.

    Examples
    --------
    >>> gate("none").shadow
    False
    """
    return choose(GATES, name, "gate")
