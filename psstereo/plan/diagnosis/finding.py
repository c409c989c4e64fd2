"""What a check found out about a capture."""

from dataclasses import asdict, dataclass
from typing import Any, Literal, TypeAlias

__all__ = ["Finding", "Severity"]

Severity: TypeAlias = Literal["note", "warning", "fault"]
"""A note explains, a warning costs accuracy, a fault makes the result wrong."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One thing that is the matter with a capture.

    Attributes
    ----------
    name : str
        Name of the check that found it.
    severity : {"note", "warning", "fault"}
        How bad it is.
    figure : float
        The number that it rests on, in `unit`.
    unit : str
        Unit of the figure as it is printed; empty for plain ratios.
    sentence : str
        What is the matter, with its figure, for a person.
    remedy : str
        What to do about it.
    confidence : float
        From 0 to 1: how sure it is that this is the cause, and not something that looks like it [1].
    images : tuple of int
        Images that are concerned, counted from 0; empty if it concerns all of them.
    """

    name: str
    severity: Severity
    figure: float
    unit: str
    sentence: str
    remedy: str
    confidence: float
    images: tuple[int, ...] = ()

    def record(self) -> dict[str, Any]:
        """Return it as plain data for a record."""
        return asdict(self)
