"""Environment maps in files: OpenEXR and Radiance's HDR, in linear floats."""

import re
from pathlib import Path

import numpy as np

from psstereo.errors import InputError, MissingFileError, OptionError, RigError, UnreadableFileError
from psstereo.lights import Environment
from psstereo.stack.decode import decode_image, read_bytes
from psstereo.types import Array, FloatArray

__all__ = ["ENVIRONMENT_SUFFIXES", "read_environment", "write_environment"]

ENVIRONMENT_SUFFIXES = (".exr", ".hdr")
"""Suffixes that :func:`read_environment` and :func:`write_environment` know."""

_HEADER = 1 << 16
"""Bytes within which the header of an HDR file ends."""


def read_environment(path: Path) -> Environment:
    """Read a latitude-longitude map.

    Its numbers are taken as radiances as they stand, apart from exposures noted in an HDR file, which are divided out
    as Radiance asks. Transparency is left out.

    Parameters
    ----------
    path : Path
        ``.exr`` with R, G, B or Y, or ``.hdr``; twice as wide as high.

    Returns
    -------
    Environment
        The light, not turned: see :class:`~psstereo.lights.environment.Environment` for where the map's middle looks.

    Raises
    ------
    OptionError
        If the suffix is another one, such as that of an image in 8 bits.
    MissingFileError
        If the file is not there.
    UnreadableFileError
        If it is damaged, truncated, or of a kind whose colours are unknown.
    InputError
        If it is not twice as wide as high.
    RigError
        If a radiance is negative or not finite, or a channel is dark everywhere.
    """
    path = Path(path)
    suffix = _known_suffix(path)
    scale = _hdr_scale(path) if suffix == ".hdr" else 1.0
    image = decode_image(path)
    if image.ndim == 3 and image.shape[2] == 4:
        image = image[..., :3]
    _require_panorama(image, f"The file {path}")
    try:
        return Environment(radiance=image.astype(np.float64) * scale)
    except RigError as error:
        raise RigError(given=f"In {path}: {error.given}", needed=error.needed, remedy=error.remedy) from None


def write_environment(path: Path, radiance: FloatArray) -> None:
    """Write a latitude-longitude map; an existing file is replaced once the new one is complete.

    Parameters
    ----------
    path : Path
        File to write: ``.exr`` in single precision, or ``.hdr`` with a common exponent for R, G, B, which rounds to
        1/512 of the pixel's brightest channel and holds one channel as three equal ones.
    radiance : float array (h, w), (h, w, 1) or (h, w, 3)
        As of :class:`~psstereo.lights.environment.Environment`, twice as wide as high [W m⁻² sr⁻¹], or relative.

    Raises
    ------
    OptionError
        If the suffix is another one.
    MissingFileError
        If the folder does not exist.
    InputError
        If the shape is another one, or a radiance exceeds the format's range.
    RigError
        If a radiance is negative or not finite, or a channel is dark everywhere.
    """
    path = Path(path)
    suffix = _known_suffix(path)
    if not path.parent.is_dir():
        raise MissingFileError(
            given=f"The folder {path.parent} does not exist.",
            needed="A map is written into an existing folder.",
            remedy="Create the folder first, or check the path.",
        )
    values = Environment(radiance=radiance).radiance
    _require_panorama(values, "The map")
    if values.max() > 1e38:
        raise InputError(
            given=f"The largest radiance is {values.max():.4g}.",
            needed="These files hold numbers up to 1e38.",
            remedy="Give radiances in a larger unit.",
        )
    unfinished = path.with_name(f".{path.stem}-part{suffix}")  # with the suffix, by which OpenEXR may choose
    try:
        (_write_exr if suffix == ".exr" else _write_hdr)(unfinished, values.astype(np.float32))
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def _known_suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in ENVIRONMENT_SUFFIXES:
        raise OptionError(
            given=f"The environment map {path.name} has the suffix '{path.suffix}'.",
            needed=f"Known are {' and '.join(ENVIRONMENT_SUFFIXES)}, which hold linear radiances. Images in 8 bits are "
            "bent by a display curve, and cut off at white, where most of the light is.",
            remedy="Take the map as .exr or .hdr from its source; a converted 8-bit image does not bring it back.",
        )
    return suffix


def _require_panorama(image: Array, what: str) -> None:
    if image.ndim not in (2, 3) or image.shape[1] != 2 * image.shape[0] or (image.ndim == 3 and image.shape[2] > 3):
        raise InputError(
            given=f"{what} has the shape {image.shape}.",
            needed="A latitude-longitude map of the whole sphere is twice as wide as high, with 1 or 3 channels.",
            remedy="Convert cubes, mirror balls and angular maps first, and put cropped panoramas back to full height.",
        )


def _hdr_scale(path: Path) -> float:
    """Return what the numbers of an HDR file must be multiplied by, from its header; refuse one with holes."""
    data = read_bytes(path).tobytes()
    _require_whole_rows(path, data)
    head = data[:_HEADER].split(b"\n\n")[0].decode("latin-1")
    if re.search(r"^FORMAT\s*=\s*32-bit_rle_xyze\s*$", head, re.MULTILINE):
        raise UnreadableFileError(
            given=f"The file {path} holds CIE X, Y, Z.",
            needed="Radiances in R, G, B are needed.",
            remedy="Convert it, for example with Radiance's ra_xyze.",
        )
    scale = 1.0
    for text in re.findall(r"^EXPOSURE\s*=(.*)$", head, re.MULTILINE):
        try:
            exposure = float(text)
        except ValueError:
            exposure = np.nan
        if not (np.isfinite(exposure) and exposure > 0):
            raise UnreadableFileError(
                given=f"The header of {path} has the exposure '{text.strip()}'.",
                needed="An exposure is a number greater than 0.",
                remedy="Correct that line of the header, or take it out.",
            )
        scale /= exposure  # several lines multiply
    return scale


def _require_whole_rows(path: Path, data: bytes) -> None:
    """Refuse an HDR file whose runs do not fill its rows: OpenCV takes what follows a bad row for plain pixels."""
    found = re.search(rb"\n\n-Y (\d+) \+X (\d+)\n", data[:_HEADER])
    if found is None:
        return  # the decoder says what it is
    rows, width = int(found[1]), int(found[2])
    at = found.end()
    if len(data) - at == 4 * rows * width:
        return  # no runs
    for row in range(rows):
        whole = data[at : at + 4] == bytes([2, 2, width >> 8 & 0xFF, width & 0xFF])
        at += 4
        for _ in range(4):
            filled = 0
            while whole and filled < width:
                length = data[at] if at < len(data) else 0
                whole = length > 0
                filled += length - 128 if length > 128 else length
                at += 2 if length > 128 else 1 + length
            whole = whole and filled == width
        if not whole or at > len(data):
            raise UnreadableFileError(
                given=f"The file {path} is damaged or truncated in row {row + 1} of {rows}.",
                needed="Each row must hold as many pixels as the header says.",
                remedy="Copy it again from its source.",
            )


def _write_exr(path: Path, values: Array) -> None:
    import OpenEXR

    channels = {"RGB": np.ascontiguousarray(values)} if values.shape[2] == 3 else {"Y": values[..., 0].copy()}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, channels) as file:
        file.write(str(path))


def _write_hdr(path: Path, values: Array) -> None:
    import cv2

    # The coder cuts mantissas to eight bits; half a step more makes that rounding, so that maps get no darker.
    brightest, half = values.max(axis=-1, keepdims=True), np.float32(1 / 512)
    brightest = brightest + np.ldexp(half, np.frexp(brightest)[1])  # rounding may take it to the next exponent
    rounded = np.broadcast_to(values + np.ldexp(half, np.frexp(brightest)[1]), (*values.shape[:2], 3))
    done, encoded = cv2.imencode(".hdr", np.ascontiguousarray(rounded[..., ::-1]))
    if not done:
        raise InputError(
            given=f"A map of the shape {values.shape} could not be coded as HDR.",
            needed="A map within the limits of OpenCV's HDR writer is needed.",
            remedy="Write .exr instead.",
        )
    path.write_bytes(encoded.tobytes())
