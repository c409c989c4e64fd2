"""Members of a family from the tables of a scene file: the keys are the fields of the class."""

import math
import typing
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields
from pathlib import Path
from types import UnionType
from typing import Any, Literal, TypeVar

import numpy as np
import numpy.typing as npt

from psstereo.catalogue import choose
from psstereo.errors import InputError, PsstereoError
from psstereo.io.toml_section import Section
from psstereo_synth.scenes.values import as_numbers

__all__ = ["build", "build_member", "parameters"]

T = TypeVar("T")

_DEGREES = "_deg"
"""Ending of the keys of angles: in files they are in degrees, in code they are not."""

_ANGLES = frozenset({"Gradient.direction", "LightError.direction", "OrenNayar.roughness", "Ripples.direction"})
"""Fields that are angles; a test compares this with the units in their docstrings."""

_WORDS = {
    "truth": "true or false",
    "whole": "a whole number",
    "real": "a finite number",
    "text": "text",
    "path": "a file name",
    "tuple": "a list of numbers",
    "array": "a list of numbers",
}
_SIMPLE = {bool: "truth", int: "whole", float: "real", str: "text", Path: "path"}


def build_member(family: Mapping[str, type[T]], section: Section, key: str, what: str) -> T:
    """Build the member of a family that a table names.

    Parameters
    ----------
    family : mapping
        Classes by name.
    section : Section
        The table: `key` names the class, the other keys are its fields.
    key : str
        Key of the name.
    what : str
        What members are called, for messages.

    Returns
    -------
    object
        The member.

    Raises
    ------
    OptionError
        If the name or a key is unknown; the nearest are offered.
    InputError
        If a value is missing, or of another kind.
    """
    name = section.text(key)
    if name is None:
        raise InputError(
            given=f"[{section.name}] in {section.file.name} does not say which {what}.",
            needed=f"{key} = one of {', '.join(family)}.",
            remedy=f'Add a line such as {key} = "{next(iter(family))}".',
        )
    return build(choose(family, name, what), section, known=(key,))


def build(kind: type[T], section: Section, *, known: tuple[str, ...] = ()) -> T:
    """Build a dataclass from a table.

    Parameters
    ----------
    kind : type
        The class.
    section : Section
        The table.
    known : tuple of str
        Keys that belong to someone else.

    Returns
    -------
    object
        The value.

    Raises
    ------
    PsstereoError
        If a key is unknown or missing, or a value means nothing.
    """
    values = parameters(kind, section, known=known)
    try:
        return kind(**values)
    except PsstereoError:
        raise
    except (TypeError, ValueError) as error:
        raise InputError(
            given=f"[{section.name}] in {section.file.name} holds values that do not fit ({error}).",
            needed="Numbers, lists of numbers, true or false, or text, as the template shows.",
            remedy="Correct that table.",
        ) from None


def parameters(
    kind: type[Any], section: Section, *, known: tuple[str, ...] = (), given: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Return the fields of a dataclass that a table holds, angles in radians, lists as arrays or tuples.

    Parameters
    ----------
    kind : type
        The class.
    section : Section
        The table.
    known : tuple of str
        Keys that belong to someone else.
    given : tuple of str
        Fields that come from elsewhere: the table need not have them, and must not.

    Returns
    -------
    dict
        Values by field.

    Raises
    ------
    PsstereoError
        If a key is unknown or missing, or a value of another kind.
    """
    keys = {key: entry for key, entry in _fields(kind).items() if entry[0] not in given}
    section.allow([*known, *keys])
    missing = [key for key, (_, field) in keys.items() if _required(field) and key not in section.values]
    if missing:
        raise InputError(
            given=f"[{section.name}] in {section.file.name} has no {' and no '.join(missing)}.",
            needed=f"It takes {', '.join(keys)}.",
            remedy="Add the missing lines.",
        )
    return {
        name: _convert(section, key, _kinds(field.type), angle=key != name)
        for key, (name, field) in keys.items()
        if key in section.values
    }


def _fields(kind: type[Any]) -> dict[str, tuple[str, Field[Any]]]:
    """Return the fields of a class by the keys that they have in files."""
    found = {}
    for field in fields(kind):
        if field.init:
            angle = f"{kind.__name__}.{field.name}" in _ANGLES
            found[f"{field.name}{_DEGREES}" if angle else field.name] = (field.name, field)
    return found


def _required(field: Field[Any]) -> bool:
    return field.default is MISSING and field.default_factory is MISSING


def _kinds(hint: Any) -> frozenset[str]:
    """Return what a field with such a type hint takes from a file."""
    if hint == npt.ArrayLike or typing.get_origin(hint) is np.ndarray:
        return frozenset({"real", "array"})
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, UnionType):
        return frozenset().union(*(_kinds(part) for part in parts))
    if origin is Literal:
        return frozenset(_SIMPLE[type(part)] for part in parts)
    if origin is tuple:
        return frozenset({"tuple"})
    return frozenset({_SIMPLE[hint]}) if hint in _SIMPLE else frozenset()


def _convert(section: Section, key: str, kinds: frozenset[str], *, angle: bool) -> Any:
    """Return a value as its field wants it; its kind is checked here, its range by the class itself."""
    value = section.values[key]
    if isinstance(value, bool) and "truth" in kinds:
        return value
    if isinstance(value, str) and "path" in kinds and value:
        return section.file.parent / value
    if isinstance(value, str) and "text" in kinds:
        return value
    numbers = as_numbers(value)
    if numbers is not None and _fits(value, kinds):
        if isinstance(value, list):
            value = tuple(value) if "array" not in kinds else numbers
        return np.deg2rad(value) if angle else value
    raise section.wrong(key, " or ".join(_WORDS[kind] for kind in _WORDS if kind in kinds))


def _fits(value: Any, kinds: frozenset[str]) -> bool:
    """Return whether a number, or lists of numbers, is among what a field takes."""
    if isinstance(value, list):
        return "array" in kinds or ("tuple" in kinds and not any(isinstance(item, list) for item in value))
    if isinstance(value, int):
        return bool(kinds & {"whole", "real"})
    return "real" in kinds and math.isfinite(value)
