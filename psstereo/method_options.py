"""A method's options as words: listed with their types and meanings, read from text, written for the record.

A method is a frozen dataclass with a ``name``: a normal solver, an integrator, a way to shape from shading. Its options
are its fields, so that a new method has nothing to declare twice: their types say how a word is read, their defaults
stand in the class, and their meanings in its docstring under ``Attributes``. A field whose value is a member of a
family names that family: ``field(metadata={"choices": FAMILY})``.
"""

import inspect
import math
import re
import types
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, Field, dataclass, fields
from enum import Enum
from functools import partial
from typing import Any, ClassVar, Literal, Protocol, TypeVar, Union, get_args, get_origin, get_type_hints

from psstereo.catalogue import choose
from psstereo.errors import OptionError

__all__ = ["Method", "MethodOption", "configure", "options_of", "settings_of"]


class Method(Protocol):
    """What has options: a dataclass with a name."""

    __dataclass_fields__: ClassVar[dict[str, Any]]
    name: ClassVar[str]


M = TypeVar("M", bound=Method)

_WORDS = {"true": True, "yes": True, "on": True, "1": True, "false": False, "no": False, "off": False, "0": False}
_NONE = "none"


@dataclass(frozen=True, kw_only=True)
class MethodOption:
    """One option of a method.

    Attributes
    ----------
    name : str
        What it is called.
    kind : str
        What is to be given, for a person.
    default : bool, int, float, str or None
        Its value if nothing is said; a member of a family by its name.
    meaning : str
        What it does; empty where Python runs without docstrings.
    """

    name: str
    kind: str
    default: bool | int | float | str | None
    meaning: str


def options_of(method: type[Method]) -> tuple[MethodOption, ...]:
    """List the options of a method.

    Parameters
    ----------
    method : type
        A class of the catalogue.

    Returns
    -------
    tuple of MethodOption
        In the order of declaration.

    Examples
    --------
    >>> from psstereo.normals import NORMAL_SOLVERS
    >>> [option.name for option in options_of(NORMAL_SOLVERS["least-squares"])]
    ['gate']
    """
    meanings = _meanings(method)
    return tuple(
        MethodOption(
            name=entry.name,
            kind=_kind(entry, hint),
            default=_plain(_default(entry)),
            meaning=meanings.get(entry.name, ""),
        )
        for entry, hint in _settable(method)
    )


def configure(method: type[M], words: Mapping[str, str]) -> M:
    """Build a method from words.

    Parameters
    ----------
    method : type
        A class of the catalogue.
    words : mapping of str
        Values by option, as a person writes them; hyphens in names stand for underscores.

    Returns
    -------
    Method
        With all else at its defaults.

    Raises
    ------
    OptionError
        If an option or its value is unknown; the nearest names are offered.

    Examples
    --------
    >>> from psstereo.normals import NORMAL_SOLVERS
    >>> configure(NORMAL_SOLVERS["least-squares"], {"gate": "none"}).gate.shadow
    False
    """
    known = {entry.name: (entry, hint) for entry, hint in _settable(method)}
    values: dict[str, Any] = {}
    for key, word in words.items():
        entry, hint = choose(known, key.strip().replace("-", "_"), f"option of {method.name}")
        if entry.name in values:
            raise OptionError(
                given=f"The option {entry.name} was given twice.", needed="One value.", remedy="Leave one of them out."
            )
        values[entry.name] = _read(entry, hint, word.strip())
    return method(**values)


def settings_of(method: Method) -> dict[str, Any]:
    """Return a method's options as plain values, for the record.

    Examples
    --------
    >>> from psstereo.normals import LeastSquares
    >>> settings_of(LeastSquares())
    {'gate': 'auto'}
    """
    return {entry.name: _plain(getattr(method, entry.name)) for entry in fields(method)}


def _settable(method: type[Method]) -> list[tuple[Field[Any], Any]]:
    """Return the fields that a word can set, with their types."""
    hints = get_type_hints(method)
    every = [(entry, hints[entry.name]) for entry in fields(method) if entry.init]
    return [(entry, hint) for entry, hint in every if _kind(entry, hint)]


def _bare(hint: Any) -> tuple[Any, bool]:
    """Return a type without None, and whether None is allowed."""
    if get_origin(hint) not in (Union, types.UnionType):
        return hint, False
    parts = [part for part in get_args(hint) if part is not types.NoneType]
    return (parts[0] if len(parts) == 1 else hint), len(parts) < len(get_args(hint))


def _family(entry: Field[Any], hint: Any) -> Mapping[str, Any] | None:
    """Return the members from which the option is chosen, by name; None for a number or free text."""
    if "choices" in entry.metadata:
        choices = entry.metadata["choices"]
        return dict(choices) if isinstance(choices, Mapping) else {str(one): one for one in choices}
    kind, _ = _bare(hint)
    if get_origin(kind) is Literal:
        return {str(one): one for one in get_args(kind)}
    if inspect.isclass(kind) and issubclass(kind, Enum):
        return {str(one.value): one for one in kind}
    return None


_KINDS: dict[Any, str] = {bool: "true or false", int: "whole number", float: "number", str: "word"}


def _kind(entry: Field[Any], hint: Any) -> str:
    """Say what is to be given; empty if no word can give it."""
    bare, optional = _bare(hint)
    family = _family(entry, hint)
    named = ", ".join(family) if family is not None else _KINDS.get(bare, "")
    return f"{named}, or {_NONE}" if named and optional else named


def _read(entry: Field[Any], hint: Any, word: str) -> Any:
    bare, optional = _bare(hint)
    if optional and word.lower() == _NONE:
        return None
    family = _family(entry, hint)
    if family is not None:
        return choose(family, word, f"value of the option {entry.name}")
    if bare is str:
        return word
    readers: dict[Any, Any] = {bool: lambda text: _WORDS[text.lower()], int: partial(int, base=10), float: _number}
    try:
        return readers[bare](word)
    except (ValueError, KeyError):
        raise OptionError(
            given=f"The option {entry.name} is {word!r}.",
            needed=f"What is needed: {_kind(entry, hint)}.",
            remedy=f"Its default is {_plain(_default(entry))}.",
        ) from None


def _number(text: str) -> float:
    value = float(text)
    if math.isnan(value):
        raise ValueError(text)
    return value


def _default(entry: Field[Any]) -> Any:
    if entry.default_factory is not MISSING:
        return entry.default_factory()
    return None if entry.default is MISSING else entry.default


def _plain(value: Any) -> Any:
    """Return a value of plain types: a member of a family by its name."""
    if isinstance(value, Enum):
        return value.value
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, Iterable):
        return [_plain(one) for one in value]
    return str(getattr(value, "name", value))


def _meanings(method: type[Method]) -> dict[str, str]:
    """Return what the docstrings of a class and its bases say of each attribute, the class itself first."""
    pattern = re.compile(r"^Attributes\n-+\n(.*?)(?:\n\n\S+\n-+\n|\Z)", re.DOTALL | re.MULTILINE)
    meanings: dict[str, str] = {}
    for one in method.__mro__:
        section = pattern.search(inspect.cleandoc(one.__doc__ or ""))
        if section is None:
            continue
        for names, text in re.findall(r"^(\w+(?:, \w+)*) : .*\n((?:[ \t]+.*\n?|\n)*)", section[1], re.MULTILINE):
            for name in names.split(", "):
                meanings.setdefault(name, " ".join(text.replace("``", "").split()))
    return meanings
