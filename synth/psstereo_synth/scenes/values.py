"""Values of a scene file's tables, refused with their name if they are of another kind."""

import math
from typing import Any

import numpy as np

from psstereo.io.toml_section import Section
from psstereo.types import FloatArray

__all__ = ["as_numbers", "numbers", "positive", "real", "truth", "vector", "whole"]


def real(section: Section, key: str, default: float) -> float:
    """Return a finite number, or the default if it is not there."""
    value = section.values.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise section.wrong(key, "a finite number")
    return float(value)


def positive(section: Section, key: str, default: float) -> float:
    """Return a positive finite number, or the default if it is not there."""
    value = section.number(key)
    return default if value is None else value


def whole(section: Section, key: str, default: int, *, least: int, most: int) -> int:
    """Return a whole number within bounds, or the default if it is not there."""
    value = section.values.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise section.wrong(key, f"a whole number from {least} to {most}")
    return value


def truth(section: Section, key: str, *, default: bool) -> bool:
    """Return true or false, or the default if it is not there."""
    value = section.values.get(key, default)
    if not isinstance(value, bool):
        raise section.wrong(key, "true or false, without quotation marks")
    return value


def vector(section: Section, key: str, default: tuple[float, float, float] | None) -> FloatArray:
    """Return three finite numbers, or the default if they are not there; without one they have to be."""
    value = section.values.get(key, None if default is None else list(default))
    found = as_numbers(value)
    if found is None or found.shape != (3,) or not np.isfinite(found).all():
        raise section.wrong(key, "three numbers [x, y, z]")
    return found


def numbers(section: Section, key: str, needed: str) -> FloatArray:
    """Return a number or nested lists of numbers as an array, which may hold NaN."""
    found = as_numbers(section.values.get(key))
    if found is None or found.size == 0:
        raise section.wrong(key, needed)
    return found


def as_numbers(value: Any) -> FloatArray | None:
    """Return a number, or lists of numbers of equal lengths, as a float64 array; None for anything else.

    Parameters
    ----------
    value : object
        What TOML gave.

    Returns
    -------
    float64 array or None
        The numbers. Text that looks like one is none, nor is true or false.
    """
    if not _only_numbers(value):
        return None
    try:
        return np.asarray(value, np.float64)
    except ValueError:  # rows of different lengths
        return None


def _only_numbers(value: Any) -> bool:
    if isinstance(value, list):
        return all(_only_numbers(item) for item in value)
    return isinstance(value, int | float) and not isinstance(value, bool)
