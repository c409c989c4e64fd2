"""A problem whose answer is known, for measuring solvers on."""

from collections.abc import Callable
from dataclasses import dataclass

from psstereo.capture import Capture, Truth

__all__ = ["Problem"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """A named capture with its truth, made when it is needed.

    Attributes
    ----------
    name : str
        Name in the records.
    summary : str
        What it tests, in one line.
    make : callable
        Returns the capture and its truth; the same every time.
    """

    name: str
    summary: str
    make: Callable[[], tuple[Capture, Truth]]
