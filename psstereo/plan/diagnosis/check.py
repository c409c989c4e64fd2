"""The interface of a check."""

from abc import ABC, abstractmethod
from typing import ClassVar, Literal

from psstereo.plan.diagnosis.case import Case
from psstereo.plan.diagnosis.finding import Finding, Severity

__all__ = ["Check", "angle_between", "listed"]

_NAMED = 6


class Check(ABC):
    """One thing that can be the matter with a capture.

    A check says nothing rather than something doubtful: false alarms teach people not to read.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    stage: ClassVar[Literal["plain", "order", "fit"]]
    """``"plain"`` needs no fit, ``"order"`` asks whether lights and images belong together, and ``"fit"`` reads causes
    from what a fit leaves, which means nothing if a fault of the other two is found."""

    @abstractmethod
    def look(self, case: Case) -> Finding | None:
        """Return what is found, or None if all is well or nothing can be said."""

    def finding(
        self,
        severity: Severity,
        figure: tuple[float, str],
        words: tuple[str, str],
        confidence: float,
        images: tuple[int, ...] = (),
    ) -> Finding:
        """Put a finding together under this check's name.

        Parameters
        ----------
        severity : {"note", "warning", "fault"}
            How bad it is.
        figure : (float, str)
            The number and its unit.
        words : (str, str)
            Sentence and remedy.
        confidence : float
            From 0 to 1 [1].
        images : tuple of int
            Those that are concerned, counted from 0.

        Returns
        -------
        Finding
            The finding.
        """
        return Finding(
            name=self.name,
            severity=severity,
            figure=figure[0],
            unit=figure[1],
            sentence=words[0],
            remedy=words[1],
            confidence=confidence,
            images=images,
        )


def listed(images: tuple[int, ...], names: tuple[str, ...]) -> str:
    """Return a list of images for a sentence: numbers from 1, and names if there are any."""
    parts = [f"{i + 1}" + (f" ({names[i]})" if names[i] else "") for i in images[:_NAMED]]
    more = f" and {len(images) - _NAMED} more" if len(images) > _NAMED else ""
    return ", ".join(parts) + more


def angle_between(one: object, other: object) -> float:
    """Return the angle between two vectors, well-behaved for small ones [rad]."""
    import numpy as np

    a, b = np.asarray(one, np.float64), np.asarray(other, np.float64)
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
