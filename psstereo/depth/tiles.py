"""Tiles of an image that is larger than memory, and arrays in files of which windows are read and written."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from psstereo.errors import InputError
from psstereo.types import Array

__all__ = ["FileArray", "Tile", "Window", "inside_of", "make_tiles"]

Window = tuple[slice, slice]
"""Rows and columns of an image, both with their ends."""

_CHUNK = 1 << 20
"""Bytes written at a time when a file is made."""


@dataclass(frozen=True, kw_only=True)
class Tile:
    """A rectangle of the image; tiles cover the image once.

    Attributes
    ----------
    core : (slice, slice)
        Rows and columns of the tile.
    shape : (int, int)
        Rows and columns of the image.
    """

    core: Window
    shape: tuple[int, int]

    def grown(self, margin: int, *, before: int | None = None) -> Window:
        """Return the tile with a margin on every side, cut at the border of the image.

        Parameters
        ----------
        margin : int
            Pixels to add [px].
        before : int, optional
            Another margin above and to the left [px].

        Returns
        -------
        (slice, slice)
            Rows and columns of the image.
        """
        back = margin if before is None else before
        rows, columns = self.core
        return (
            slice(max(rows.start - back, 0), min(rows.stop + margin, self.shape[0])),
            slice(max(columns.start - back, 0), min(columns.stop + margin, self.shape[1])),
        )


def inside_of(inner: Window, outer: Window) -> Window:
    """Return where a window lies in another one that holds it.

    Parameters
    ----------
    inner, outer : (slice, slice)
        Rows and columns of the image.

    Returns
    -------
    (slice, slice)
        Rows and columns counted from the corner of `outer`.
    """
    rows, columns = (slice(a.start - b.start, a.stop - b.start) for a, b in zip(inner, outer, strict=True))
    return rows, columns


def make_tiles(shape: tuple[int, int], side: int) -> list[Tile]:
    """Cut an image into squares, row by row; the last of a row and the last row may be smaller.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the image.
    side : int
        Side of a tile [px].

    Returns
    -------
    list of Tile
        Every pixel is in exactly one.
    """
    return [
        Tile(core=(slice(v, min(v + side, shape[0])), slice(u, min(u + side, shape[1]))), shape=shape)
        for v in range(0, shape[0], side)
        for u in range(0, shape[1], side)
    ]


@dataclass(frozen=True, kw_only=True)
class FileArray:
    """A two-dimensional array in a file, row by row; a path and a shape, so that it can go to another process.

    It is read and written rather than mapped: mapped pages would count as the process's memory, and writing to one for
    which the disk has no room ends the process instead of raising an error.

    Attributes
    ----------
    path : Path
        The file.
    shape : (int, int)
        Rows and columns.
    dtype : str
        Type of the numbers, as NumPy writes it.
    offset : int
        Bytes before the first number.
    """

    path: Path
    shape: tuple[int, int]
    dtype: str
    offset: int = 0

    @classmethod
    def make(
        cls, path: Path, shape: tuple[int, int], dtype: str, *, fill: float = 0.0, npy: bool = False
    ) -> "FileArray":
        """Write a new file with the same number everywhere.

        Parameters
        ----------
        path : Path
            The file; what it held is lost.
        shape : (int, int)
            Rows and columns.
        dtype : str
            Type of the numbers.
        fill : float
            The number.
        npy : bool
            Whether to begin with the header of an ``.npy`` file.

        Returns
        -------
        FileArray
            All its room on the disk is taken.

        Raises
        ------
        InputError
            If the file cannot be written or the disk has no room.
        """
        row = np.full(shape[1], fill, dtype)
        rows = max(_CHUNK // max(row.nbytes, 1), 1)
        block = np.repeat(row[None], min(rows, shape[0]), axis=0)
        with _Writing(path, shape[0] * row.nbytes), path.open("wb") as file:
            if npy:
                header = {"descr": np.dtype(dtype).str, "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_1_0(file, header)
            offset = file.tell()
            for first in range(0, shape[0], rows):
                file.write(block[: shape[0] - first].data)
        return cls(path=path, shape=shape, dtype=dtype, offset=offset)

    def read(self, window: Window) -> Array:
        """Return a copy of a window.

        Parameters
        ----------
        window : (slice, slice)
            Rows and columns.

        Returns
        -------
        array (h, w)
            The numbers.
        """
        # Mapped and let go of at once: a copy along the rows without a call to the system for each.
        mapped = np.memmap(self.path, self.dtype, "r", self.offset, self.shape)
        return np.array(mapped[window], subok=False)

    def write(self, window: Window, values: Array) -> None:
        """Write a window.

        Parameters
        ----------
        window : (slice, slice)
            Rows and columns.
        values : array (h, w)
            The numbers; converted to the array's type.

        Raises
        ------
        InputError
            If the file cannot be written.
        """
        values = np.ascontiguousarray(values, self.dtype)
        with _Writing(self.path, values.nbytes), self.path.open("r+b", buffering=0) as file:
            for place, part in self._lines(window, values):
                file.seek(place)
                file.write(part.data)

    def _lines(self, window: Window, values: Array) -> Iterator[tuple[int, Array]]:
        """Return the places in the file of the contiguous pieces of a window, with those of an array."""
        size = np.dtype(self.dtype).itemsize
        rows, columns = window
        first = self.offset + (rows.start * self.shape[1] + columns.start) * size
        if columns.stop - columns.start == self.shape[1]:
            yield first, values
            return
        for k in range(values.shape[0]):
            yield first + k * self.shape[1] * size, values[k]


class _Writing:
    """Turns what the system says about a file into an error that says what to do."""

    def __init__(self, path: Path, size: int) -> None:
        self._path, self._size = path, size

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        if isinstance(error, OSError):
            raise InputError(
                given=f"A file in {self._path.parent} cannot be written ({error.strerror or error}).",
                needed=f"Another {self._size / 1e6:.0f} MB are needed there, and leave to write.",
                remedy="Free some room, or choose another folder.",
            ) from None
