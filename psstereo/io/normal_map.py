"""Normal maps in and out: how vectors are coded as colours, and which pixels have one.

The usual code is value = round((n + 1)/2 · full), red x, green y, blue z. Meshroom's PNG files differ: red is
⌊255 (x + 1)/2⌋; green is a negative number, −⌈255 (y_down + 1)/2⌉ (older versions: −⌊…⌋), squeezed into a byte, so that
it runs upward with 0 standing for the topmost value; blue is 255 |z|, with half the usual range; the background is pure
black. Read as usual colours, every normal comes out tilted.
"""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from psstereo.errors import InputError, MissingFileError, OptionError
from psstereo.io.conventions import find_convention, from_canonical, to_canonical
from psstereo.io.normal_map_files import Decoded, decode_vectors
from psstereo.types import Array, BoolArray, FloatArray

__all__ = ["WRITERS", "NormalMap", "Writer", "read_normal_map", "write_normal_map"]

Writer: TypeAlias = Callable[[Path, FloatArray, BoolArray, str], None]
"""Takes path, vectors in the foreign frame (h, w, 3), mask (h, w) and the convention's name."""

_SHORT = 0.5
_ODD_LENGTH = 0.05


@dataclass(frozen=True, kw_only=True, eq=False)
class NormalMap:
    """A normal map as read.

    Attributes
    ----------
    normals : float32 or float64 array (h, w, 3)
        Unit normals, x right, y up, z toward the camera; NaN where the file has none [1].
    mask : bool array (h, w)
        Where there is a normal.
    notes : tuple of str
        What was found and decided while reading, as sentences for the record.
    """

    normals: FloatArray
    mask: BoolArray
    notes: tuple[str, ...]


def read_normal_map(
    path: str | os.PathLike[str], *, convention: str = "opengl", variable: str | None = None
) -> NormalMap:
    """Read a normal map of 8 or 16 bits a channel (.png, .bmp, .jpg, .tif) or of floats (.tif, .exr, .npy, .npz, .mat).

    Pixels are undefined, NaN and outside the mask, where the coded vector's length differs from 1 by 0.5 or more
    (integer files: black, white and mid-grey backgrounds), is below 0.5 (float files), is not finite, or where alpha is
    below one half. All others are scaled to unit length. Files of floats between 0 and 1 that are plainly colours are
    decoded as such; the notes say so. Integers and float32 give float32, float64 stays.

    Parameters
    ----------
    path : path
        The file; blanks and accents are fine.
    convention : str
        Frame of the file, a key of :data:`psstereo.io.conventions.CONVENTIONS`. Files never say which:
        :func:`psstereo.io.green_convention.green_convention` tells "opengl" from "directx" by the surface.
        "meshroom" means Meshroom's own colour code in 8-bit files and its frame in float files.
    variable : str, optional
        Name of the array in .npz and .mat files; without it ``Normal_gt`` (.mat) or the only (h, w, 3) array.

    Returns
    -------
    NormalMap
        Normals, mask and notes.

    Raises
    ------
    MissingFileError
        If there is no such file.
    UnreadableFileError
        If the file is damaged, cut short, pickled, or MATLAB 7.3.
    OptionError
        If the convention, the suffix or the variable is unknown.
    InputError
        If the picture is grey or has not three or four channels, has an integer type other than 8 or 16 bits without
        sign, or holds no normal at all.

    References
    ----------
    Lengths as in SDM-UniPS (Ikehata, CVPR 2023), which keeps pixels with ``abs(1 - length) < 0.5``.
    """
    path = Path(path)
    find_convention(convention)
    decoded = decode_vectors(path, variable)
    vectors, lit, coded, notes = _to_vectors(path, decoded, convention)
    with np.errstate(over="ignore"):
        lengths = np.linalg.norm(vectors, axis=-1)
    longest = 2.0 - _SHORT if coded else np.inf  # a white background decodes to length 1.7
    mask: BoolArray = lit & (lengths >= _SHORT) & (lengths < longest)
    if not mask.any():
        raise InputError(
            given=f"'{path.name}' holds no vector of about unit length.",
            needed="Red, green and blue have to be a normal's x, y and z.",
            remedy="Check that this is a normal map, in a frame fixed to the camera.",
        )
    odd = float(np.median(np.abs(lengths[mask] - 1.0)))
    if odd > _ODD_LENGTH:
        notes.append(
            f"The vectors' lengths differ from 1 by {odd:.2f} (median), so the file may be coded another way "
            "(Meshroom's PNG, or colours that went through gamma). They were scaled to 1."
        )
    normals = np.where(mask[..., None], vectors / np.where(mask, lengths, 1.0)[..., None], np.nan)
    notes.append(f"{np.count_nonzero(mask)} of {mask.size} pixels have a normal.")
    return NormalMap(
        normals=to_canonical(normals.astype(vectors.dtype, copy=False), convention), mask=mask, notes=tuple(notes)
    )


def _to_vectors(path: Path, decoded: Decoded, convention: str) -> tuple[FloatArray, BoolArray, bool, list[str]]:
    """Return vectors in the foreign frame (h, w, 3), alpha's mask (h, w), whether they were colours, and notes."""
    values = decoded.values
    notes = [f"{decoded.source}, {values.dtype.name}, read as '{convention}'."]
    integer = np.issubdtype(values.dtype, np.integer)
    if (integer and values.dtype not in (np.uint8, np.uint16)) or not (
        integer or np.issubdtype(values.dtype, np.floating)
    ):
        raise InputError(
            given=f"'{path.name}' holds numbers of type {values.dtype.name}.",
            needed="8 or 16 bits without sign, or floats, are needed.",
            remedy="Export the normal map as 16-bit PNG or as floats.",
        )
    full = float(np.iinfo(values.dtype).max) if integer else 1.0
    lit: BoolArray = np.ones(values.shape[:2], dtype=np.bool_)
    if values.shape[-1] == 4:
        lit = np.asarray(values[..., 3] >= 0.5 * full)
        notes.append("The alpha channel was taken as the mask.")
    colours = values[..., :3]
    if (colours[..., :1] == colours[..., 1:]).all():
        raise InputError(
            given=f"'{path.name}' is a grey picture: its three channels are equal.",
            needed="A normal map has x, y and z in red, green and blue.",
            remedy="This is a height or bump map perhaps; give the file with the normals.",
        )
    if integer and convention == "meshroom":
        return *_decode_meshroom(path, colours, lit), True, notes
    precision: type[np.floating[Any]] = np.float64 if values.dtype.itemsize > 4 else np.float32
    vectors = np.asarray(colours, dtype=precision)
    if integer:
        return vectors * precision(2.0 / full) - precision(1.0), lit, True, notes
    if _is_coded(vectors):
        notes.append("The floats lie between 0 and 1 and are unit vectors only when decoded as colours, so they were.")
        return 2 * vectors - 1, lit & (vectors != 0).any(axis=-1), True, notes
    return vectors, lit, False, notes


def _is_coded(vectors: FloatArray) -> bool:
    """Say whether floats are colours (n + 1)/2 and not vectors: from 0 to 1, and of unit length only after decoding."""
    used = vectors[np.isfinite(vectors).all(axis=-1) & (vectors != 0).any(axis=-1)]
    if used.size == 0 or used.min() < 0 or used.max() > 1:
        return False
    plain = np.median(np.abs(np.linalg.norm(used, axis=-1) - 1.0))
    decoded = np.median(np.abs(np.linalg.norm(2.0 * used - 1.0, axis=-1) - 1.0))
    return bool(decoded < 0.02 and plain > _ODD_LENGTH)


def _decode_meshroom(path: Path, colours: Array, lit: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Undo Meshroom's 8-bit code; vectors in its frame (y down, z away). Both versions' rounding within one step."""
    if colours.dtype != np.uint8:
        raise InputError(
            given=f"'{path.name}' has 16 bits, but Meshroom's PNG code has 8.",
            needed="An 8-bit PNG as Meshroom writes it, or its float EXR file, is needed.",
            remedy="Read the file as 'opengl' if another program wrote it.",
        )
    red, green, blue = (colours[..., channel].astype(np.float32) for channel in range(3))
    right = 2.0 * (red + np.float32(0.5)) / 255.0 - 1.0
    down = 2.0 * ((256.0 - green) % 256.0) / 255.0 - 1.0
    return np.stack([right, down, -blue / 255.0], axis=-1).astype(np.float32), lit & (colours != 0).any(axis=-1)


def _encode_meshroom(vectors: FloatArray, mask: BoolArray) -> Array:
    """Code vectors in Meshroom's frame as its present version does: red down, green and blue up, then a byte."""
    red = np.floor(255.0 * (vectors[..., 0] + 1.0) / 2.0)
    green = -np.ceil(255.0 * (vectors[..., 1] + 1.0) / 2.0)
    blue = -np.ceil(255.0 * np.minimum(vectors[..., 2], 0.0))
    coded = np.stack([red, green, blue], axis=-1)
    return np.where(mask[..., None], coded, 0.0).astype(np.int64).astype(np.uint8)


def write_normal_map(normals: FloatArray, path: str | os.PathLike[str], *, convention: str = "opengl") -> None:
    """Write a normal map; the suffix says as what.

    ``.png``: 16 bits, value = round((n + 1)/2 · 65535), pixels without a normal black (0, 0, 0); with the convention
    "meshroom" 8 bits in Meshroom's own code. Worst error: 0.0015 degrees, and 0.55 with Meshroom's code. ``.npy``:
    float32, NaN where there is no normal. ``.exr``, ``.tif``, ``.tiff``: float32, zero vectors where there is none,
    since few programs expect NaN. All of them come back from :func:`read_normal_map` with the same mask. The file
    appears whole or not at all; an existing one is replaced.

    Parameters
    ----------
    normals : float array (h, w, 3)
        Normals, x right, y up, z toward the camera; NaN or a length below 0.5 where there is none. The others are
        scaled to unit length [1].
    path : path
        The file to write, ending in one of the keys of :data:`WRITERS`.
    convention : str
        Frame of the file, a key of :data:`psstereo.io.conventions.CONVENTIONS`.

    Raises
    ------
    OptionError
        If the suffix or the convention is unknown.
    InputError
        If the normals are not a float array (h, w, 3).
    MissingFileError
        If the folder does not exist.
    """
    path, array = Path(path), np.asarray(normals)
    find_convention(convention)
    writer = _find_writer(path)
    if array.ndim != 3 or array.shape[-1] != 3 or 0 in array.shape or not np.issubdtype(array.dtype, np.floating):
        raise InputError(
            given=f"The normals have shape {array.shape} and type {array.dtype.name}.",
            needed="Floats of shape (h, w, 3) are needed.",
            remedy="Give vectors, not colours.",
        )
    wide = array.astype(np.float64)
    with np.errstate(over="ignore"):
        lengths = np.linalg.norm(wide, axis=-1)
    mask = np.asarray(np.isfinite(lengths) & (lengths >= _SHORT))
    unit = np.where(mask[..., None], wide / np.where(mask, lengths, 1.0)[..., None], 0.0)
    partial = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        writer(partial, from_canonical(unit, convention), mask, convention)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _find_writer(path: Path) -> Writer:
    """Return the writer for a path whose folder exists."""
    writer = WRITERS.get(path.suffix.lower())
    if writer is None:
        raise OptionError(
            given=f"'{path.name}' ends in '{path.suffix}'.",
            needed=f"Normal maps are written as {', '.join(WRITERS)}.",
            remedy="Use .png for other programs, .npy for full precision.",
        )
    if not path.parent.is_dir():
        raise MissingFileError(
            given=f"The folder '{path.parent}' is not there.",
            needed="The file has to go into a folder that exists.",
            remedy="Create the folder first.",
        )
    return writer


def _write_png(path: Path, vectors: FloatArray, mask: BoolArray, convention: str) -> None:
    import cv2

    if convention == "meshroom":
        coded = _encode_meshroom(vectors, mask)
    else:
        coded = np.where(mask[..., None], np.round((vectors + 1.0) * 32767.5), 0.0).astype(np.uint16)
    done, data = cv2.imencode(".png", np.ascontiguousarray(coded[..., ::-1]))
    if not done:
        raise InputError(
            given=f"A picture of shape {coded.shape} could not be coded as PNG.",
            needed="A picture within the limits of OpenCV's PNG writer is needed.",
            remedy="Write .npy or .exr instead.",
        )
    data.tofile(path)


def _write_npy(path: Path, vectors: FloatArray, mask: BoolArray, _convention: str) -> None:
    np.save(path, np.where(mask[..., None], vectors, np.nan).astype(np.float32), allow_pickle=False)


def _write_exr(path: Path, vectors: FloatArray, _mask: BoolArray, _convention: str) -> None:
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": np.ascontiguousarray(vectors, dtype=np.float32)}) as file:
        file.write(str(path))


def _write_tiff(path: Path, vectors: FloatArray, _mask: BoolArray, _convention: str) -> None:
    import tifffile

    tifffile.imwrite(path, vectors.astype(np.float32), photometric="rgb", metadata=None)


WRITERS: Mapping[str, Writer] = {
    ".png": _write_png,
    ".npy": _write_npy,
    ".exr": _write_exr,
    ".tif": _write_tiff,
    ".tiff": _write_tiff,
}
"""Writers by suffix."""
