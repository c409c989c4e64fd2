"""The light positions of RTI: ``.lp`` lists of image names and vectors."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from psstereo.capture import Capture, Truth
from psstereo.errors import InputError, OptionError, UnreadableFileError
from psstereo.io.distant_lights import distant_rig
from psstereo.io.image_names import base_name, match_files
from psstereo.io.light_file import Directions
from psstereo.io.parts import find_camera, find_mask, natural_order
from psstereo.io.reader import Choices, Reader
from psstereo.io.text import read_lines
from psstereo.stack import FileStack
from psstereo.types import FloatArray

__all__ = ["LpFile", "RtiLp", "read_lp", "write_lp"]

_SHORTEST = 1e-4
"""Length below which relight, too, refuses a vector."""


@dataclass(frozen=True, eq=False)
class LpFile:
    """Rows of an ``.lp`` file.

    Attributes
    ----------
    names : tuple of str
        Image names as they stand there, without blanks at either end.
    vectors : float64 array (m, 3)
        Toward the lights, x right, y up, z toward the camera, not normalised [1].
    notes : tuple of str
        What was unusual, as sentences.
    """

    names: tuple[str, ...]
    vectors: FloatArray
    notes: tuple[str, ...] = ()


def read_lp(path: Path) -> LpFile:
    """Read an ``.lp`` file: the number of lights, then a name and a vector x y z on each line.

    The last three words of a line are the vector, everything before them is the name, which may hold blanks. Decimal
    commas, also mixed with points, blanks at either end of a line, blank lines and Windows line ends are taken.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    LpFile
        Names and vectors in the order of the file.

    Raises
    ------
    MissingFileError
        If the file is not there.
    UnreadableFileError
        If a line is not of this form, or the number of lights disagrees with the lines.
    InputError
        If a vector is zero or not finite; the message names its line.
    """
    lines = [(number, line.strip()) for number, line in enumerate(read_lines(path), start=1) if line.strip()]
    if not lines or not re.fullmatch(r"\+?\d+", lines[0][1]):
        raise UnreadableFileError(
            given=f"The first line of {path} reads {lines[0][1][:60]!r}." if lines else f"The file {path} is blank.",
            needed="An .lp file begins with the number of lights on a line of its own.",
            remedy=f"Write {len(lines)} above the first line if each line is one light.",
        )
    count, rows = int(lines[0][1]), lines[1:]
    if count != len(rows):
        raise UnreadableFileError(
            given=f"{path.name} says {count} lights on its first line and has {len(rows)} lines of lights.",
            needed="The two numbers must agree; otherwise part of the file may be missing.",
            remedy="Correct the first line, or copy the file again.",
        )
    if not rows:
        raise UnreadableFileError(
            given=f"{path.name} has no lights.", needed="One line a light.", remedy="Name the right file."
        )
    parsed = [_row(path, number, line) for number, line in rows]
    commas = sum(comma for _, _, comma in parsed)
    vectors = np.array([vector for _, vector, _ in parsed], np.float64)
    notes = []
    if commas:
        notes.append(f"{path.name} has decimal commas on {commas} lines; they were read as decimal points.")
    lengths = np.sqrt((vectors * vectors).sum(axis=1))
    if np.abs(lengths - 1).max() > 0.01:
        notes.append(
            f"The vectors in {path.name} have lengths from {lengths.min():.3g} to {lengths.max():.3g}; only their "
            "directions count."
        )
    return LpFile(tuple(name for name, _, _ in parsed), vectors, tuple(notes))


def _row(path: Path, number: int, line: str) -> tuple[str, list[float], bool]:
    """Return name, vector and whether there were decimal commas."""
    words = line.rsplit(None, 3)
    tokens = [word.rstrip(",;") for word in words[1:]]
    try:
        vector = [float(token.replace(",", ".")) for token in tokens]
    except ValueError:
        vector = []
    if len(vector) != 3:
        raise UnreadableFileError(
            given=f"Line {number} of {path} reads {line[:80]!r}.",
            needed="An image's name and the three numbers x y z, with blanks between, are expected on it.",
            remedy="Correct that line.",
        )
    if not np.isfinite(vector).all() or np.linalg.norm(vector) < _SHORTEST:
        raise InputError(
            given=f"Line {number} of {path} ({base_name(words[0])}) has the light vector {vector}.",
            needed="It must be three finite numbers that are not all zero.",
            remedy="Correct that line, or take it out and lower the number on the first line by one.",
        )
    return words[0].rstrip(), vector, any("," in token for token in tokens)


def write_lp(
    path: Path | str | os.PathLike[str], names: Sequence[str], vectors: npt.ArrayLike, *, digits: int = 10
) -> None:
    """Write an ``.lp`` file that relight and Meshroom read: one blank between words, none at the ends of lines.

    Parameters
    ----------
    path : path
        The file; an existing one is replaced.
    names : sequence of str
        Image names, one a light, in the order of the vectors.
    vectors : array (m, 3)
        Toward the lights, x right, y up, z toward the camera; written as unit vectors [1].
    digits : int
        Digits after the point, 1 to 17; with 17 the vectors come back to the last bit.

    Raises
    ------
    InputError
        If counts disagree, a name would not come back from the file, or a vector is zero or not finite.
    OptionError
        If there are other numbers of digits.
    """
    if not 1 <= digits <= 17:
        raise OptionError(
            given=f"{digits} digits are asked for.", needed="1 to 17.", remedy="Take 10, or 17 for full precision."
        )
    array = np.asarray(vectors, np.float64)
    if array.ndim != 2 or array.shape != (len(names), 3) or len(names) == 0:
        raise InputError(
            given=f"There are {len(names)} names and vectors of the shape {array.shape}.",
            needed="Each name needs one vector of three numbers.",
            remedy="Give as many rows as names.",
        )
    odd = [name for name in names if not name or name != " ".join(name.split())]
    if odd:
        raise InputError(
            given=f"The image name {odd[0]!r} is empty or has blanks at an end, in a row, or other than spaces.",
            needed="relight reads names with single blanks inside only.",
            remedy="Rename the file.",
        )
    lengths = np.sqrt((array * array).sum(axis=1))
    bad = np.flatnonzero(~(np.isfinite(lengths) & (lengths > 0)))
    if len(bad):
        raise InputError(
            given=f"The vector of {names[bad[0]]} is {array[bad[0]].tolist()}.",
            needed="It must be three finite numbers that are not all zero.",
            remedy="Leave that image out.",
        )
    unit = array / lengths[:, None]
    rows = [f"{name} {' '.join(f'{x:.{digits}f}' for x in v)}" for name, v in zip(names, unit, strict=True)]
    Path(path).write_text("\n".join([str(len(names)), *rows, ""]), encoding="utf-8", newline="\n")


class RtiLp(Reader):
    """An ``.lp`` file beside its images, as RTIBuilder, relight and Meshroom use it.

    Images are found by their names, like Meshroom does; relight goes by the order, and a note says where the two would
    differ. All lights count as equally strong.
    """

    name: ClassVar[str] = "lp"
    summary: ClassVar[str] = "an .lp file (RTI: number of lights, then image name and x y z a line) and its images"

    def recognise(self, path: Path) -> str | None:
        """See :meth:`Reader.recognise`."""
        if path.is_file():
            return "it is an .lp list of light directions" if path.suffix.lower() == ".lp" else None
        lists = _lists(path)
        if len(lists) > 1:
            return f"{len(lists)} .lp files are there"
        return f"{lists[0].name} lists images and light directions" if lists else None

    def read(self, path: Path, choices: Choices) -> tuple[Capture, Truth | None]:
        """See :meth:`Reader.read`."""
        source = _the_list(path)
        folder = source.parent
        entries = read_lp(source)
        matches = match_files(folder, entries.names, source.name)
        stack = FileStack(matches.paths)
        rig, notes = distant_rig(stack, choices, lambda: Directions(entries.vectors, entries.notes), source.name)
        camera, camera_notes = find_camera(folder)
        capture = Capture(
            stack=stack,
            rig=rig,
            camera=camera,
            mask=find_mask(folder, (stack.shape[1], stack.shape[2]), choices),
            name=source.stem,
            notes=(*matches.notes, *notes, *_order_note(matches.paths, source.name), *_jpeg_note(stack), *camera_notes),
        )
        return capture, None


def _lists(folder: Path) -> list[Path]:
    if not folder.is_dir():
        return []
    return natural_order(p for p in folder.iterdir() if p.suffix.lower() == ".lp" and p.name[0] != ".")


def _the_list(path: Path) -> Path:
    if not path.is_dir():
        return path
    lists = _lists(path)
    if len(lists) != 1:
        raise InputError(
            given=f"{path} holds {f'{len(lists)} .lp files: ' if lists else 'no .lp file'}"
            f"{', '.join(p.name for p in lists)}.",
            needed="One list of light directions says which images belong to the capture.",
            remedy="Name the .lp file itself instead of the folder.",
        )
    return lists[0]


def _order_note(paths: tuple[Path, ...], source: str) -> tuple[str, ...]:
    if list(paths) == natural_order(paths):
        return ()
    return (
        f"The rows of {source} are not in the order of the images' names. They were matched by name; programs that go "
        "by the order of the files, such as relight, would pair them otherwise.",
    )


def _jpeg_note(stack: FileStack) -> tuple[str, ...]:
    if stack.paths[0].suffix.lower() not in (".jpg", ".jpeg"):
        return ()
    return ("The images are JPEG, whose values are seldom proportional to light; they are taken as if they were.",)
