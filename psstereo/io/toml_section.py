"""Typed access to the tables of a TOML file; what is unknown or of another type is refused with its name."""

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from psstereo.errors import InputError, OptionError
from psstereo.io.text import read_table
from psstereo.types import FloatArray

__all__ = ["Section"]


@dataclass(frozen=True)
class Section:
    """One table of a TOML file.

    Attributes
    ----------
    values : mapping
        Its keys and values.
    name : str
        Its name, empty for the file itself.
    file : Path
        The file; names of other files are relative to its folder.
    """

    values: Mapping[str, Any]
    name: str
    file: Path

    def allow(self, keys: Sequence[str]) -> None:
        """Refuse keys other than these, offering the nearest."""
        unknown = [key for key in self.values if key not in keys]
        if unknown:
            near = difflib.get_close_matches(unknown[0].lower(), keys, 1, 0.5)
            raise OptionError(
                given=f"{self.file.name} has {self._where(unknown[0])}, which is unknown.",
                needed=f"Known {f'in [{self.name}] ' if self.name else ''}are {', '.join(keys)}.",
                remedy=f"Did you mean {near[0]}?" if near else "Correct the name, or take the line out.",
            )

    def section(self, key: str) -> "Section":
        """Return a table, empty if it is not there."""
        value = self.values.get(key, {})
        if not isinstance(value, dict):
            raise self.wrong(key, "a table", f"Write [{key}] on a line of its own and its values below.")
        return Section(value, key, self.file)

    def text(self, key: str) -> str | None:
        """Return a string, None if it is not there."""
        value = self.values.get(key)
        if value is not None and not (isinstance(value, str) and value):
            raise self.wrong(key, "text between quotation marks")
        return value

    def choice(self, key: str, known: Sequence[str]) -> str | None:
        """Return one of several words, None if it is not there."""
        value = self.text(key)
        if value is not None and value not in known:
            near = difflib.get_close_matches(value.lower(), known, 1)
            raise OptionError(
                given=f"{self._where(key)} in {self.file.name} is {value!r}.",
                needed=f"Known are {', '.join(known)}.",
                remedy=f"Did you mean {near[0]}?" if near else "Choose one of them.",
            )
        return value

    def number(self, key: str) -> float | None:
        """Return a positive finite number, None if it is not there."""
        value = self.values.get(key)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float) or not (np.isfinite(value) and value > 0):
            raise self.wrong(key, "a positive number")
        return float(value)

    def path(self, key: str) -> Path | None:
        """Return a file name as a path, None if it is not there."""
        value = self.text(key)
        return None if value is None else self.file.parent / value

    def matrix(self, key: str, columns: int | None = None) -> FloatArray | None:
        """Return a table of numbers, written here or in a file that is named here, None if it is not there.

        Parameters
        ----------
        key : str
            Name of the value: a list of rows, a list of numbers (one column), or a file name.
        columns : int, optional
            Numbers in a row, if that is fixed.
        """
        value = self.values.get(key)
        if value is None:
            return None
        if isinstance(value, str):
            return read_table(self.file.parent / value).values
        needed = "a list of numbers" if columns == 1 else f"a list of rows of {columns or 'equally many'} numbers each"
        try:
            array = np.asarray(value, np.float64)
        except (TypeError, ValueError):
            raise self.wrong(key, f"{needed}, or the name of a file") from None
        array = array[:, None] if array.ndim == 1 and columns in (None, 1) else array
        if array.ndim != 2 or 0 in array.shape or (columns is not None and array.shape[1] != columns):
            raise self.wrong(key, f"{needed}, or the name of a file")
        return array

    def wrong(self, key: str, needed: str, remedy: str = "Correct that line.") -> InputError:
        """Return the error that says what a value should be."""
        return InputError(
            given=f"{self._where(key)} in {self.file.name} is {str(self.values.get(key))[:60]!r}.",
            needed=f"It must be {needed}.",
            remedy=remedy,
        )

    def _where(self, key: str) -> str:
        return f"{self.name}.{key}" if self.name else key
