"""Elevation as 32-bit TIFF: a depth map that says its unit and the size of its pixels."""

import json
import math
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError, MissingFileError, OptionError, UnreadableFileError
from psstereo.results import DepthKind
from psstereo.types import Array, FloatArray

__all__ = ["ELEVATION_SUFFIXES", "Elevation", "read_elevation", "write_elevation"]

ELEVATION_SUFFIXES = (".tif", ".tiff")
"""Suffixes that :func:`write_elevation` and :func:`read_elevation` know."""
_FORMAT, _VERSION = "psstereo elevation", 1
_LARGEST = float(np.finfo(np.float32).max)
_PACKED = 1100
"""More bytes than this for each byte of the file, and no coding that TIFF has could have made them."""
_SCALE_TAG, _TIE_TAG, _MISSING_TAG = 33550, 33922, 42113
"""GeoTIFF's ModelPixelScale and ModelTiepoint, and GDAL's NODATA."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Elevation:
    """What an elevation file holds.

    Attributes
    ----------
    depth : float32 array (h, w)
        Depth, NaN where unknown [`unit`].
    kind : DepthKind
        Height, growing toward the camera, or distance along the optical axis.
    unit : str
        ``"mm"`` or another length, ``"px"`` or ``"relative"``.
    pixel_size : float or None
        Side of a pixel on the surface; None where it differs from pixel to pixel (distances) or is not known [`unit`].
    """

    depth: npt.NDArray[np.float32]
    kind: DepthKind
    unit: str
    pixel_size: float | None


def write_elevation(
    path: Path,
    depth: FloatArray,
    *,
    unit: str,
    pixel_size: float | None = None,
    kind: DepthKind = DepthKind.HEIGHT,
) -> None:
    """Write a depth map as TIFF of one channel of 32-bit floating-point numbers, not compressed.

    Programs for images open it as a grey picture. The tag ImageDescription says kind, unit and size of the pixels, as
    JSON; where the pixels have a size, GeoTIFF's tags for it are there too, so that geographic programs measure in the
    same unit to the right and up, from the centre of the first pixel. An existing file is replaced, but only once the
    new one is complete.

    Do not use it to hand on float64: heights are rounded to seven digits, which is a hundredth of a micrometre at
    100 mm.

    Parameters
    ----------
    path : Path
        File to write, ``.tif`` or ``.tiff``, in a folder that exists.
    depth : float array (h, w)
        Heights or distances; NaN where unknown, which is kept [`unit`].
    unit : str
        Their unit.
    pixel_size : float, optional
        Side of a pixel on the surface, for heights only [`unit`].
    kind : DepthKind
        Meaning of the numbers.

    Raises
    ------
    OptionError
        If the suffix is another one.
    MissingFileError
        If the folder does not exist.
    InputError
        If the depth is no floating-point map, is infinite or too large for 32 bits, there is no unit, or the size of a
        pixel is not positive or given beside distances.
    """
    path = Path(path)
    _check_path(path)
    depth = _checked(depth)
    sized = pixel_size is None or (kind is DepthKind.HEIGHT and math.isfinite(pixel_size) and pixel_size > 0)
    if not unit.strip() or not sized:
        raise InputError(
            given=f"The unit is {unit!r}, the size of a pixel {pixel_size}, the kind {kind.value}.",
            needed="A unit, and a positive size for heights or none; the pixels of distances have no one size.",
            remedy="Take both from the camera; for a pinhole leave the size out.",
        )
    size = None if pixel_size is None else float(pixel_size)
    record = {
        "format": _FORMAT,
        "version": _VERSION,
        "kind": kind.value,
        "unit": unit,
        "pixel_size": size,
        "axes": "columns to the right, rows down, heights toward the camera; NaN where unknown",
    }
    content = _encoded(depth, json.dumps(record, ensure_ascii=True), size)
    unfinished = path.with_name(path.name + ".part")
    try:
        unfinished.write_bytes(content)
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def read_elevation(path: Path) -> Elevation:
    """Read what :func:`write_elevation` wrote, every bit of it.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Elevation
        Depth as float32, and what belongs to it.

    Raises
    ------
    MissingFileError
        If it is not there.
    OptionError
        If its suffix is another one.
    UnreadableFileError
        If it is damaged, no elevation, or does not say its unit.
    """
    path = Path(path)
    if not path.is_file():
        raise MissingFileError(
            given=f"The elevation {path} is {'a folder' if path.is_dir() else 'not there'}.",
            needed="A file of heights.",
            remedy="Check its name and folder.",
        )
    _check_path(path)
    try:
        depth, text = _decoded(path)
    except UnreadableFileError:
        raise
    except Exception as error:  # the decoder raises whatever it likes on damaged files
        raise _unreadable(path, f"cannot be decoded ({str(error).strip() or type(error).__name__})") from error
    return _described(path, depth, text)


def _check_path(path: Path) -> None:
    if path.suffix.lower() not in ELEVATION_SUFFIXES:
        raise OptionError(
            given=f"'{path.name}' ends in '{path.suffix}'.",
            needed=f"Elevations are {' or '.join(ELEVATION_SUFFIXES)} files.",
            remedy="Choose that suffix; .npy keeps bare numbers.",
        )
    if not path.parent.is_dir():
        raise MissingFileError(
            given=f"The folder {path.parent} does not exist.",
            needed="An elevation is written into an existing folder.",
            remedy="Create the folder first, or check the path.",
        )


def _checked(depth: Array) -> npt.NDArray[np.float32]:
    depth = np.asarray(depth)
    if depth.ndim != 2 or depth.size == 0 or depth.dtype.kind != "f":
        raise InputError(
            given=f"The depth is an array of shape {depth.shape} and type {depth.dtype}.",
            needed="It must be floating-point numbers of shape (rows, columns).",
            remedy="Give the depth map itself.",
        )
    if bool(np.any(np.abs(depth) > _LARGEST)):
        raise InputError(
            given="The depth holds numbers that are infinite or beyond 3.4e38.",
            needed="32 bits must hold it; unknown depth is NaN.",
            remedy="Set what is unknown to NaN, or choose another unit.",
        )
    return np.ascontiguousarray(depth, np.float32)


def _encoded(depth: npt.NDArray[np.float32], description: str, pixel_size: float | None) -> bytes:
    import tifffile

    tags: list[tuple[Any, ...]] = [(_MISSING_TAG, "s", 0, "nan", True)]
    if pixel_size is not None:
        corner = (0.0, 0.0, 0.0, -0.5 * pixel_size, 0.5 * pixel_size, 0.0)
        tags += [(_SCALE_TAG, "d", 3, (pixel_size, pixel_size, 0.0), True), (_TIE_TAG, "d", 6, corner, True)]
    stream = BytesIO()
    tifffile.imwrite(
        stream,
        depth,
        photometric="minisblack",
        description=description,
        metadata=None,
        software=False,
        extratags=tags,
        byteorder="<",
    )
    return stream.getvalue()


def _decoded(path: Path) -> tuple[Array, str]:
    """Return the array and the description of a file, after a look at whether it can hold as much as it says."""
    import tifffile

    with tifffile.TiffFile(path) as file:
        if len(file.pages) != 1:
            raise _unreadable(path, f"holds {len(file.pages)} pictures")
        page = file.pages.first
        if page.dtype != np.float32 or len(page.shape) != 2:
            raise _unreadable(path, f"holds an array of shape {page.shape} and type {page.dtype}")
        size = path.stat().st_size
        ends = [start + count for start, count in zip(page.dataoffsets, page.databytecounts, strict=True)]
        if max(ends, default=0) > size or math.prod(page.shape) * 4 > _PACKED * size:
            raise _unreadable(path, f"announces {page.shape[0]} × {page.shape[1]} numbers and is cut short")
        tag = page.tags.get("ImageDescription")
        return np.asarray(page.asarray()), "" if tag is None else str(tag.value)


def _described(path: Path, depth: Array, text: str) -> Elevation:
    try:
        record = json.loads(text)
    except ValueError:
        record = None
    if not isinstance(record, dict) or record.get("format") != _FORMAT:
        raise _unreadable(path, "does not say its unit and the size of its pixels")
    if record.get("version") != _VERSION:
        raise _unreadable(path, f"is of version {record.get('version')!r}; known is {_VERSION}")
    kind, unit, pixel_size = record.get("kind"), record.get("unit"), record.get("pixel_size")
    sized = pixel_size is None or (
        isinstance(pixel_size, int | float) and not isinstance(pixel_size, bool) and 0 < pixel_size < math.inf
    )
    if kind not in {one.value for one in DepthKind} or not isinstance(unit, str) or not sized:
        raise _unreadable(path, f"has the kind {kind!r}, the unit {unit!r} and pixels of {pixel_size!r}")
    return Elevation(
        depth=np.ascontiguousarray(depth, np.float32),
        kind=DepthKind(kind),
        unit=unit,
        pixel_size=None if pixel_size is None else float(pixel_size),
    )


def _unreadable(path: Path, what: str) -> UnreadableFileError:
    return UnreadableFileError(
        given=f"The elevation {path.name} {what}.",
        needed="A whole TIFF file as psstereo writes them: one channel of 32-bit floating-point numbers.",
        remedy="Write or copy it again.",
    )
