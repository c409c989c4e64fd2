"""Arrays of three or four channels out of image and array files, in the file's own numbers: no frames, no scaling."""

import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from psstereo.errors import InputError, MissingFileError, OptionError, PsstereoError, UnreadableFileError
from psstereo.stack.decode import decode_image
from psstereo.stack.exr_whole import require_whole_exr
from psstereo.types import Array

__all__ = ["DECODERS", "Decoded", "decode_vectors"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Decoded:
    """Numbers of a file, untouched.

    Attributes
    ----------
    values : array (h, w, 3) or (h, w, 4)
        In the order x y z (red green blue), perhaps with alpha last; integer or float as in the file.
    source : str
        What was read, for the record, such as ``"PNG"`` or ``"MATLAB variable 'Normal_gt'"``.
    """

    values: Array
    source: str


def decode_vectors(path: Path, variable: str | None = None) -> Decoded:
    """Read the array of a normal-map file.

    Parameters
    ----------
    path : Path
        The file; its suffix says what it is.
    variable : str, optional
        Name of the array in .npz and .mat files.

    Returns
    -------
    Decoded
        The file's own numbers.

    Raises
    ------
    MissingFileError
        If there is no such file.
    UnreadableFileError
        If the file is damaged, cut short or of another kind than its name says.
    OptionError
        If the suffix is unknown, or `variable` is given for a file without names or is not in the file.
    InputError
        If the array does not have three or four channels.
    """
    if not path.is_file():
        raise MissingFileError(
            given=f"'{path}' is {'a folder' if path.is_dir() else 'not there'}.",
            needed="A normal-map file is needed.",
            remedy="Check the path.",
        )
    decoder = DECODERS.get(path.suffix.lower())
    if decoder is None:
        raise OptionError(
            given=f"'{path.name}' ends in '{path.suffix}'.",
            needed=f"Known are {', '.join(DECODERS)}.",
            remedy="Convert the normal map to 16-bit PNG or to .npy.",
        )
    if variable is not None and path.suffix.lower() not in (".npz", ".mat"):
        raise OptionError(
            given=f"A variable {variable!r} was asked for, but '{path.name}' holds a single array.",
            needed="Only .npz and .mat files name their arrays.",
            remedy="Leave the variable out.",
        )
    try:
        decoded = decoder(path, variable)
    except PsstereoError:
        raise
    except Exception as error:  # decoders raise whatever they like on damaged files
        raise _damaged(path, str(error).strip() or type(error).__name__) from error
    shape = decoded.values.shape
    if decoded.values.ndim != 3 or shape[-1] not in (3, 4) or 0 in shape:
        raise InputError(
            given=f"'{path.name}' holds an array of shape {shape}.",
            needed="A normal map has three channels, or four with a mask in the last: (h, w, 3) or (h, w, 4).",
            remedy="A grey picture is a height or bump map perhaps; give the file with the normals.",
        )
    return decoded


def _damaged(path: Path, reason: str) -> UnreadableFileError:
    return UnreadableFileError(
        given=f"'{path}' cannot be decoded: {reason.rstrip('.')}.",
        needed="A complete file of the kind that its suffix says is needed.",
        remedy="Copy or export the file again.",
    )


def _decode_image(path: Path, _variable: str | None) -> Decoded:
    """Decode a picture with all its bits, as RGB or RGBA."""
    suffix = path.suffix.lower()
    return Decoded(values=decode_image(path), source="JPEG" if suffix[1] == "j" else suffix[1:].upper())


def _decode_tiff(path: Path, _variable: str | None) -> Decoded:
    """Decode TIFF by tifffile (32-bit float, planar, PackBits), or by OpenCV where a codec is missing (LZW)."""
    import tifffile

    try:
        with tifffile.TiffFile(path) as tiff:
            page = tiff.pages[0]
            values = np.asarray(page.asarray())
            planar = getattr(page, "planarconfig", 1) == 2
    except (KeyError, ValueError) as error:
        if "imagecodecs" not in str(error):
            raise
        return _decode_image(path, None)
    return Decoded(values=np.moveaxis(values, 0, -1) if planar and values.ndim == 3 else values, source="TIFF")


def _decode_exr(path: Path, _variable: str | None) -> Decoded:
    """Decode the colour channels of an EXR file, or the three channels x, y, z; layers count when there is only one."""
    import OpenEXR

    require_whole_exr(path)  # before the decoder, which writes to stdout
    with OpenEXR.File(str(path)) as file:
        channels = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
    grouped = [(name, pixels) for name, pixels in channels.items() if pixels.ndim == 3 and pixels.shape[-1] in (3, 4)]
    if len(grouped) > 1:
        grouped = [(name, pixels) for name, pixels in grouped if name in ("RGB", "RGBA")]
    if len(grouped) == 1:
        return Decoded(values=grouped[0][1], source=f"EXR channels '{grouped[0][0]}'")
    by_letter: dict[str, list[Array]] = {}
    for name, pixels in channels.items():
        by_letter.setdefault(name.rpartition(".")[2].upper(), []).append(pixels)
    for letters in ("XYZ", "RGB"):
        if all(len(by_letter.get(letter, [])) == 1 for letter in letters):
            return Decoded(
                values=np.stack([by_letter[letter][0] for letter in letters], axis=-1), source=f"EXR channels {letters}"
            )
    raise InputError(
        given=f"'{path.name}' has the channels {', '.join(channels) or '(none)'}.",
        needed="Exactly one set of channels R G B or X Y Z is needed.",
        remedy="Export the normals alone.",
    )


def _decode_npy(path: Path, _variable: str | None) -> Decoded:
    loaded = np.load(path, allow_pickle=False)
    if not isinstance(loaded, np.ndarray):
        loaded.close()
        raise _damaged(path, "it is an .npz archive by another name")
    return Decoded(values=loaded, source="NumPy array")


def _decode_npz(path: Path, variable: str | None) -> Decoded:
    if not zipfile.is_zipfile(path):
        raise _damaged(path, "it is not an .npz archive, or is cut short")
    with np.load(path, allow_pickle=False) as archive:
        if variable is not None and variable in archive.files:
            return Decoded(values=archive[variable], source=f"NumPy array '{variable}'")
        arrays = {name: archive[name] for name in archive.files}
    name = _pick(path, arrays, variable, ())
    return Decoded(values=arrays[name], source=f"NumPy array '{name}'")


def _decode_mat(path: Path, variable: str | None) -> Decoded:
    from scipy.io import loadmat

    try:
        contents: dict[str, Any] = loadmat(path)
    except NotImplementedError as error:
        raise UnreadableFileError(
            given=f"'{path}' is a MATLAB file of version 7.3 (HDF5).",
            needed="Version 5 to 7.2 is needed.",
            remedy="Save it in MATLAB with save(..., '-v7').",
        ) from error
    arrays = {name: value for name, value in contents.items() if isinstance(value, np.ndarray)}
    name = _pick(path, arrays, variable, ("Normal_gt",))
    return Decoded(values=arrays[name], source=f"MATLAB variable '{name}'")


def _pick(path: Path, arrays: Mapping[str, Array], variable: str | None, preferred: tuple[str, ...]) -> str:
    """Return the name asked for, a preferred one, or that of the only (h, w, 3) array."""
    listing = ", ".join(f"{name} {value.shape}" for name, value in arrays.items()) or "nothing"
    if variable is not None:
        if variable in arrays:
            return variable
        raise OptionError(
            given=f"The variable {variable!r} is not in '{path.name}'.",
            needed=f"The file holds {listing}.",
            remedy="Give one of these names.",
        )
    candidates = [name for name, value in arrays.items() if value.ndim == 3 and value.shape[-1] == 3]
    chosen = [name for name in preferred if name in candidates] or candidates
    if len(chosen) != 1:
        raise InputError(
            given=f"'{path.name}' holds {listing}.",
            needed="Without a name, exactly one array (h, w, 3) is needed.",
            remedy="Say which array holds the normals (variable=...).",
        )
    return chosen[0]


DECODERS: Mapping[str, Callable[[Path, str | None], Decoded]] = {
    ".png": _decode_image,
    ".bmp": _decode_image,
    ".jpg": _decode_image,
    ".jpeg": _decode_image,
    ".tga": _decode_image,
    ".tif": _decode_tiff,
    ".tiff": _decode_tiff,
    ".exr": _decode_exr,
    ".npy": _decode_npy,
    ".npz": _decode_npz,
    ".mat": _decode_mat,
}
"""Decoders by suffix."""
