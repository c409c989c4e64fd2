"""Errors a person can act on: what was given, what is needed, what to do."""

from typing import Any

__all__ = [
    "ExistingResultError",
    "InputError",
    "MissingFileError",
    "OptionError",
    "PsstereoError",
    "RigError",
    "UnreadableFileError",
    "UnsupportedError",
]


class PsstereoError(Exception):
    """Root of all errors that this package raises on purpose.

    Parameters
    ----------
    given : str
        What was given or found, as a sentence.
    needed : str
        What is needed instead, as a sentence.
    remedy : str
        What to do about it, as a sentence.

    Examples
    --------
    >>> print(InputError(given="2 lights.", needed="At least 3 are needed.", remedy="Add images."))
    2 lights. At least 3 are needed. Add images.
    """

    def __init__(self, *, given: str, needed: str, remedy: str) -> None:
        super().__init__(f"{given} {needed} {remedy}")
        self.given = given
        self.needed = needed
        self.remedy = remedy

    def __str__(self) -> str:
        return f"{self.given} {self.needed} {self.remedy}"

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuild, (type(self), self.given, self.needed, self.remedy)


def _rebuild(kind: type[PsstereoError], given: str, needed: str, remedy: str) -> PsstereoError:
    """Unpickle an error (its arguments are keyword-only, which pickle does not know)."""
    return kind(given=given, needed=needed, remedy=remedy)


class InputError(PsstereoError, ValueError):
    """Data that cannot be used: wrong shape, wrong range, nothing left to work on."""


class RigError(InputError):
    """Lights that cannot give normals: too few, coplanar, zero, not a number."""


class OptionError(PsstereoError, ValueError):
    """An option's value that no method knows."""


class UnsupportedError(PsstereoError, TypeError):
    """A method that does not support what it was given, although another one may."""


class MissingFileError(PsstereoError, FileNotFoundError):
    """A file or folder that is not there."""


class UnreadableFileError(PsstereoError, OSError):
    """A file that is there but damaged, truncated or of another kind than its name says."""


class ExistingResultError(PsstereoError, FileExistsError):
    """A result that would be overwritten without having been asked for."""
