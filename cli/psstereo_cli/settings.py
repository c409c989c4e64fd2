"""Options of methods as words: ``--option KEY=VALUE``, for solvers and integrators alike."""

from typing import TYPE_CHECKING, TypeVar

from psstereo.errors import OptionError

if TYPE_CHECKING:
    from psstereo.depth import Integrator
    from psstereo.method_options import Method
    from psstereo.sfs import ShadingMethod

__all__ = ["build_integrator", "build_shading_method", "parse_settings"]

M = TypeVar("M", bound="Method")


def parse_settings(words: list[str], *, example: str, remedy: str) -> dict[str, str]:
    """Take ``KEY=VALUE`` apart.

    Parameters
    ----------
    words : list of str
        As on the command line.
    example, remedy : str
        For the message if one of them is something else.

    Returns
    -------
    dict of str
        Values by key, as they were written.

    Raises
    ------
    OptionError
        If a word is no such pair, or a key comes twice.
    """
    settings: dict[str, str] = {}
    for word in words:
        key, sign, value = word.partition("=")
        if not sign or not key.strip() or not value.strip() or key in settings:
            raise OptionError(
                given=f"The option is {word!r}{', and was given before' if key in settings else ''}.",
                needed=f"KEY=VALUE, each key once, such as {example}.",
                remedy=remedy,
            )
        settings[key] = value
    return settings


def build_integrator(name: str, words: list[str], *, threads: int) -> "Integrator":
    """Build the integrator that was named.

    Parameters
    ----------
    name : str
        From the catalogue.
    words : list of str
        Its options, KEY=VALUE.
    threads : int
        Threads, which have an option of their own at the command.

    Returns
    -------
    Integrator
        With all else at its defaults.

    Raises
    ------
    OptionError
        If the integrator, an option or its value is unknown.
    """
    from psstereo.catalogue import choose
    from psstereo.depth import INTEGRATORS

    return _build(choose(INTEGRATORS, name, "integrator"), words, threads)


def build_shading_method(name: str, words: list[str], *, threads: int) -> "ShadingMethod":
    """Build the method of shape from shading that was named.

    Parameters
    ----------
    name : str
        From the catalogue.
    words : list of str
        Its options, KEY=VALUE.
    threads : int
        Threads, which have an option of their own at the command.

    Returns
    -------
    ShadingMethod
        With all else at its defaults.

    Raises
    ------
    OptionError
        If the method, an option or its value is unknown.
    """
    from psstereo.catalogue import choose
    from psstereo.sfs import SHADING_METHODS

    return _build(choose(SHADING_METHODS, name, "method"), words, threads)


def _build(method: "type[M]", words: list[str], threads: int) -> "M":
    """Build a method whose threads have an option of their own."""
    from psstereo.catalogue import choose
    from psstereo.method_options import configure, options_of

    keys = [option.name for option in options_of(method) if option.name != "threads"]
    settings = parse_settings(
        words, example="max_iterations=500", remedy=f"Those of {method.name} are {', '.join(keys) or 'none'}."
    )
    for key in settings:
        choose(dict.fromkeys(keys), key.strip().replace("-", "_"), f"option of {method.name}")
    return configure(method, {**settings, "threads": str(threads)})
