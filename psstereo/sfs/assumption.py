"""What one image does not tell, and what was taken instead."""

from dataclasses import dataclass
from enum import Enum

__all__ = ["Assumption", "Basis"]


class Basis(Enum):
    """What an assumption rests on."""

    GIVEN = "given"
    """Somebody said so."""
    ESTIMATED = "estimated"
    """It was read from the image."""
    ASSUMED = "assumed"
    """Nothing supports it: the method needs it, and another choice would give another surface."""


@dataclass(frozen=True, kw_only=True)
class Assumption:
    """One thing that a single image does not tell.

    Attributes
    ----------
    name : str
        What it is about, such as ``"light"``, ``"albedo"``, ``"boundary"``, ``"relief"``.
    basis : Basis
        What it rests on.
    sentence : str
        What was taken, for a person.
    """

    name: str
    basis: Basis
    sentence: str
