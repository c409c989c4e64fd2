"""RAW files of cameras, through LibRaw: values proportional to light, one a photosite, made into R, G, B."""

from pathlib import Path
from typing import Any

import numpy as np

from psstereo.errors import MissingFileError, OptionError, UnreadableFileError
from psstereo.types import Array

__all__ = ["RAW_SUFFIXES", "decode_raw"]

RAW_SUFFIXES = frozenset(
    {".3fr", ".arw", ".cr2", ".cr3", ".dng", ".erf", ".iiq", ".kdc", ".mef", ".mrw", ".nef", ".nrw", ".orf", ".pef"}
    | {".raf", ".rw2", ".sr2", ".srf", ".srw", ".x3f"}
)
"""Endings of RAW files, lower case."""


def decode_raw(path: Path, *, half: bool = False) -> Array:
    """Decode a RAW file to linear light in the sensor's own colours.

    The black level is taken off and the white level becomes full scale; there is no tone curve, no white balance, no
    brightening, no denoising and no turning by the camera's attitude. Colours are interpolated (adaptive homogeneity),
    or, with `half`, each square of four photosites becomes one pixel, which invents nothing and is four times as fast.
    Not for pictures to look at.

    Parameters
    ----------
    path : Path
        The file.
    half : bool
        Whether four photosites make one pixel.

    Returns
    -------
    uint16 array (h, w, 3)
        R, G, B; 65535 is the sensor's white level.

    Raises
    ------
    OptionError
        If rawpy is not installed.
    MissingFileError
        If the file is not there.
    UnreadableFileError
        If it is damaged or from a camera that LibRaw does not know.
    """
    rawpy = _library(path)
    if not path.is_file():
        raise MissingFileError(
            given=f"The file {path} does not exist.",
            needed="Every file that is listed or named must be there.",
            remedy="Check its name and folder; an image taken out of a list takes its light with it.",
        )
    try:
        with rawpy.imread(str(path)) as raw:
            image = raw.postprocess(
                half_size=half,
                demosaic_algorithm=rawpy.DemosaicAlgorithm.AHD,
                output_color=rawpy.ColorSpace.raw,
                output_bps=16,
                gamma=(1, 1),
                user_wb=[1.0, 1.0, 1.0, 1.0],
                use_camera_wb=False,
                use_auto_wb=False,
                no_auto_bright=True,
                bright=1.0,
                adjust_maximum_thr=0.0,  # the white level of the file, not the largest value of the picture
                highlight_mode=rawpy.HighlightMode.Clip,
                user_flip=0,
            )
    except (rawpy.LibRawError, ValueError, OSError) as error:
        raise UnreadableFileError(
            given=f"The RAW file {path} cannot be decoded ({_words(error)}).",
            needed="A whole file of a camera that LibRaw knows.",
            remedy="Copy it again from its source, or convert it to DNG or to linear TIFF of 16 bits.",
        ) from None
    return np.asarray(image, np.uint16)


def _library(path: Path) -> Any:
    try:
        import rawpy
    except ImportError:
        raise OptionError(
            given=f"{path.name} is a RAW file, and rawpy, which decodes it, is not installed.",
            needed="The extra raw.",
            remedy="Install the package rawpy, or psstereo with its extra 'raw'; or convert to linear TIFF of 16 bits.",
        ) from None
    return rawpy


def _words(error: Exception) -> str:
    """Return LibRaw's message, which comes as bytes."""
    first = error.args[0] if error.args else type(error).__name__
    return first.decode(errors="replace") if isinstance(first, bytes) else str(first)
