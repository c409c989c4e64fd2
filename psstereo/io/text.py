"""Numbers in text files as people write them: any blanks, commas, decimal commas, comments, Windows line ends."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from psstereo.errors import MissingFileError, UnreadableFileError
from psstereo.stack.decode import read_bytes
from psstereo.types import FloatArray

__all__ = ["Table", "parse_numbers", "read_lines", "read_table", "require_file"]

_DECIMAL_COMMA = re.compile(r"^[+-]?\d*,\d+(?:[eE][+-]?\d+)?$")


@dataclass(frozen=True, eq=False)
class Table:
    """Numbers of a text file.

    Attributes
    ----------
    values : float64 array (rows, columns)
        The numbers.
    notes : tuple of str
        What was unusual about them, as sentences.
    """

    values: FloatArray
    notes: tuple[str, ...] = ()


def require_file(path: Path) -> None:
    """Refuse a path that is no file.

    Raises
    ------
    MissingFileError
        If it is not there, or a folder.
    """
    if not path.is_file():
        raise MissingFileError(
            given=f"The file {path} {'is a folder' if path.is_dir() else 'does not exist'}.",
            needed="The file that was named.",
            remedy="Check its name and folder.",
        )


def read_lines(path: Path) -> list[str]:
    """Return the lines of a text file without line ends, byte-order mark and blank lines at the end.

    Raises
    ------
    MissingFileError
        If the file is not there.
    UnreadableFileError
        If it is empty or no text.
    """
    require_file(path)
    raw = read_bytes(path).tobytes()
    encoding = "utf-16" if raw[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        text = raw.decode(encoding)
    except UnicodeDecodeError:
        text = raw.decode("latin-1")  # file names with accents from an old Windows; cut-short UTF-16 keeps its zeros
    if "\0" in text:
        raise UnreadableFileError(
            given=f"The file {path} is not text.",
            needed="A text file with numbers.",
            remedy="Check that the right file was named.",
        )
    # Not splitlines, which also breaks at characters that stand in file names.
    return re.split(r"\r\n|\n|\r", text.rstrip())


def parse_numbers(line: str) -> tuple[list[float], bool] | None:
    """Return the numbers of a line and whether decimal commas were read, or None if it holds anything else.

    Examples
    --------
    >>> parse_numbers("0,577 -1e-3; 2")
    ([0.577, -0.001, 2.0], True)
    >>> parse_numbers("0.1, 0.2,0.3")
    ([0.1, 0.2, 0.3], False)
    """
    tokens = [token.strip(",") for token in re.split(r"[\s;]+", line.strip()) if token.strip(",")]
    decimal = [bool(_DECIMAL_COMMA.match(token)) for token in tokens]
    comma = any(decimal) and all(d or "," not in t for d, t in zip(decimal, tokens, strict=True)) and len(tokens) > 1
    parts = [t.replace(",", ".") for t in tokens] if comma else [p for t in tokens for p in t.split(",") if p]
    try:
        return [float(part) for part in parts], comma
    except ValueError:
        return None


def read_table(path: Path, *, skip: int = 0) -> Table:
    """Read a rectangle of numbers.

    Parameters
    ----------
    path : Path
        Text file; ``#`` and ``%`` begin comments.
    skip : int
        Lines at the top that are not part of the table.

    Returns
    -------
    Table
        At least one number.

    Raises
    ------
    MissingFileError
        If the file is not there.
    UnreadableFileError
        If a line holds something else, or rows have different lengths; the message names the line.
    """
    rows: list[list[float]] = []
    commas = False
    for number, line in enumerate(read_lines(path)[skip:], start=skip + 1):
        text = re.split("[#%]", line, maxsplit=1)[0].strip()
        if not text:
            continue
        parsed = parse_numbers(text)
        if parsed is None or (rows and len(parsed[0]) != len(rows[0])):
            raise UnreadableFileError(
                given=f"Line {number} of {path} reads {line.strip()[:60]!r}.",
                needed=f"{len(rows[0]) if rows else 'Only'} numbers are expected on it.",
                remedy="Correct that line, or name the right file.",
            )
        rows.append(parsed[0])
        commas |= parsed[1]
    if not rows:
        raise UnreadableFileError(
            given=f"The file {path} holds no numbers.", needed="A table of numbers.", remedy="Name the right file."
        )
    notes = (f"{path.name} has decimal commas; they were read as decimal points.",) if commas else ()
    return Table(np.array(rows, np.float64), notes)
