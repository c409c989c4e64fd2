"""Elevation and images of terrain out of files, and terrain as a picture."""

import zipfile
from pathlib import Path

import numpy as np

from psstereo.errors import InputError, PsstereoError, UnreadableFileError
from psstereo.lights.solar import from_azimuth
from psstereo.sfs.terrain.stencils import LEAST, Stencils
from psstereo.stack import FileStack, Response
from psstereo.stack.decode import read_bytes
from psstereo.types import Array, FloatArray

__all__ = ["hillshade", "read_brightness", "read_heights"]

_NODATA_TAG = 42113
"""GDAL's tag for the value that stands for missing heights."""


def read_heights(path: Path, *, name: str | None = None) -> FloatArray:
    """Read an elevation from ``.npy``, ``.npz`` or ``.tif``; the first row of the file is taken for the northernmost.

    Parameters
    ----------
    path : Path
        The file. Where a TIFF names a value for missing heights, NaN takes its place.
    name : str, optional
        Which array of a ``.npz``; otherwise ``elevation``, or the only two-dimensional one.

    Returns
    -------
    float64 array (h, w)
        Heights in the file's unit, NaN where missing.

    Raises
    ------
    MissingFileError, UnreadableFileError
        If the file is not there or damaged.
    InputError
        If it holds no single map of real numbers.
    """
    readers = {".npy": _npy, ".npz": _npz, ".tif": _tiff, ".tiff": _tiff}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            given=f"The elevation {path.name} ends in '{path.suffix}'.",
            needed=f"Known are {', '.join(readers)}.",
            remedy="Export it as 32-bit TIFF.",
        )
    if path.suffix.lower() != ".npz" and name is not None:
        raise InputError(
            given=f"The array {name!r} of {path.name} is asked for.",
            needed="Only .npz files hold several arrays.",
            remedy="Leave the name out.",
        )
    read_bytes(path)
    try:
        values = reader(path, name)
    except PsstereoError:
        raise
    except Exception as error:  # decoders raise whatever they like on damaged files
        reason = " ".join(str(error).split()).rstrip(".") or type(error).__name__
        raise UnreadableFileError(
            given=f"The elevation {path} cannot be decoded ({reason}).",
            needed="A complete file of the kind that its ending says.",
            remedy="Copy or export it again.",
        ) from error
    if values.ndim != 2 or values.dtype.kind not in "fiu":
        raise InputError(
            given=f"The elevation {path.name} holds an array of shape {values.shape} and type {values.dtype}.",
            needed="One real number a cell, (rows, columns).",
            remedy="Save the heights by themselves.",
        )
    return values.astype(np.float64)


def _npy(path: Path, _name: str | None) -> Array:
    return np.asarray(np.load(path, allow_pickle=False))


def _npz(path: Path, name: str | None) -> Array:
    if not zipfile.is_zipfile(path):
        raise ValueError("it is no .npz archive, or is cut short")
    with np.load(path, allow_pickle=False) as archive:
        maps = [key for key in archive.files if archive[key].ndim == 2]
        wanted = name or ("elevation" if "elevation" in maps else (maps[0] if len(maps) == 1 else None))
        if wanted in archive.files:
            return np.asarray(archive[wanted])
    raise InputError(
        given=f"{path.name} holds the maps {', '.join(maps) or '(none)'}.",
        needed=f"The array {name!r}." if name else "One called elevation, or a single map.",
        remedy="Name the array of heights.",
    )


def _tiff(path: Path, _name: str | None) -> Array:
    import tifffile

    with tifffile.TiffFile(path) as tiff:
        page = tiff.pages.first
        values = np.asarray(page.asarray())
        tag = page.tags.get(_NODATA_TAG)
    if tag is None or values.dtype.kind not in "fiu":
        return values
    missing = float(str(tag.value).strip("\x00 "))
    # The tag is decimal text; heights of 32 bits equal it only after the same rounding.
    return np.where(values == np.asarray(missing, values.dtype), np.nan, values) if np.isfinite(missing) else values


def read_brightness(path: Path, response: Response) -> FloatArray:
    """Read an image as one linear brightness a pixel, the mean of its channels; NaN where it is saturated.

    Parameters
    ----------
    path : Path
        An image file, or ``.npy``.
    response : Response
        Tone curve to undo.

    Returns
    -------
    float64 array (h, w)
        Brightness as a share of full scale of whole numbers, and as it is of floating-point ones [relative].

    Raises
    ------
    MissingFileError, UnreadableFileError, InputError
        If the file is not there, damaged, or no image.
    """
    stack = FileStack((path,))
    values = stack.frame(0)
    light = values if response.is_linear else response.linearise(values, stack.white)
    linear = np.asarray(light, np.float64) / stack.white
    full = (values >= stack.white).any(axis=2) if stack.saturates else np.zeros(values.shape[:2], np.bool_)
    return np.where(full, np.nan, linear.mean(axis=2))


def hillshade(heights: FloatArray, cell: tuple[float, float]) -> Array:
    """Return terrain as it looks under a sun in the north-west, 45° high; black where there is no height.

    Parameters
    ----------
    heights : float array (h, w)
        Heights, at least 8 × 8, NaN where unknown [length].
    cell : (float, float)
        Distances of columns and rows [length].

    Returns
    -------
    uint8 array (h, w)
        White where the ground faces the sun.

    Raises
    ------
    InputError
        If the map is too small.
    """
    if min(heights.shape) < LEAST:
        raise InputError(
            given=f"The heights are a map of {heights.shape[1]} × {heights.shape[0]}.",
            needed=f"{LEAST} × {LEAST} at least.",
            remedy="Give a larger map.",
        )
    x, y = Stencils((heights.shape[0], heights.shape[1]), cell).slopes(np.asarray(heights, np.float64))
    sun = from_azimuth(np.radians(315.0), np.radians(45.0))
    bright = (sun[2] - sun[0] * x - sun[1] * y) / np.sqrt(1.0 + x * x + y * y)
    return np.asarray(np.rint(255 * np.clip(np.nan_to_num(bright, nan=0.0), 0.0, 1.0)), np.uint8)
