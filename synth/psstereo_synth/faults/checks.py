"""Checks that faults make on their options."""

import numpy as np

from psstereo.errors import OptionError

__all__ = ["require", "require_size"]


def require(fine: bool, what: str, value: object, needed: str) -> None:
    """Refuse an option.

    Parameters
    ----------
    fine : bool
        Whether the option can be used.
    what : str
        What it is, after "The".
    value : object
        What was given.
    needed : str
        What it must be, after "It must be".

    Raises
    ------
    OptionError
        If it cannot be used.
    """
    if not fine:
        raise OptionError(
            given=f"The {what} is {value}.",
            needed=f"It must be {needed}.",
            remedy="Correct it, or leave this fault out.",
        )


def require_size(what: str, value: float, *, below: float = np.inf) -> None:
    """Refuse a size that is negative, not a number, or too large.

    Parameters
    ----------
    what : str
        What it is the size of.
    value : float
        What was given.
    below : float
        Bound that it must not reach.

    Raises
    ------
    OptionError
        If it is out of range.
    """
    limit = "finite" if below == np.inf else f"below {below:.4g}"
    require(0 <= value < below, what, value, f"zero or more, and {limit}")
