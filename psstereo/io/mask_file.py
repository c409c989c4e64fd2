"""Masks from image files: hard, soft-edged, of three channels, or in an alpha channel."""

from pathlib import Path

import numpy as np

from psstereo.errors import InputError
from psstereo.stack.decode import decode_image
from psstereo.types import BoolArray

__all__ = ["read_mask"]


def read_mask(path: Path, shape: tuple[int, int] | None = None) -> BoolArray:
    """Read a mask: the object is what is brighter than half of the brightest value.

    Parameters
    ----------
    path : Path
        Image file. Of several channels the brightest counts; an alpha channel that is not constant is the mask itself.
    shape : (int, int), optional
        Rows and columns that it must have.

    Returns
    -------
    bool array (h, w)
        True on the object.

    Raises
    ------
    InputError
        If it has another size, or marks nothing.
    MissingFileError, UnreadableFileError
        If the file is not there or damaged.
    """
    image = decode_image(path)
    if image.ndim == 3:
        colours = 3 if image.shape[2] >= 3 else 1
        alpha = image[..., -1]
        is_mask = image.shape[2] > colours and alpha.min() != alpha.max()
        image = alpha if is_mask else image[..., :colours].max(axis=2)
    if shape is not None and image.shape != shape:
        raise InputError(
            given=f"The mask {path.name} is {image.shape[1]} × {image.shape[0]} pixels.",
            needed=f"It must have the size of the images, {shape[1]} × {shape[0]}.",
            remedy="Use the mask that belongs to these images, or leave it out with --mask none.",
        )
    top = np.nanmax(image) if image.size else 0
    mask = np.asarray(image > top * 0.5)
    if not mask.any():
        raise InputError(
            given=f"The mask {path.name} is empty: no pixel is brighter than black.",
            needed="The object must be white in it.",
            remedy="Paint the object white, or leave the mask out with --mask none.",
        )
    return mask
