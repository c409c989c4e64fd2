"""Light directions and strengths from a file of any of the usual shapes."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from psstereo.errors import InputError, OptionError, UnreadableFileError
from psstereo.io.mat_file import read_mat
from psstereo.io.text import parse_numbers, read_lines, read_table
from psstereo.stack.decode import read_bytes
from psstereo.types import FloatArray

__all__ = ["Directions", "as_rows", "read_directions"]


@dataclass(frozen=True, eq=False)
class Directions:
    """Vectors toward lights as they stand in a file, not normalised.

    Attributes
    ----------
    vectors : float64 array (m, 3)
        One row a light.
    notes : tuple of str
        What was found out about them, as sentences.
    strengths : float64 array (m, 3) or None
        Strengths of the lights, where the file holds them too [relative].
    """

    vectors: FloatArray
    notes: tuple[str, ...] = ()
    strengths: FloatArray | None = None


def as_rows(values: FloatArray, count: int | None, source: str, *, layout: str | None = None) -> Directions:
    """Turn a matrix of light vectors into one row a light.

    Parameters
    ----------
    values : float array (m, 3) or (3, m)
        The matrix as read.
    count : int or None
        Number of images, if known.
    source : str
        Name of the file, for messages.
    layout : {"rows", "columns"}, optional
        One light a row or a column; needed for 3 × 3 numbers, which fit both.

    Returns
    -------
    Directions
        One row a light.

    Raises
    ------
    InputError
        If the matrix is 3 × 3 and no layout is given, or fits neither.
    OptionError
        If the layout is neither word.
    """
    if layout not in (None, "rows", "columns"):
        raise OptionError(
            given=f"The layout of the lights is {layout!r}.",
            needed="It is rows (one light a row) or columns (one light a column).",
            remedy="Choose one of the two words.",
        )
    rows, columns = values.shape
    same_both_ways = (rows, columns) == (3, 3) and bool((values == values.T).all())
    if layout is None and (rows, columns) == (3, 3) and count in (None, 3) and not same_both_ways:
        raise InputError(
            given=f"{source} holds 3 × 3 numbers.",
            needed="It must be known whether a light is a row or a column; the numbers cannot tell.",
            remedy="Say --lights-layout rows or columns, or write lights.layout in capture.toml.",
        )
    transposed = layout == "columns" or (layout is None and columns != 3 and rows == 3)
    vectors = values.T if transposed else values
    if vectors.shape[1] != 3 or (count is not None and len(vectors) != count):
        raise InputError(
            given=f"{source} holds {rows} rows of {columns} numbers"
            + (f"; there are {count} images." if count is not None else "."),
            needed="Each image needs one light of three numbers, x y z.",
            remedy="Check for missing or extra rows; a light taken out needs its image taken out too.",
        )
    note = (f"{source} has one light a column; it was transposed.",) if transposed else ()
    return Directions(np.ascontiguousarray(vectors, np.float64), note)


def read_directions(path: Path, count: int | None = None, *, layout: str | None = None) -> Directions:
    """Read light vectors from text, ``.lp``, ``.json`` (Meshroom), ``.npy`` or ``.mat``.

    Parameters
    ----------
    path : Path
        ``.lp`` (count, then name and vector a line), ``.json`` of Meshroom, ``.npy``, ``.mat`` with one matrix that
        fits, or text with one light a row or a column; a first line that holds only the count is skipped.
    count : int, optional
        Number of images.
    layout : {"rows", "columns"}, optional
        One light a row or a column, where the numbers cannot tell.

    Returns
    -------
    Directions
        Vectors in the order of the file.

    Raises
    ------
    InputError
        If the shape fits neither reading, or both.
    OptionError
        If the layout is no known word.
    MissingFileError, UnreadableFileError
        If the file is not there or holds something else.
    """
    suffix = path.suffix.lower()
    if suffix == ".lp":
        from psstereo.io.lp_file import read_lp

        entries = read_lp(path)
        return as_rows(entries.vectors, count, path.name, layout="rows")
    if suffix == ".json":
        from psstereo.io.light_json import read_light_json

        lights = read_light_json(path)
        found = as_rows(lights.vectors, count, path.name, layout="rows")
        return Directions(found.vectors, (), lights.strengths)
    if suffix == ".npy":
        return as_rows(_numpy_matrix(path), count, path.name, layout=layout)
    if suffix == ".mat":
        return as_rows(_matlab_matrix(path), count, path.name, layout=layout)
    above, said = _count_line(path)
    table = read_table(path, skip=above)
    if said is not None:
        if said != len(table.values):
            raise UnreadableFileError(
                given=f"{path.name} says {said} lights on its first line and has {len(table.values)} lines of lights.",
                needed="The two numbers must agree; otherwise part of the file may be missing.",
                remedy="Correct the first line, or copy the file again.",
            )
        layout = layout or "rows"
    found = as_rows(table.values, count, path.name, layout=layout)
    return Directions(found.vectors, table.notes + found.notes)


def _count_line(path: Path) -> tuple[int, int | None]:
    """Return the number of lines down to a count of lights above rows of three, and the count; (0, None) if none."""
    lines = read_lines(path)
    filled = [i for i, line in enumerate(lines) if line.strip() and line.strip()[0] not in "#%"]
    if len(filled) < 2 or not lines[filled[0]].strip().isdecimal():
        return 0, None
    numbers = parse_numbers(lines[filled[1]])
    return (filled[0] + 1, int(lines[filled[0]])) if numbers and len(numbers[0]) == 3 else (0, None)


def _numpy_matrix(path: Path) -> FloatArray:
    read_bytes(path)
    try:
        return _matrix(np.load(path, allow_pickle=False), path)
    except (ValueError, OSError, EOFError) as error:
        raise _unreadable(path, str(error)) from None


def _matlab_matrix(path: Path) -> FloatArray:
    content = read_mat(path)
    fits = [value for value in content.values() if getattr(value, "ndim", 0) == 2 and 3 in value.shape]
    if len(fits) != 1:
        raise _unreadable(path, f"it holds {len(fits)} matrices with three rows or columns")
    return _matrix(fits[0], path)


def _matrix(values: object, path: Path) -> FloatArray:
    array = np.asarray(values)
    if array.ndim != 2 or array.dtype.kind not in "fiu":
        raise _unreadable(path, f"it holds an array of shape {array.shape} and type {array.dtype}")
    return array.astype(np.float64)


def _unreadable(path: Path, why: str) -> UnreadableFileError:
    return UnreadableFileError(
        given=f"The lights file {path} cannot be read: {why}.",
        needed="A matrix of three numbers a light.",
        remedy="Save the light directions as text, one line x y z for each image.",
    )
