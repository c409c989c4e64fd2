"""Pieces of the frames, kept while they are decoded, and the shifts between them.

With three or four lights no fit tells what an image should show. But albedo is the same in all images: in the logarithm
it is a term that no light changes, and shading, which varies slowly, is taken off by a high pass. What is left is laid
over the same of the other images by phase correlation, piece by piece, and pieces must agree.
"""

import numpy as np

from psstereo.errors import InputError
from psstereo.plan.diagnosis.shifts import Shifts
from psstereo.types import Array, FloatArray

__all__ = ["MotionProbe"]

_SIDE = 192
"""Rows and columns that are kept of each frame, at most [px]."""
_PIECE = 64
"""Rows and columns of a piece [px]."""
_SMOOTH = 3.0
"""Width of the smoothing that is taken off [px]."""
_LEAST = 0.12
"""Response of the correlation below which a piece has too little detail [1]."""
_PIECES = 3
"""Pieces that must have an opinion."""
_WIDE = 2.0
"""Width of the smoothing before details are compared [px]."""
_COMMON = 0.3
"""Correlation of the images' details below which they are shading rather than albedo [1]."""
_ALL = 6
"""Images up to which all pairs are compared."""
_FURTHEST = 8.0
"""Shifts beyond this are taken for a wrong match [px]."""


class MotionProbe:
    """Keeps a small central piece of each frame.

    Parameters
    ----------
    images : int
        How many frames will come.
    centre : (int, int)
        Row and column of the middle of the object [px].

    Raises
    ------
    InputError
        If there is no image.
    """

    def __init__(self, images: int, centre: tuple[int, int]) -> None:
        if images < 1:
            raise InputError(given=f"{images} images.", needed="At least one image.", remedy="Give a capture.")
        self._centre = centre
        self._crops: list[FloatArray | None] = [None] * images

    def feed(self, frame: Array, index: int) -> None:
        """Keep a piece of a frame (h, w, c) or (h, w), gray; safe from several threads for different images.

        Raises
        ------
        InputError
            If there is no image of this number.
        """
        if not 0 <= index < len(self._crops):
            raise InputError(
                given=f"Image {index} of {len(self._crops)}.",
                needed="A number from 0 to one less than the images.",
                remedy="Say how many images there are when the probe is made.",
            )
        cut = []
        for size, middle in zip(frame.shape[:2], self._centre, strict=True):
            first = min(max(middle - _SIDE // 2, 0), max(size - _SIDE, 0))
            cut.append(slice(first, first + _SIDE))
        piece = np.asarray(frame[cut[0], cut[1]], np.float32)
        self._crops[index] = piece.mean(axis=2) if piece.ndim == 3 else piece

    def shifts(self) -> Shifts | None:
        """Return the shifts of all images against their mean.

        Returns
        -------
        Shifts or None
            None if a frame is missing, or there is too little detail. `share` is the share of pieces of images that
            had an opinion.
        """
        crops = [crop for crop in self._crops if crop is not None]
        if len(crops) < len(self._crops) or len(crops) < 2 or min(crops[0].shape) < _PIECE:
            return None
        details = [_detail(crop) for crop in crops]
        if _common(details) < _COMMON:
            return None
        pairs = _pairs(len(crops))
        rows, right, scatters, told = [], [], [], 0
        for one, other in pairs:
            found = _offsets(details[one], details[other])
            told += len(found)
            if len(found) < _PIECES:
                continue
            middle = np.median(found, axis=0)
            scatters.append(1.4826 * float(np.hypot(*np.median(np.abs(found - middle), axis=0))) / np.sqrt(len(found)))
            row = np.zeros(len(crops))
            row[[other, one]] = 1, -1
            rows.append(row)
            right.append(middle)
        matrix = np.array(rows).reshape(-1, len(crops))
        if np.linalg.matrix_rank(matrix) < len(crops) - 1:
            return None  # an image hangs together with no other
        size = np.linalg.lstsq(matrix, np.array(right), rcond=None)[0]  # of least norm, so of mean zero
        share = told / (len(pairs) * len(_pieces(details[0].shape)))
        return Shifts(size=size, error=float(np.sqrt(np.mean(np.square(scatters)))), share=share)


def _common(details: list[FloatArray]) -> float:
    """Return the mean correlation of the images' details: shading is another one under each light, albedo is not."""
    import cv2

    wide = [cv2.GaussianBlur(one, (0, 0), _WIDE) for one in details]  # so that shifts do not matter much
    own = float(sum((one * one).sum() for one in wide))
    whole = np.sum(wide, axis=0)
    return (float((whole * whole).sum()) - own) / ((len(details) - 1) * own) if own > 0 else 0.0


def _pairs(count: int) -> list[tuple[int, int]]:
    """Return pairs of images that are laid over each other: all if they are few, else each with three others."""
    if count <= _ALL:
        return [(i, j) for i in range(count) for j in range(i + 1, count)]
    return [(i, (i + step) % count) for step in (1, 2, count // 2) for i in range(count)]


def _detail(crop: FloatArray) -> FloatArray:
    """Return the high-passed logarithm, held within bounds so that edges of shadows do not outweigh the rest."""
    import cv2

    floor = max(0.02 * float(np.quantile(crop, 0.95)), float(np.finfo(np.float32).tiny))
    level = np.log(np.maximum(crop, 0) + floor).astype(np.float32)
    high = level - cv2.GaussianBlur(level, (0, 0), _SMOOTH)
    bound = 3 * max(float(np.median(np.abs(high))), 1e-6)
    return np.asarray(np.clip(high, -bound, bound) / bound, np.float32)


def _pieces(shape: tuple[int, ...]) -> list[tuple[slice, slice]]:
    starts = [range(0, size - _PIECE + 1, _PIECE // 2) for size in shape[:2]]
    return [(slice(r, r + _PIECE), slice(c, c + _PIECE)) for r in starts[0] for c in starts[1]]


def _offsets(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return shifts of pieces of the second against the first, to the right and up, (k, 2)."""
    import cv2

    window = cv2.createHanningWindow((_PIECE, _PIECE), cv2.CV_32F)
    found = []
    for rows, columns in _pieces(one.shape):
        a, b = np.ascontiguousarray(one[rows, columns]), np.ascontiguousarray(other[rows, columns])
        (right, down), response = cv2.phaseCorrelate(a, b, window)
        if response >= _LEAST and np.hypot(right, down) <= _FURTHEST:
            found.append((right, -down))
    return np.array(found).reshape(-1, 2)
