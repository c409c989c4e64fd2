"""A frame of what the camera shows without the lights, chosen by a person instead of the capture's own."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from psstereo.capture import Capture
from psstereo.errors import InputError
from psstereo.io.parts import read_dark, read_linear_dark
from psstereo.stack import ImageStack, Response
from psstereo.stack.unmixed import UnmixedStack
from psstereo.types import FloatArray

__all__ = ["checked_dark", "read_frame", "with_ambient"]


def with_ambient(capture: Capture, path: Path) -> Capture:
    """Return the capture with a frame to subtract: dark current, room light, or both.

    The frame is a photograph without any of the lights, of the images' size, channels and type, through the same camera
    response; or floats (``.npy``) that are linear pixel values already. It replaces the capture's own dark image.

    Parameters
    ----------
    capture : Capture
        The photographs.
    path : Path
        The frame.

    Returns
    -------
    Capture
        The same images; the frame is subtracted when they are read.

    Raises
    ------
    InputError
        If size, channels or type differ from those of the images, or values are not finite.
    MissingFileError, UnreadableFileError
        If the file is not there or damaged.
    """
    stack = capture.stack
    if isinstance(stack, UnmixedStack):
        had = stack.dark is not None
        dark = read_frame(path, stack.source, stack.response)
        changed: Capture = replace(
            capture, stack=UnmixedStack(stack.source, stack.mixing, response=stack.response, dark=dark)
        )
    else:
        had = capture.dark is not None
        changed = replace(capture, dark=read_frame(path, stack, capture.response))
    note = f"{path.name} is subtracted{' instead of the dark image that belongs to the capture' if had else ''}."
    return replace(changed, notes=(*capture.notes, note))


def read_frame(path: Path, stack: ImageStack, response: Response) -> FloatArray:
    """Read a frame without the lights as linear pixel values (h, w, c), a photograph or floats."""
    linear = path.suffix.lower() == ".npy" and stack.dtype.kind == "u"
    return checked_dark(read_linear_dark(path, stack) if linear else read_dark(path, stack, response), path)


def checked_dark(dark: FloatArray, path: Path) -> FloatArray:
    """Return a dark image, or refuse one with values that are no numbers: they would spoil those pixels silently."""
    bad = np.count_nonzero(~np.isfinite(dark))
    if bad:
        raise InputError(
            given=f"The dark image {path.name} holds {bad} values that are no finite numbers.",
            needed="A level for every pixel and channel.",
            remedy="Take it again, or put numbers there; a mask leaves pixels out.",
        )
    return dark
