"""One image file to an array, in the file's own integers or floats.

Whatever cannot be decoded whole is refused: some versions of the decoders hand out the readable part of a truncated
file with the rest black, which a solver would take for shadow.
"""

from pathlib import Path

import numpy as np

from psstereo.errors import MissingFileError, UnreadableFileError
from psstereo.stack.raw import RAW_SUFFIXES, decode_raw
from psstereo.types import Array

__all__ = ["IMAGE_SUFFIXES", "decode_image", "read_bytes"]

IMAGE_SUFFIXES = RAW_SUFFIXES | {
    *(".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".ppm", ".pnm", ".tga", ".exr", ".hdr", ".webp", ".npy")
}
"""Endings of the image files that :func:`decode_image` reads, lower case."""

_TAIL = 1 << 16
"""Bytes at the end of a file in which its end marker must stand; cameras append a little data after it."""


def read_bytes(path: Path) -> Array:
    """Return a file's bytes, uint8 (n,), or say clearly that it is not there or empty."""
    try:
        data = np.fromfile(path, np.uint8)  # takes any file name, which cv2.imread on Windows does not
    except FileNotFoundError:
        raise MissingFileError(
            given=f"The file {path} does not exist.",
            needed="Every file that is listed or named must be there.",
            remedy="Check its name and folder; an image taken out of a list takes its light with it.",
        ) from None
    except OSError as error:
        raise UnreadableFileError(
            given=f"The file {path} cannot be read ({error.strerror or error}).",
            needed="A readable file.",
            remedy="Check that it is a file and that you may read it.",
        ) from None
    if data.size == 0:
        raise _damaged(path, "is empty")
    return data


def decode_image(path: Path, *, half: bool = False) -> Array:
    """Decode an image file without changing its values.

    Parameters
    ----------
    path : Path
        A file of one of the kinds in `IMAGE_SUFFIXES`; its ending decides who decodes it.
    half : bool
        Whether four photosites of a RAW file make one pixel; images of other kinds stay as they are.

    Returns
    -------
    array (h, w) or (h, w, c)
        uint8, uint16, float32 or float64; channels R, G, B (and A). It may be a view with a negative stride.

    Raises
    ------
    MissingFileError
        If the file is not there.
    UnreadableFileError
        If it is damaged, truncated, or no image of a known kind.
    OptionError
        If it is a RAW file and the extra raw is not installed.
    """
    suffix = path.suffix.lower()
    if suffix == ".npy":
        return _decode_npy(path)
    if suffix == ".exr":
        return _decode_exr(path)
    data = read_bytes(path)
    if suffix in RAW_SUFFIXES:
        return decode_raw(path, half=half)
    if suffix == ".tga":
        return _decode_pillow(path)
    _require_end(path, data)
    return _decode_opencv(path, data)


def _decode_opencv(path: Path, data: Array) -> Array:
    import cv2

    try:
        image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise _damaged(path, f"cannot be decoded ({error.err})") from None
    if image is None:
        raise _damaged(path, "is damaged, truncated, or no image")
    array = np.asarray(image)
    if array.ndim == 2:
        return array
    # OpenCV hands out B, G, R(, A); a reversed view costs nothing.
    return array[..., ::-1] if array.shape[2] == 3 else array[..., [2, 1, 0, 3][: array.shape[2]]]


def _require_end(path: Path, data: Array) -> None:
    """Refuse a PNG or JPEG whose end marker is missing."""
    head, tail = data[:8].tobytes(), data[-_TAIL:].tobytes()
    if head.startswith(b"\x89PNG") and b"IEND" not in tail:
        raise _damaged(path, "is a PNG that ends before its last chunk")
    if head.startswith(b"\xff\xd8") and b"\xff\xd9" not in tail:
        raise _damaged(path, "is a JPEG that ends before its end marker")


def _decode_pillow(path: Path) -> Array:
    """Decode kinds that OpenCV does not know, such as TGA; all of them hold 8 bits a channel."""
    from PIL import Image

    try:
        with Image.open(path) as image:
            if image.mode not in ("L", "RGB", "RGBA"):
                return np.asarray(image.convert("RGB"))
            return np.asarray(image)
    except (OSError, SyntaxError, ValueError) as error:
        raise _damaged(path, f"cannot be decoded ({error})") from None


def _decode_npy(path: Path) -> Array:
    read_bytes(path)
    try:
        return np.asarray(np.load(path, allow_pickle=False))
    except (ValueError, OSError, EOFError) as error:
        raise _damaged(path, f"cannot be decoded ({error})") from None


def _decode_exr(path: Path) -> Array:
    import OpenEXR

    from psstereo.stack.exr_whole import require_whole_exr

    require_whole_exr(path)  # before the decoder, which writes to stdout
    try:
        with OpenEXR.File(str(path)) as file:
            channels = {name: np.asarray(channel.pixels) for name, channel in file.channels().items()}
    except (RuntimeError, ValueError, OSError, TypeError) as error:
        raise _damaged(path, f"cannot be decoded ({error})") from None
    for group in ("RGBA", "RGB", "Y"):
        if group in channels:
            return channels[group].astype(np.float32)
    if all(name in channels for name in "RGB"):
        return np.stack([channels[name] for name in "RGB"], axis=-1).astype(np.float32)
    raise _damaged(path, f"holds the channels {', '.join(sorted(channels))}, not R, G, B or Y")


def _damaged(path: Path, how: str) -> UnreadableFileError:
    return UnreadableFileError(
        given=f"The file {path} {how}.",
        needed="A whole image file is needed; part of one would be taken for shadow.",
        remedy="Copy it again from its source; a photograph that is left out takes its light with it.",
    )
