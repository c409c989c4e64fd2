"""Images in files, decoded when they are read."""

from pathlib import Path
from threading import Lock

import numpy as np

from psstereo.errors import InputError
from psstereo.stack.decode import decode_image
from psstereo.stack.stack import ImageStack, full_scale
from psstereo.types import Array

__all__ = ["FileStack"]


class FileStack(ImageStack):
    """A stack over image files; only the first is decoded on construction, to learn size and type.

    Parameters
    ----------
    paths : sequence of Path
        One file an image, in the order of the lights.
    white : float, optional
        Value that means full scale; from the type if absent. Give 4095 for 12-bit values in 16-bit files.
    half : bool
        Whether four photosites of a RAW file make one pixel: a quarter of the pixels, none of them interpolated.

    Raises
    ------
    InputError
        If there are no files, or (when an image is read) it differs from the first in size, type or channels.
    MissingFileError, UnreadableFileError
        If a file is not there or damaged.
    """

    def __init__(self, paths: tuple[Path, ...], *, white: float | None = None, half: bool = False) -> None:
        if not paths:
            raise InputError(
                given="There are no image files.", needed="A stack needs one image a light.", remedy="Check the folder."
            )
        self.paths = paths
        self.names = tuple(path.name for path in paths)
        self.half = half
        first = self._decode(paths[0])
        # Kept until it is asked for, so that every file is decoded once in a run.
        self._first: Array | None = first
        self._lock = Lock()
        self.shape = (len(paths), first.shape[0], first.shape[1], first.shape[2])
        self.dtype = first.dtype
        self.white = full_scale(first.dtype) if white is None else float(white)
        self.saturates = white is not None or first.dtype.kind == "u"

    def frame(self, index: int) -> Array:
        """Decode one image; see :meth:`ImageStack.frame`."""
        if index == 0:
            with self._lock:
                first, self._first = self._first, None
            if first is not None:
                return first
        path = self.paths[index]
        image = self._decode(path)
        if image.shape != self.shape[1:] or image.dtype != self.dtype:
            raise InputError(
                given=f"{path.name} is {_describe(image)}; {self.names[0]} is {self._describe_first()}.",
                needed="All images of a capture must have one size, one bit depth and the same channels.",
                remedy="Convert or crop them alike, or leave the odd one out together with its light.",
            )
        return image

    def _decode(self, path: Path) -> Array:
        return _colours(decode_image(path, half=True) if self.half else decode_image(path), path)

    def _describe_first(self) -> str:
        return _describe_shape(self.shape[1:], self.dtype)


def _colours(image: Array, path: Path) -> Array:
    """Return the image as (h, w, c) without an alpha channel, or refuse types that images do not have."""
    if image.ndim == 2:
        image = image[..., None]
    if (
        image.ndim != 3
        or image.shape[2] not in (1, 2, 3, 4)
        or image.dtype.kind not in "uf"
        or image.dtype.itemsize > 8
    ):
        raise InputError(
            given=f"{path.name} holds an array of shape {image.shape} and type {image.dtype}.",
            needed="An image has one or three channels of 8 or 16 bit integers or of floats.",
            remedy="Convert it to PNG, TIFF or EXR.",
        )
    if not image.dtype.isnative:
        image = image.astype(image.dtype.newbyteorder("="))
    if image.dtype not in (np.uint8, np.uint16, np.float32, np.float64):
        image = image.astype(np.float64 if image.dtype.kind == "u" else np.float32)
    return image[..., : 3 if image.shape[2] >= 3 else 1]


def _describe(image: Array) -> str:
    return _describe_shape(image.shape, image.dtype)


def _describe_shape(shape: tuple[int, ...], dtype: np.dtype[np.generic]) -> str:
    kind = f"{dtype.itemsize * 8} bit{' float' if dtype.kind == 'f' else ''}"
    return f"{shape[1]} × {shape[0]} pixels, {shape[2]} channel{'s' if shape[2] > 1 else ''}, {kind}"
