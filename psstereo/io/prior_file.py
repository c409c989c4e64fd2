"""Depth that is known beforehand: a map of it, or a list of a few measured points."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from psstereo.camera import Camera
from psstereo.errors import InputError, OptionError
from psstereo.io.text import parse_numbers, read_lines, read_table, require_file
from psstereo.io.value_map import read_value_map
from psstereo.results import DepthKind
from psstereo.types import BoolArray, FloatArray

__all__ = ["KnownDepth", "read_known_depth"]

_METRES = {"um": 1e-6, "µm": 1e-6, "μm": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "km": 1e3}
"""Lengths that can be turned into each other [m]; the sign for a millionth stands in Unicode twice."""

_LISTS = frozenset({".txt", ".csv", ".dat", ".xyz", ".tsv"})
"""Endings of lists of points."""

_DISTANCE_UNIT = "mm"


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownDepth:
    """Depth that a file knows.

    Attributes
    ----------
    depth : float64 array (h, w)
        Height or distance, as the camera has it; NaN where unknown [`unit`].
    sigma : float
        Its standard error [`unit`].
    unit : str
        That of the camera for heights; the file's own for distances.
    notes : tuple of str
        What was read and decided, as sentences for the record.
    """

    depth: FloatArray
    sigma: float
    unit: str
    notes: tuple[str, ...]


def read_known_depth(
    path: Path, shape: tuple[int, int], camera: Camera, *, sigma: float | None = None, unit: str | None = None
) -> KnownDepth:
    """Read known depth for the pixels of a normal map.

    A *map* is an array (``.npy``, ``.npz``, ``.mat``) or image (32-bit TIFF, EXR, 16-bit PNG) of the size of the
    normals; NaN, 0 and a GeoTIFF's value for nothing mean unknown. A *list* is a text file with a row
    ``row column depth`` for each point; rows and columns count from 0 and are rounded to the nearest pixel, points in
    one pixel are averaged, and every number counts, 0 too.

    Parameters
    ----------
    path : Path
        The file.
    shape : (int, int)
        Rows and columns of the normals.
    camera : Camera
        The camera of the normals: it decides whether heights (growing toward it) or distances along its optical axis
        are expected.
    sigma : float, optional
        Standard error of the depth; the size of a pixel on the surface if absent [unit, without the number before it].
    unit : str, optional
        Unit of the numbers, such as ``"mm"``, or what a step of 1 is worth, such as ``"0.2mm"``. If absent, that of
        the camera's heights; millimetres for distances. Whole numbers have to be given one. Heights in another
        metric unit are turned into the camera's.

    Returns
    -------
    KnownDepth
        Depth, error and unit.

    Raises
    ------
    MissingFileError, UnreadableFileError
        If the file is not there or damaged.
    OptionError
        If the unit or the standard error makes no sense.
    InputError
        If the file has another size, points lie outside, nothing is known, a distance is not positive, or heights are
        in a unit that cannot be turned into the camera's.
    """
    require_file(path)
    step, name, factor = _scale(unit, camera)
    if path.suffix.lower() in _LISTS:
        values, notes = _points(path, shape)
    else:
        values, notes = _map(path, shape, stated=unit is not None)
    final = camera.unit if camera.depth_kind is DepthKind.HEIGHT else name
    depth = values * (step * factor)
    if factor != 1.0:
        notes += (f"The prior was turned from {name} into {final}.",)
    _require_depths(depth, path, camera)
    error = _pixel(depth, camera) if sigma is None else sigma * factor
    if not (np.isfinite(error) and error > 0):
        raise OptionError(
            given=f"The standard error of the prior is {error:g} {final}.",
            needed="A length above zero.",
            remedy="Give how far the known depths may be off, with --prior-sigma.",
        )
    origin = "taken as the size of a pixel" if sigma is None else "as given"
    notes += (f"The prior's standard error is {error:.4g} {final}, {origin}.",)
    return KnownDepth(depth=depth, sigma=float(error), unit=final, notes=notes)


def _scale(words: str | None, camera: Camera) -> tuple[float, str, float]:
    """Return what a step of 1 is worth in the unit named, that unit, and the camera's unit over it."""
    heights = camera.depth_kind is DepthKind.HEIGHT
    if words is None:
        return 1.0, camera.unit if heights else _DISTANCE_UNIT, 1.0
    match = re.fullmatch(r"\s*([\d.,]+(?:[eE][+-]?\d+)?)?\s*([^\W\d_]+)\s*", words)
    numbers = None if match is None else parse_numbers((match[1] or "1").replace(",", "."))
    if match is None or numbers is None or len(numbers[0]) != 1 or not 0 < numbers[0][0] < np.inf:
        raise OptionError(
            given=f"The unit of the prior is {words!r}.",
            needed="A length such as mm, m or px, or what a step of 1 is worth, such as 0.2mm.",
            remedy="Write a unit, with a number above zero before it if it is not 1.",
        )
    step, name = numbers[0][0], match[2]
    if not heights or name == camera.unit:
        return step, name, 1.0
    if name in _METRES and camera.unit in _METRES:
        return step, name, _METRES[name] / _METRES[camera.unit]
    raise InputError(
        given=f"The prior is in {name}, the heights are in {camera.unit}.",
        needed="Heights and prior must be in one unit.",
        remedy="Give the size of a pixel on the surface, or the prior in the unit of the heights.",
    )


def _map(path: Path, shape: tuple[int, int], *, stated: bool) -> tuple[FloatArray, tuple[str, ...]]:
    found = read_value_map(path, shape, what="prior", names=("depth", "depth_gt", "height", "prior"))
    if found.values.dtype.kind != "f" and not stated:
        raise InputError(
            given=f"The prior {path.name} holds whole numbers ({found.values.dtype}), and no unit was given.",
            needed="What a step of 1 is worth.",
            remedy="Say it with --prior-unit, such as 1mm or 0.2mm.",
        )
    zero: BoolArray = np.asarray(found.values == 0)
    values = np.where(found.no_data | zero, np.nan, found.values.astype(np.float64))
    known = int(np.count_nonzero(~np.isnan(values)))
    notes = [f"{found.source}: {known} of {values.size} pixels have a known depth."]
    if zero.any():
        notes.append(f"{np.count_nonzero(zero)} zeros in {path.name} were taken for unknown.")
    return values, tuple(notes)


def _points(path: Path, shape: tuple[int, int]) -> tuple[FloatArray, tuple[str, ...]]:
    """Read a list of points, perhaps with a line of headings."""
    lines = read_lines(path)
    table = read_table(path, skip=int(bool(lines) and _is_heading(lines[0])))
    rows = table.values
    if rows.shape[1] != 3:
        raise InputError(
            given=f"The prior {path.name} has {rows.shape[1]} numbers a row.",
            needed="A list of points has three: row, column, depth.",
            remedy="Write one point a row; a whole map belongs into .npy, TIFF or EXR.",
        )
    outside = ~(np.isfinite(rows[:, :2]) & (rows[:, :2] >= -0.5) & (rows[:, :2] < np.array(shape) - 0.5)).all(axis=1)
    if outside.any():
        row, column, _ = rows[outside][0]
        raise InputError(
            given=f"{np.count_nonzero(outside)} points of {path.name} lie outside, first row {row:g}, col. {column:g}.",
            needed=f"Rows from 0 to {shape[0] - 1} and columns from 0 to {shape[1] - 1}.",
            remedy="Check the order, row before column, and that both count from 0.",
        )
    places = np.floor(rows[:, :2] + 0.5).astype(np.int64) @ np.array([shape[1], 1])
    count = np.bincount(places, minlength=shape[0] * shape[1])
    total = np.bincount(places, rows[:, 2], minlength=count.size)
    values = np.where(count > 0, total / np.maximum(count, 1), np.nan).reshape(shape)
    notes = [*table.notes, f"{path.name}: {len(rows)} points in {np.count_nonzero(count)} pixels."]
    if (rows[:, :2] != np.floor(rows[:, :2])).any():
        notes.append("Points between pixels were moved to the nearest pixel.")
    return values, tuple(notes)


def _is_heading(line: str) -> bool:
    return parse_numbers(line) is None and not line.lstrip().startswith(("#", "%"))


def _require_depths(depth: FloatArray, path: Path, camera: Camera) -> None:
    known = ~np.isnan(depth)
    central = camera.depth_kind is DepthKind.DISTANCE
    wrong = known & (~np.isfinite(depth) | ((depth <= 0) & central))
    if wrong.any() or not known.any():
        how = "negative, zero or infinite" if central else "infinite"
        raise InputError(
            given=f"The prior {path.name} knows {known.sum()} pixels; {wrong.sum()} of them are {how}.",
            needed=f"At least one known pixel, and {'positive distances' if central else 'finite heights'} only.",
            remedy="Use NaN where the depth is unknown"
            + (", and distances along the optical axis." if central else "."),
        )


def _pixel(depth: FloatArray, camera: Camera) -> float:
    """Return the size of a pixel on the surface [unit of the depth]."""
    near = camera.points(np.full((1, 2), float(np.nanmedian(depth))))
    return float(np.linalg.norm(near[0, 1] - near[0, 0]))
