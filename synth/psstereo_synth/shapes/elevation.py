"""Elevation models from files: ``.npz``, ``.npy``, TIFF and GeoTIFF, ESRI ASCII grid."""

import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from psstereo.errors import InputError, MissingFileError, UnreadableFileError
from psstereo.types import Array, FloatArray
from psstereo_synth.shapes.grid import HeightGrid

__all__ = ["metres_per_degree", "read_elevation"]

_SEMI_MAJOR, _FLATTENING = 6378137.0, 1 / 298.257223563
"""The ellipsoid WGS 84 [m], [1]."""
_SRTM_VOID = -32768
"""What stands for a missing height in 16-bit files that do not say [m]."""


def read_elevation(path: Path, *, spacing: tuple[float, float] | None = None) -> HeightGrid:
    """Read an elevation model; the first row is the northern edge.

    ========== ====================================================================================================
    ``.npz``   `elevation` (h, w), `dx`, `dy`; in degrees if `ymin` and `ymax` (latitudes) are there, else a length
    ``.npy``   (h, w); says nothing of the spacing, which is then 1
    ``.tif``   one channel of 16 or 32 bits; spacing from GeoTIFF's ModelPixelScale, in metres or degrees as its keys
               say, else 1; missing heights from the tag GDAL_NODATA
    ``.asc``   ESRI ASCII grid; its `cellsize` is a length; where it may be degrees, `spacing` has to be given
    ========== ====================================================================================================

    Degrees become metres on the ellipsoid WGS 84 at the middle latitude: cells are then not square. Right for models of
    up to about a hundred kilometres; project larger ones before. −32768 in 16-bit files is a missing height.

    Parameters
    ----------
    path : Path
        The file.
    spacing : (float, float), optional
        Distances of columns and of rows, in place of what the file says [length].

    Returns
    -------
    HeightGrid
        Heights as they are in the file, NaN where missing.

    Raises
    ------
    MissingFileError
        If it is not there.
    UnreadableFileError
        If it is damaged, of another kind, or does not say what it must.
    InputError
        If there are too few heights for a surface.
    """
    path = Path(path)
    if not path.is_file():
        raise MissingFileError(
            given=f"The elevation model {path} does not exist.",
            needed="A file of heights.",
            remedy="Check its name and folder.",
        )
    readers = {".npz": _read_npz, ".npy": _read_npy, ".tif": _read_tiff, ".tiff": _read_tiff, ".asc": _read_asc}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise _unreadable(path, f"ends in {path.suffix or 'nothing'}", f"Known are {', '.join(readers)}.")
    heights, found, degrees_at = reader(path)
    if spacing is None:
        spacing = found if degrees_at is None else _from_degrees(path, found, degrees_at)
    try:
        return HeightGrid(heights=heights, spacing=spacing)
    except InputError as error:
        raise InputError(given=f"{path.name}: {error.given}", needed=error.needed, remedy=error.remedy) from None


def metres_per_degree(latitude: float) -> tuple[float, float]:
    """Return how long a degree of longitude and one of latitude are on the ellipsoid WGS 84.

    Parameters
    ----------
    latitude : float
        Geodetic latitude [deg].

    Returns
    -------
    east, north : float
        Lengths [m].

    Examples
    --------
    >>> print("{:.0f} {:.0f}".format(*metres_per_degree(45.0)))
    78847 111132
    """
    squeeze = _FLATTENING * (2 - _FLATTENING)
    sine, cosine = math.sin(math.radians(latitude)), math.cos(math.radians(latitude))
    w = math.sqrt(1 - squeeze * sine * sine)
    return math.radians(_SEMI_MAJOR * cosine / w), math.radians(_SEMI_MAJOR * (1 - squeeze) / w**3)


_Found = tuple[FloatArray, tuple[float, float], float | None]
"""Heights, spacing, and the middle latitude if the spacing is in degrees, NaN if nobody can tell."""


def _unreadable(path: Path, what: str, needed: str) -> UnreadableFileError:
    return UnreadableFileError(
        given=f"The elevation model {path.name} {what}.",
        needed=needed,
        remedy="Convert it, for example with gdal_translate, or build a HeightGrid from an array.",
    )


def _from_degrees(path: Path, spacing: tuple[float, float], latitude: float) -> tuple[float, float]:
    if math.isnan(latitude):
        raise _unreadable(
            path,
            f"has cells of {spacing[0]:g} × {spacing[1]:g} at a corner that may be a longitude and latitude",
            "Its format does not say whether they are degrees: `spacing` has to be given as a length.",
        )
    if not abs(latitude) < 89.0:
        raise _unreadable(
            path,
            f"has cells in degrees at the latitude {latitude:g}°",
            "Between 89° south and 89° north cells have a width.",
        )
    east, north = metres_per_degree(latitude)
    return spacing[0] * east, spacing[1] * north


def _heights(path: Path, array: Array, missing: float | None = None) -> FloatArray:
    """Return heights as float64 with NaN where they are missing."""
    array = np.asarray(array)
    if array.ndim != 2 or array.dtype.kind not in "iuf":
        raise _unreadable(
            path, f"holds an array of the shape {array.shape} and type {array.dtype}", "Real heights (h, w) are needed."
        )
    if missing is None and array.dtype == np.int16:
        missing = _SRTM_VOID
    values = array.astype(np.float64)
    # GDAL writes the value as text: compare as the file's own type would round it.
    return values if missing is None else np.where(values == _as(array.dtype, missing), np.nan, values)


def _as(kind: np.dtype[Any], value: float) -> float:
    with np.errstate(over="ignore"):
        return float(np.asarray(value, np.float64).astype(kind)) if kind.kind == "f" else float(value)


def _read_npy(path: Path) -> _Found:
    try:
        with path.open("rb") as stream:
            array = np.lib.format.read_array(stream, allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise _unreadable(path, f"cannot be read ({error})", "A NumPy array of heights is needed.") from None
    return _heights(path, array), (1.0, 1.0), None


def _read_npz(path: Path) -> _Found:
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as content:
            parts = {name: content[name] for name in ("elevation", "dx", "dy", "ymin", "ymax") if name in content.files}
    except (ValueError, OSError, EOFError, KeyError, TypeError, zipfile.BadZipFile) as error:
        raise _unreadable(path, f"cannot be read ({error})", "An archive of NumPy arrays is needed.") from None
    absent = [name for name in ("elevation", "dx", "dy") if name not in parts]
    if absent or ("ymin" in parts) != ("ymax" in parts):
        raise _unreadable(
            path,
            f"holds {', '.join(parts) or 'nothing known'}",
            "The arrays elevation, dx and dy are needed, and ymin and ymax both or neither.",
        )
    heights = _heights(path, parts.pop("elevation"))
    if any(value.size != 1 or value.dtype.kind not in "iuf" for value in parts.values()):
        raise _unreadable(path, f"has no single numbers in {', '.join(parts)}", "One number in each is needed.")
    number = {name: float(value.item()) for name, value in parts.items()}
    spacing = abs(number["dx"]), abs(number["dy"])
    if "ymin" not in number:
        return heights, spacing, None
    span = abs(number["ymax"] - number["ymin"])
    # Corners may be those of the cells or the centres of the outermost ones.
    if not (len(heights) - 1.5) * spacing[1] < span < (len(heights) + 0.5) * spacing[1]:
        raise _unreadable(
            path,
            f"has {len(heights)} rows {spacing[1]:g} apart between {number['ymin']:g} and {number['ymax']:g}",
            "Rows, their distance dy and the latitudes ymin and ymax must agree, all in degrees.",
        )
    return heights, spacing, 0.5 * (number["ymin"] + number["ymax"])


def _read_tiff(path: Path) -> _Found:
    import tifffile

    try:
        with tifffile.TiffFile(path) as file:
            page = file.pages.first
            array, tags = page.asarray(), {tag.code: tag.value for tag in page.tags}
            keys = page.geotiff_tags or {}
    except (tifffile.TiffFileError, ValueError, OSError, EOFError, KeyError, IndexError, TypeError) as error:
        raise _unreadable(path, f"cannot be decoded ({error})", "A whole TIFF file is needed.") from None
    if array.dtype.itemsize < 2:
        raise _unreadable(path, f"holds {array.dtype}", "Heights of 16 or 32 bits are needed; 8 bits are a picture.")
    heights = _heights(path, array, _tiff_missing(path, tags.get(42113)))
    scale = tags.get(33550)
    if scale is None:
        if 34264 in tags:
            raise _unreadable(
                path,
                "gives its grid by a transformation matrix",
                "A grid along east and north is needed, with a scale.",
            )
        return heights, (1.0, 1.0), None
    spacing = abs(float(scale[0])), abs(float(scale[1]))
    if int(keys.get("GTModelTypeGeoKey", 1)) != 2:
        unit = int(keys.get("ProjLinearUnitsGeoKey", 9001))
        if unit != 9001:
            raise _unreadable(path, f"measures its grid in EPSG unit {unit}", "Metres (9001) or degrees are needed.")
        return heights, spacing, None
    unit, tie = int(keys.get("GeogAngularUnitsGeoKey", 9102)), tags.get(33922)
    if unit != 9102 or tie is None or len(tie) < 6:
        raise _unreadable(
            path, "has a grid of angles without latitude or not in degrees", "Degrees and a ModelTiepoint are needed."
        )
    return heights, spacing, float(tie[4]) + (float(tie[1]) - 0.5 * len(heights)) * spacing[1]


def _tiff_missing(path: Path, text: Any) -> float | None:
    if text is None:
        return None
    try:
        return float(str(text).strip("\0 "))
    except ValueError:
        raise _unreadable(path, f"has the missing value {text!r}", "A number is needed.") from None


def _read_asc(path: Path) -> _Found:
    header: dict[str, float] = {}
    try:
        words = path.read_text(encoding="ascii").split()
        start = 0
        while start + 1 < len(words) and words[start][0].isalpha() and words[start].lower() not in ("nan", "inf"):
            header[words[start].lower()] = float(words[start + 1])
            start += 2
        values = np.array(words[start:], np.float64)
    except ValueError as error:
        raise _unreadable(path, f"is no table of numbers ({error})", "An ESRI ASCII grid is needed.") from None
    rows, columns = header.get("nrows", 0.0), header.get("ncols", 0.0)
    spacing = header.get("dx", header.get("cellsize", 0.0)), header.get("dy", header.get("cellsize", 0.0))
    counts = float(rows).is_integer() and float(columns).is_integer()
    if not counts or rows * columns != values.size or not values.size or not min(spacing) > 0:
        raise _unreadable(
            path,
            f"announces {columns:g} columns, {rows:g} rows and cells of {spacing[0]:g} × {spacing[1]:g}, and holds "
            f"{values.size} numbers",
            "The header of an ESRI ASCII grid: ncols, nrows, cellsize, and as many numbers.",
        )
    heights = _heights(path, values.reshape(int(rows), int(columns)), header.get("nodata_value", -9999.0))
    south, west = (header.get(f"{axis}llcorner", header.get(f"{axis}llcenter", 0.0)) for axis in "yx")
    if (south, west) != (0.0, 0.0) and max(spacing) <= 0.1 and abs(south) <= 90.0 and abs(west) <= 360.0:
        return heights, spacing, math.nan
    return heights, spacing, None
