"""Measured reflectance in the MERL database's tables, and their files.

A table has 90 × 90 × 180 cells over Rusinkiewicz's angles [2]_: of the half vector h to the normal (cells that widen as
the square root, since highlights are narrow), of the light to h, and the azimuth of the light around h, counted from
the plane of h and normal, 0 … π. Light and eye change places by a turn of π around h, which gives the same cell, so
the tables are reciprocal.

A ``.binary`` file holds the three sizes as 32-bit integers, then all red, all green and all blue cells as 64-bit
floats, little-endian; they become ρ [sr⁻¹] by factors of 1/1500, 1.15/1500 and 1.66/1500. Negative cells are not known.

References
----------
.. [1] W. Matusik, H. Pfister, M. Brand, L. McMillan, "A data-driven reflectance model", ACM Trans. Graph. 22, 2003.
   doi:10.1145/882262.882343
.. [2] S. M. Rusinkiewicz, "A new change of variables for efficient BRDF representation", Eurographics Workshop on
   Rendering, 1998. doi:10.1007/978-3-7091-6453-2_2
"""

import os
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from psstereo.brdf.brdf import Brdf
from psstereo.brdf.directions import Directions, dot
from psstereo.errors import InputError, MissingFileError, OptionError, UnreadableFileError
from psstereo.types import FloatArray

__all__ = ["Merl", "read_merl", "tabulate", "write_merl"]

_SIZES = (90, 90, 180)
_FACTORS = np.array([1.0, 1.15, 1.66]) / 1500.0
"""ρ of a cell's value in red, green and blue [sr⁻¹]."""
_BYTES = 3 * 4 + 3 * 8 * int(np.prod(_SIZES))


@dataclass(frozen=True, kw_only=True, eq=False)
class Merl(Brdf):
    """Measured reflectance, looked up in a table over half and difference angles [1]_.

    Where the table has no value ρ is NaN rather than black. A table knows no diffuse part, so its diffuse albedo is
    NaN too. Measurements are least sure near grazing incidence, and may reflect more there than they receive.

    Attributes
    ----------
    table : float array (90, 90, 180, c)
        ρ by angle of half vector, angle to it, azimuth around it; NaN or negative where it is not known [sr⁻¹].
    lookup : str
        ``nearest``: the value of the cell; ``linear``: between the centres of cells that are known, beyond the last
        centres constant.

    References
    ----------
    .. [1] W. Matusik, H. Pfister, M. Brand, L. McMillan, "A data-driven reflectance model", ACM Trans. Graph. 22, 2003.
       doi:10.1145/882262.882343
    """

    name: ClassVar[str] = "merl"
    conserving: ClassVar[bool] = False
    table: FloatArray
    lookup: str = "nearest"

    def __post_init__(self) -> None:
        table = np.asarray(self.table, np.float64)
        if table.ndim != 4 or table.shape[:3] != _SIZES or table.shape[3] == 0 or np.isinf(table).any():
            raise InputError(
                given=f"The table has the shape {table.shape}{', with infinity' if np.isinf(table).any() else ''}.",
                needed="Finite values (90, 90, 180, c): half angle, difference angle, azimuth, channels.",
                remedy="Read it with read_merl; give NaN where ρ is not known.",
            )
        if not (table >= 0.0).any():
            raise InputError(
                given="The table holds no value of zero or more.",
                needed="ρ, known for some angles.",
                remedy="Check where the table comes from.",
            )
        if self.lookup not in ("nearest", "linear"):
            raise OptionError(
                given=f"The look-up {self.lookup!r} is unknown.",
                needed="Known are nearest, linear.",
                remedy="Choose one of them.",
            )
        table = np.where(table >= 0.0, table, np.nan)
        table.flags.writeable = False
        object.__setattr__(self, "table", table)

    @property
    def channels(self) -> int:
        """See :attr:`Brdf.channels`."""
        return int(self.table.shape[-1])

    @property
    def diffuse_albedo(self) -> FloatArray:
        """NaN (c,): a table does not tell it; see :attr:`Brdf.diffuse_albedo`."""
        return np.full(self.channels, np.nan)

    def at(self, index: Any) -> Self:
        """Return the model itself, which is the same everywhere; see :meth:`Brdf.at`."""
        del index
        return self

    def evaluate(self, normals: FloatArray, to_light: FloatArray, to_eye: FloatArray) -> FloatArray:
        """Return the table's value; see :meth:`Brdf.evaluate`."""
        at = Directions.of(normals, to_light, to_eye)
        cells = [np.where(at.above[..., 0] > 0.0, x, 0.0) for x in _cells(at)]
        return at.where_above(self._nearest(cells) if self.lookup == "nearest" else self._between(cells))

    def _nearest(self, cells: list[FloatArray]) -> FloatArray:
        """Return the values of the cells that positions [cells] fall in."""
        first, second, third = (np.minimum(x.astype(np.intp), n - 1) for x, n in zip(cells, _SIZES, strict=True))
        return np.asarray(self.table[first, second, third])

    def _between(self, cells: list[FloatArray]) -> FloatArray:
        """Return values between the eight nearest centres; those that are not known have no weight."""
        low = [np.floor(x - 0.5) for x in cells]
        total = np.zeros((*cells[0].shape, self.channels))
        weights = np.zeros_like(total)
        for corner in product((0, 1), repeat=3):
            index = [(b + c).astype(np.intp) for b, c in zip(low, corner, strict=True)]
            first, second = (np.clip(i, 0, n - 1) for i, n in zip(index[:2], _SIZES[:2], strict=True))
            value = self.table[first, second, index[2] % _SIZES[2]]
            parts = [1.0 - np.abs(x - 0.5 - b - c) for x, b, c in zip(cells, low, corner, strict=True)]
            weight = np.where(np.isnan(value), 0.0, np.prod(parts, axis=0)[..., None])
            total += weight * np.where(weight > 0.0, value, 0.0)
            weights += weight
        return np.divide(total, weights, out=np.full_like(total, np.nan), where=weights > 0.0)


def _cells(at: Directions) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return positions in the table, cells from its start, (...) each [1].

    The light's part across h is d = (l − v) / 2. In the plane of h and normal the direction that leans away from the
    normal is x = (n·H t/|t| − |t| n) / |H|, and y = n × t/|t| is across; the azimuth is that of (d·x, d·y).
    """
    height, extent = at.half()
    reach = np.sqrt(extent)
    sine, cosine = at.half_chords()
    apart = 0.5 * (at.to_light - at.to_eye)
    flat = (at.to_light + at.to_eye) - height * at.normals
    x = (height * dot(apart, flat) - extent * dot(apart, at.normals)) / np.sqrt(height**2 + extent)
    y = dot(apart, np.cross(at.normals, flat))
    # Half a turn is light and eye changing places; a half vector on the normal has no azimuth and takes 0.
    turned = (y < 0.0) | ((y == 0.0) & (x < 0.0))
    azimuth = np.arctan2(np.where(turned, -y, y), np.where(turned, -x, x))
    half = np.sqrt(np.arctan2(reach, height) * 2.0 / np.pi) * _SIZES[0]
    difference = np.arctan2(sine, cosine) * 2.0 / np.pi * _SIZES[1]
    return half[..., 0], difference[..., 0], (azimuth / np.pi * _SIZES[2])[..., 0]


def read_merl(path: str | os.PathLike[str], *, lookup: str = "nearest") -> Merl:
    """Read a file of the MERL database.

    Parameters
    ----------
    path : str or path
        A ``.binary`` file, 35 MB.
    lookup : str
        ``nearest`` or ``linear``; see `Merl`.

    Returns
    -------
    Merl
        Its reflectance, in red, green and blue.

    Raises
    ------
    MissingFileError
        If there is no such file.
    UnreadableFileError
        If its sizes are others than 90 × 90 × 180, or it is shorter or longer than they say.
    """
    file = Path(path)
    if not file.is_file():
        raise MissingFileError(
            given=f"{file} is not there.", needed="A MERL .binary file.", remedy="Check the name of the file."
        )
    length = file.stat().st_size
    sizes = tuple(np.fromfile(file, "<i4", 3).tolist())
    if sizes != _SIZES or length != _BYTES:
        raise UnreadableFileError(
            given=f"{file} has {length} bytes and starts with the sizes {sizes}.",
            needed=f"A MERL .binary file has {_BYTES} bytes and starts with {_SIZES}.",
            remedy="Copy the file again, in binary mode, and unpack it if it is packed.",
        )
    values = np.fromfile(file, "<f8", offset=12).reshape(3, *_SIZES)
    try:
        return Merl(table=np.moveaxis(values, 0, -1) * _FACTORS, lookup=lookup)
    except InputError as error:
        raise UnreadableFileError(
            given=f"{file}: {error.given}", needed=error.needed, remedy="Copy the file again, in binary mode."
        ) from error


def tabulate(brdf: Brdf) -> Merl:
    """Return a table of a reflectance, taken at the centres of its cells.

    Sharp highlights lose their tip: the first cell reaches to 0.011°, the tenth to 1.1° from the normal. Cells whose
    centre is under the surface are not known, although a corner of them may be above: near grazing incidence ρ is NaN
    there.

    Parameters
    ----------
    brdf : Brdf
        An isotropic, reciprocal reflectance without maps.

    Returns
    -------
    Merl
        The table, NaN where light or eye is under the surface.

    Raises
    ------
    InputError
        If the reflectance is not reciprocal, which the table cannot hold, or a map.
    """
    normal = np.array([0.0, 0.0, 1.0])
    if not brdf.reciprocal or brdf.evaluate(normal, normal, normal).ndim > 1:
        raise InputError(
            given=f"The reflectance {brdf.name} is {'a map' if brdf.reciprocal else 'not reciprocal'}.",
            needed="A table holds one reflectance, the same if light and eye change places.",
            remedy="Take a point of a map: brdf.at(index).",
        )
    table = np.full((*_SIZES, brdf.channels), np.nan)
    difference, azimuth = (
        (np.arange(n) + 0.5) / n * full for n, full in zip(_SIZES[1:], (np.pi / 2, np.pi), strict=True)
    )
    turn = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)
    for i in range(_SIZES[0]):
        tilt = ((i + 0.5) / _SIZES[0]) ** 2 * np.pi / 2
        # Rows: the direction that leans away from the normal, the one across, the half vector.
        frame = np.array([[np.cos(tilt), 0.0, -np.sin(tilt)], [0.0, 1.0, 0.0], [np.sin(tilt), 0.0, np.cos(tilt)]])
        along = np.cos(difference)[:, None, None] * frame[2]
        across = np.sin(difference)[:, None, None] * (turn @ frame[:2])
        light, eye = along + across, along - across
        above = (light[..., 2:] > 0.0) & (eye[..., 2:] > 0.0)
        table[i] = np.where(above, brdf.evaluate(normal, light, eye), np.nan)
    return Merl(table=table)


def write_merl(path: str | os.PathLike[str], merl: Merl) -> None:
    """Write a table as a file of the MERL database's format, for other programs.

    Parameters
    ----------
    path : str or path
        A ``.binary`` file, replaced if it is there.
    merl : Merl
        A table of three channels, red, green and blue, or of one, written three times.

    Raises
    ------
    InputError
        If it has another number of channels.
    """
    if merl.channels not in (1, 3):
        raise InputError(
            given=f"The table has {merl.channels} channels.",
            needed="The format holds red, green and blue.",
            remedy="Give one or three channels.",
        )
    values = np.where(np.isnan(merl.table), -1.0, merl.table / _FACTORS)
    with Path(path).open("wb") as file:
        file.write(np.array(_SIZES, "<i4").tobytes())
        for channel in range(3):
            file.write(np.ascontiguousarray(values[..., channel], "<f8").tobytes())
