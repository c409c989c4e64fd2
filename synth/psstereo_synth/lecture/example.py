"""What a worked example gives: a statement, a small table of numbers, and how far they are from it."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["Cell", "Example", "largest_of", "largest_relative"]

Cell = float | str
"""An entry of a table."""


@dataclass(frozen=True, kw_only=True)
class Example:
    """A statement, worked out in numbers.

    Attributes
    ----------
    title : str
        What it is about, in a few words.
    statement : str
        The statement, one sentence.
    columns : tuple of str
        Headings, each with its unit.
    rows : tuple of tuple of float or str
        Entries, one a column in every row.
    largest_error : float
        The largest distance of the numbers from the statement; what it is relative to stands in the example's
        docstring [1].
    tolerance : float
        What rounding, or the part that the statement neglects, may leave of it [1].
    holds : bool
        Whether the error is within the tolerance, and any counterexample in the table is one.
    notes : tuple of str
        Figures that belong to no row.
    """

    title: str
    statement: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    largest_error: float
    tolerance: float
    holds: bool
    notes: tuple[str, ...] = ()

    def column(self, heading: str) -> tuple[Cell, ...]:
        """Return a column.

        Parameters
        ----------
        heading : str
            How its heading begins, as far as no other's does.

        Returns
        -------
        tuple of float or str
            Its entries, from the top.

        Raises
        ------
        KeyError
            If no column, or more than one, begins like that.

        Examples
        --------
        >>> from psstereo_synth.lecture import LECTURE
        >>> LECTURE["room"]().column("room")[0]
        'box'
        """
        found = [i for i, name in enumerate(self.columns) if name.startswith(heading)]
        if len(found) != 1:
            raise KeyError(heading)
        return tuple(row[found[0]] for row in self.rows)


def largest_relative(found: npt.ArrayLike, expected: npt.ArrayLike) -> float:
    """Return the largest |found − expected| / |expected|, NaN if any is.

    Parameters
    ----------
    found, expected : float array (...)
        Numbers, and what they should be, not 0 [any unit].

    Returns
    -------
    float
        The error [1].

    Examples
    --------
    >>> largest_relative([1.0, 2.5], [1.0, 2.0])
    0.25
    """
    wanted = np.asarray(expected, np.float64)
    return float(np.max(np.abs(np.asarray(found, np.float64) - wanted) / np.abs(wanted)))


def largest_of(*errors: float) -> float:
    """Return the largest of some errors, NaN if one is: the built-in max may drop it.

    Parameters
    ----------
    *errors : float
        One or more errors [1].

    Returns
    -------
    float
        The largest [1].

    Examples
    --------
    >>> largest_of(0.5, float("nan"))
    nan
    """
    return float(np.max(errors))
