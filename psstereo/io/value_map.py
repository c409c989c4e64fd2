"""Maps of one number a pixel out of array and image files: depth, heights, uncertainty; in the file's own numbers."""

import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from psstereo.errors import InputError, PsstereoError, UnreadableFileError
from psstereo.io.mat_file import read_mat
from psstereo.io.text import require_file
from psstereo.stack.decode import IMAGE_SUFFIXES, decode_image, read_bytes
from psstereo.stack.exr_whole import require_whole_exr
from psstereo.types import Array, BoolArray

__all__ = ["ValueMap", "read_value_map"]


@dataclass(frozen=True, kw_only=True, eq=False)
class ValueMap:
    """One number a pixel.

    Attributes
    ----------
    values : array (h, w)
        Integers or floats as in the file.
    no_data : bool array (h, w)
        Where the file itself says that there is nothing: a GeoTIFF's value for that.
    source : str
        What was read, for the record, such as ``"coarse.npz, depth"``.
    """

    values: Array
    no_data: BoolArray
    source: str


def read_value_map(path: Path, shape: tuple[int, int], *, what: str, names: Sequence[str] = ()) -> ValueMap:
    """Read a map of one number a pixel from ``.npy``, ``.npz``, ``.mat``, ``.tif``, ``.exr`` or an image file.

    Parameters
    ----------
    path : Path
        The file; its ending says what it is. Three channels count as one if they are equal.
    shape : (int, int)
        Rows and columns that it must have.
    what : str
        What the map is called, for messages.
    names : sequence of str
        What the array may be called in ``.npz`` and ``.mat``; otherwise the only two-dimensional one is taken.

    Returns
    -------
    ValueMap
        Integers or floats, untouched.

    Raises
    ------
    MissingFileError
        If there is no such file.
    UnreadableFileError
        If it is damaged, cut short or of another kind than its name says.
    InputError
        If it holds something other than one real number for each pixel, or the ending is unknown.
    """
    require_file(path)
    suffix = path.suffix.lower()
    decoder = _DECODERS.get(suffix, _decode_picture if suffix in IMAGE_SUFFIXES else None)
    if decoder is None:
        raise InputError(
            given=f"The {what} {path.name} ends in '{path.suffix}'.",
            needed=f"Known are {', '.join(_DECODERS)} and image files.",
            remedy="Save it as .npy, or as 32-bit TIFF.",
        )
    try:
        values, nothing, name = decoder(path, names)
    except PsstereoError:
        raise
    except Exception as error:  # decoders raise whatever they like on damaged files
        reason = " ".join(str(error).split()).rstrip(".") or type(error).__name__
        raise UnreadableFileError(
            given=f"The {what} {path} cannot be decoded ({reason}).",
            needed="A complete file of the kind that its ending says.",
            remedy="Copy or export it again.",
        ) from error
    values = _one_channel(values)
    _require_numbers(values, path, shape, what)
    no_data = np.zeros(shape, np.bool_) if nothing is None else np.asarray(values == nothing)
    return ValueMap(values=values, no_data=no_data, source=", ".join(filter(None, (path.name, name))))


def _one_channel(values: Array) -> Array:
    """Drop axes of length one, and channels that repeat the first."""
    if values.ndim == 3 and 1 in values.shape:
        values = values.squeeze(axis=0 if values.shape[0] == 1 else (2 if values.shape[2] == 1 else 1))
    equal_nan = values.dtype.kind == "f"  # NaN means unknown in all three
    if (
        values.ndim == 3
        and values.shape[2] == 3
        and np.array_equal(values[..., 1:], values[..., [0, 0]], equal_nan=equal_nan)
    ):
        return np.asarray(values[..., 0])
    return values


def _require_numbers(values: Array, path: Path, shape: tuple[int, int], what: str) -> None:
    if values.ndim != 2 or values.dtype.kind not in "fiu":
        raise InputError(
            given=f"The {what} {path.name} holds an array of shape {values.shape} and type {values.dtype}.",
            needed="One real number for each pixel.",
            remedy="Save a single channel of numbers, not a coloured picture of them.",
        )
    if values.shape != shape:
        raise InputError(
            given=f"The {what} {path.name} is {values.shape[1]} × {values.shape[0]} pixels.",
            needed=f"It must have the size of the normals, {shape[1]} × {shape[0]}.",
            remedy="Bring it to the same pixels, crop and size.",
        )


def _decode_picture(path: Path, _names: Sequence[str]) -> tuple[Array, float | None, str]:
    return decode_image(path), None, ""


def _decode_npz(path: Path, names: Sequence[str]) -> tuple[Array, float | None, str]:
    read_bytes(path)
    if not zipfile.is_zipfile(path):
        raise ValueError("it is no .npz archive, or is cut short")
    with np.load(path, allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    name = _pick(path, arrays, names)
    return arrays[name], None, name


def _decode_mat(path: Path, names: Sequence[str]) -> tuple[Array, float | None, str]:
    arrays = {name: value for name, value in read_mat(path).items() if isinstance(value, np.ndarray)}
    name = _pick(path, arrays, names)
    return arrays[name], None, name


def _pick(path: Path, arrays: Mapping[str, Array], names: Sequence[str]) -> str:
    """Return the first known name, or that of the only map."""
    known = [name for name in names if name in arrays][:1]
    maps = known or [name for name, value in arrays.items() if value.ndim == 2 and min(value.shape) > 1]
    if len(maps) == 1:
        return maps[0]
    raise InputError(
        given=f"{path.name} holds {', '.join(f'{name} {value.shape}' for name, value in arrays.items()) or 'nothing'}.",
        needed=f"One array (rows, columns){', or one that is called ' + ' or '.join(names) if names else ''}.",
        remedy="Save the one array by itself, as .npy.",
    )


def _decode_tiff(path: Path, _names: Sequence[str]) -> tuple[Array, float | None, str]:
    """Decode by tifffile, which refuses what is cut short, or by OpenCV where a codec is missing."""
    import tifffile

    read_bytes(path)
    with tifffile.TiffFile(path) as tiff:
        page = tiff.pages.first
        nothing = float(page.nodata) if "GDAL_NODATA" in page.tags else None
        try:
            return np.asarray(page.asarray()), nothing, ""
        except (KeyError, ValueError) as error:
            if "imagecodecs" not in str(error):
                raise
    return decode_image(path), nothing, ""


def _decode_exr(path: Path, _names: Sequence[str]) -> tuple[Array, float | None, str]:
    """Decode the only channel, whatever its name, or a gray picture of three."""
    import OpenEXR

    require_whole_exr(path)
    with OpenEXR.File(str(path)) as file:
        channels = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
    if len(channels) != 1:
        raise InputError(
            given=f"{path.name} has the channels {', '.join(channels) or '(none)'}.",
            needed="One channel, or gray in R, G and B.",
            remedy="Export that channel alone.",
        )
    name, pixels = next(iter(channels.items()))
    return pixels, None, "" if name in ("Y", "RGB") else f"channel {name}"


_Decoder = Callable[[Path, Sequence[str]], tuple[Array, float | None, str]]

_DECODERS: Mapping[str, _Decoder] = {
    ".npy": _decode_picture,
    ".npz": _decode_npz,
    ".mat": _decode_mat,
    ".tif": _decode_tiff,
    ".tiff": _decode_tiff,
    ".exr": _decode_exr,
}
"""Decoders by ending: array, value for nothing, and name of the array."""
