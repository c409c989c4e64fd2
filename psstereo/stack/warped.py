"""Images whose pixels are looked up elsewhere: a lens's distortion undone, frames laid over one another."""

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError
from psstereo.stack.stack import ImageStack
from psstereo.types import Array, BoolArray, FloatArray

__all__ = ["Lookup", "WarpedStack", "checked_affines", "interpolated", "warp_mask"]


class Lookup(Protocol):
    """Says where pixels come from, such as :class:`psstereo.camera.Undistortion`."""

    def lookup(self, shape: tuple[int, int], affine: FloatArray | None = None) -> FloatArray:
        """Return column and row in the photograph, float32 (2, h, w), after an affine move if there is one [px]."""
        ...


class WarpedStack(ImageStack):
    """A stack whose images are moved while they are decoded, by interpolation between the nearest four by four pixels.

    Not on values that are still bent by a tone curve, or saturated, which an interpolation mixes with others: put a
    :class:`psstereo.stack.LinearStack` below it, whose NaN spread to the pixels that would have been mixed with them.
    What comes from outside of the photograph is NaN too.

    Parameters
    ----------
    source : ImageStack
        Images of linear light, floating point.
    lens : Lookup, optional
        A lens to undo.
    affines : float array (m, 2, 3), optional
        One move an image, in undistorted pixels: pixel (x, y, 1), column and row, is looked up at
        ``affine @ (x, y, 1)``.

    Raises
    ------
    InputError
        If the images hold whole numbers, or there is another number of moves, or one is singular or not finite.
    """

    def __init__(self, source: ImageStack, *, lens: Lookup | None = None, affines: npt.ArrayLike | None = None) -> None:
        if source.dtype.kind != "f":
            raise InputError(
                given=f"The images hold {source.dtype} values.",
                needed="Linear light as floating-point numbers, with NaN where it is not known.",
                remedy="Put them into a LinearStack first.",
            )
        self.source, self.lens = source, lens
        self.affines = None if affines is None else checked_affines(affines, len(source))
        self.shape, self.dtype, self.white, self.names = source.shape, source.dtype, source.white, source.names
        self.saturates = False
        self._fixed: FloatArray | None = None

    def frame(self, index: int) -> Array:
        """Move one image; see :meth:`ImageStack.frame`."""
        image = np.ascontiguousarray(self.source.frame(index))
        return np.asarray(interpolated(image, *self._lookup(index)), self.dtype).reshape(self.shape[1:])

    def _lookup(self, index: int) -> FloatArray:
        """Return the columns and rows that pixels come from, float32 (2, h, w) [px]."""
        shape = (self.shape[1], self.shape[2])
        if self.affines is None:  # the same for all images; threads that come here at once find the same
            self._fixed = _lens_or_still(self.lens, shape, None) if self._fixed is None else self._fixed
            return self._fixed
        return _lens_or_still(self.lens, shape, self.affines[index])


def interpolated(image: FloatArray, columns: FloatArray, rows: FloatArray) -> FloatArray:
    """Interpolate at some places: linearly, and then by the second differences for the curvature that this leaves out.

    OpenCV's own cubic shifts what it interpolates by up to 0.05 px (its kernel has the parameter −0.75, with which a
    straight line does not stay one) and its Lanczos kernel rounds places to 1/32 px; this errs by 0.005 px on details
    of 12 px, at the price of the cubic.

    Parameters
    ----------
    image : float array (h, w) or (h, w, c)
        The image; NaN spreads to what would be mixed with it.
    columns, rows : float32 array (a, b)
        Places [px].

    Returns
    -------
    float array (a, b, c)
        Values, NaN outside of the image.
    """
    import cv2

    def at(values: Any) -> FloatArray:
        coarse = np.asarray(values, np.float32)
        found = np.asarray(cv2.remap(coarse, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
        if image.dtype == np.float64:  # of these OpenCV rounds places to 1/32 px, so what float32 leaves comes after
            rest = np.asarray(values - coarse, np.float32)
            more = np.asarray(cv2.remap(rest, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
            found = found.astype(np.float64) + more
        return np.asarray(found, image.dtype).reshape(*columns.shape, -1)

    second, alone = np.array([1.0, -2.0, 1.0]), np.ones(1)
    right, down = columns - np.floor(columns), rows - np.floor(rows)
    found = at(image)
    found -= (0.5 * right * (1.0 - right))[..., None] * at(cv2.sepFilter2D(image, -1, second, alone))
    found -= (0.5 * down * (1.0 - down))[..., None] * at(cv2.sepFilter2D(image, -1, alone, second))
    height, width = image.shape[:2]
    found[(columns < 0) | (columns > width - 1) | (rows < 0) | (rows > height - 1)] = np.nan
    return found


def warp_mask(mask: BoolArray, lens: Lookup) -> BoolArray:
    """Return a mask of a photograph as it lies over the undistorted image.

    Parameters
    ----------
    mask : bool array (h, w)
        The mask.
    lens : Lookup
        What was undone in the images.

    Returns
    -------
    bool array (h, w)
        True where the nearest pixel of the mask is.
    """
    import cv2

    columns, rows = lens.lookup((mask.shape[0], mask.shape[1]))
    moved = cv2.remap(mask.astype(np.uint8), columns, rows, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT)
    return np.asarray(moved > 0)


def checked_affines(affines: npt.ArrayLike, count: int) -> FloatArray:
    """Return moves as a float64 array (m, 2, 3), or refuse what are none."""
    given = np.asarray(affines, np.float64)
    fits = given.shape == (count, 2, 3) and bool(np.isfinite(given).all())
    if not fits or (np.abs(np.linalg.det(given[:, :, :2])) < 0.1).any():
        raise InputError(
            given=f"The moves of the images have the shape {given.shape}{'' if fits else ' or are not finite'}.",
            needed=f"{count} affine maps of two rows and three columns that turn nothing flat.",
            remedy="Register the frames again.",
        )
    return given


def _lens_or_still(lens: Lookup | None, shape: tuple[int, int], affine: FloatArray | None) -> FloatArray:
    """Return where pixels come from through a lens, or without one."""
    if lens is not None:
        return lens.lookup(shape, affine)
    rows, columns = np.indices(shape, dtype=np.float64)
    move = np.eye(2, 3) if affine is None else affine
    along = move[:, 0, None, None] * columns + move[:, 1, None, None] * rows + move[:, 2, None, None]
    return np.ascontiguousarray(along, np.float32)
