"""Frozen records to plain data for JSON, and back with every value checked."""

import math
import types
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from psstereo.errors import InputError

__all__ = ["from_plain", "to_plain"]

_WORDS: dict[Any, str] = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}


def to_plain(value: Any) -> Any:
    """Return a record as mappings, lists and plain values; numbers that are not finite become None.

    Parameters
    ----------
    value : object
        A dataclass, mapping, tuple, or plain value.

    Returns
    -------
    object
        What JSON can hold.
    """
    if is_dataclass(value) and not isinstance(value, type):
        return {entry.name: to_plain(getattr(value, entry.name)) for entry in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): to_plain(one) for key, one in value.items()}
    if isinstance(value, tuple | list):
        return [to_plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def from_plain(kind: Any, data: Any, where: str) -> Any:
    """Build a record from plain data.

    Parameters
    ----------
    kind : type
        A dataclass of plain values, of tuples of them, and of other such records.
    data : object
        What JSON held.
    where : str
        What it is, for messages.

    Returns
    -------
    object
        The record.

    Raises
    ------
    InputError
        If an entry is missing, unknown, or not of its type.
    """
    if not isinstance(data, Mapping):
        raise _wrong(where, "an object with named entries", data)
    hints = get_type_hints(kind)
    known = {entry.name: entry for entry in fields(kind)}
    strange = sorted(set(data) - set(known))
    if strange:
        raise InputError(
            given=f"{where} has the entry {strange[0]!r}, which is unknown.",
            needed=f"Known are {', '.join(known)}.",
            remedy="Correct its name, or take it out.",
        )
    missing = [n for n, e in known.items() if n not in data and e.default is MISSING and e.default_factory is MISSING]
    if missing:
        raise InputError(
            given=f"{where} has no entry {missing[0]!r}.",
            needed="It cannot be done without.",
            remedy="Add it, or make the plan anew.",
        )
    return kind(**{name: _value(hints[name], one, f"{name} of {where}") for name, one in data.items()})


def _value(hint: Any, data: Any, where: str) -> Any:
    if get_origin(hint) in (Union, types.UnionType):
        if data is None and types.NoneType in get_args(hint):
            return None
        return _value(next(one for one in get_args(hint) if one is not types.NoneType), data, where)
    if get_origin(hint) is Literal:
        if data not in get_args(hint):
            raise _wrong(where, " or ".join(map(str, get_args(hint))), data)
        return data
    if get_origin(hint) is tuple:
        if not isinstance(data, list):
            raise _wrong(where, "a list", data)
        return tuple(_value(get_args(hint)[0], one, f"entry {i + 1} of {where}") for i, one in enumerate(data))
    if is_dataclass(hint):
        return from_plain(hint, data, where)
    return _scalar(hint, data, where)


def _scalar(kind: Any, data: Any, where: str) -> Any:
    if kind is float and data is None:
        return math.nan
    if kind is float and isinstance(data, int) and not isinstance(data, bool):
        return float(data)
    if type(data) is not kind or (kind is float and not math.isfinite(data)):
        raise _wrong(where, _WORDS[kind], data)
    return data


def _wrong(where: str, needed: str, data: Any) -> InputError:
    return InputError(
        given=f"{where[0].upper()}{where[1:]} is {str(data)[:40]!r}.",
        needed=f"It must be {needed}.",
        remedy="Correct it, or make the plan anew.",
    )
