"""Looking a member of a family up by the name that a person gave."""

from collections.abc import Mapping
from difflib import get_close_matches
from typing import TypeVar

from psstereo.errors import OptionError

__all__ = ["choose"]

T = TypeVar("T")


def choose(catalogue: Mapping[str, T], name: str, what: str) -> T:
    """Return the member of a catalogue that has a name.

    Parameters
    ----------
    catalogue : mapping
        A family, by name.
    name : str
        What was asked for.
    what : str
        What the family's members are called, for the message.

    Returns
    -------
    object
        The member.

    Raises
    ------
    OptionError
        If there is none; the nearest names are offered.

    Examples
    --------
    >>> choose({"poisson": 1}, "poison", "integrator")
    Traceback (most recent call last):
    psstereo.errors.OptionError: The integrator 'poison' is unknown. Known are poisson. Did you mean poisson?
    """
    if name in catalogue:
        return catalogue[name]
    near = get_close_matches(name, catalogue, n=1)
    raise OptionError(
        given=f"The {what} {name!r} is unknown.",
        needed=f"Known are {', '.join(catalogue)}.",
        remedy=f"Did you mean {near[0]}?" if near else "Choose one of them.",
    )
