"""Disparity maps: what is kept of the matcher's labels, and why the rest is not."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from psstereo.matching.flags import MatchFlag
from psstereo.results import Step
from psstereo.types import BoolArray, FlagArray, FloatArray

__all__ = ["Disparity", "agree", "fill_from_behind", "hidden", "without_specks"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Disparity:
    """What a rectified pair gives: the point at column x of the left image is at x − disparity of the right one.

    Attributes
    ----------
    disparity : float32 array (h, w)
        Of the left image; NaN where there is no match, unless it was filled and flagged so [px].
    confidence : float32 array (h, w)
        1 − cost of the match over that of the best other label: 0 is a guess [1].
    flags : uint16 array (h, w)
        Bits of :class:`~psstereo.matching.flags.MatchFlag`.
    gain, offset : float
        By which the right image was brought to the left one's exposure [1, share of full scale].
    facts : mapping
        Plain figures for the record.
    steps : tuple of Step
        What was done and what was left out.
    """

    disparity: FloatArray
    confidence: FloatArray
    flags: FlagArray
    gain: float = 1.0
    offset: float = 0.0
    facts: Mapping[str, Any] = field(default_factory=dict)
    steps: tuple[Step, ...] = ()

    @property
    def matched(self) -> BoolArray:
        """Where a value was matched, not filled."""
        return np.asarray(np.isfinite(self.disparity) & ((self.flags & np.uint16(MatchFlag.FILLED)) == 0))

    def depth(self, focal: float, baseline: float, *, shift: float = 0.0) -> FloatArray:
        """Return distances along the optical axis, focal · baseline / (disparity + shift).

        Parameters
        ----------
        focal : float
            Focal length of both images [px].
        baseline : float
            Distance of the cameras [length].
        shift : float
            Column of the right principal point minus that of the left one, ``doffs`` of Middlebury's files [px].

        Returns
        -------
        float64 array (h, w)
            Depth; NaN where nothing is known or the rays do not meet in front of the cameras [length].
        """
        total = np.asarray(self.disparity, np.float64) + shift
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(total > 0, focal * baseline / total, np.nan)


def agree(disparity: FloatArray, other: FloatArray, tolerance: float) -> BoolArray:
    """Return where the right view's disparity at the match, or at the pixel to either side of it, says the same.

    On a slope the two views' pixels do not coincide, and their disparities differ by as much as it rises in a pixel.

    Parameters
    ----------
    disparity, other : float array (h, w)
        Of the left and of the right view, NaN where unknown [px].
    tolerance : float
        Largest difference [px].

    Returns
    -------
    bool array (h, w)
        False where either is unknown.
    """
    height, width = disparity.shape
    known = np.isfinite(disparity)
    columns = np.arange(width, dtype=np.float32)
    target = np.rint(columns - np.where(known, disparity, 0.0)).astype(np.int32)
    starts = (np.arange(height, dtype=np.int32) * width)[:, None]
    same = np.zeros(disparity.shape, np.bool_)
    for aside in (-1, 0, 1):
        at = target + np.int32(aside)
        inside = known & (at >= 0) & (at < width)
        found = np.take(other, np.where(inside, starts + at, 0))
        with np.errstate(invalid="ignore"):
            same |= inside & (np.abs(found - disparity) <= tolerance)
    return same


def hidden(other: FloatArray) -> BoolArray:
    """Return pixels of the left view to which no pixel of the right view leads: what is there, the right does not see.

    Parameters
    ----------
    other : float array (h, w)
        Disparity of the right view, NaN where unknown [px].

    Returns
    -------
    bool array (h, w)
        True where hidden. A gap of one column between neighbouring hits is sampling, and not hidden.
    """
    height, width = other.shape
    known = np.isfinite(other)
    target = np.rint(np.arange(width) + np.where(known, other, 0.0)).astype(np.intp)
    hit = known & (target >= 0) & (target < width)
    rows = np.broadcast_to(np.arange(height)[:, None], other.shape)
    reached = np.zeros((height, width + 2), np.bool_)
    reached[rows[hit], target[hit] + 1] = True
    between = reached[:, :-2] & reached[:, 2:]
    return np.asarray(~(reached[:, 1:-1] | between))


def without_specks(disparity: FloatArray, size: int, step: float) -> BoolArray:
    """Return where values belong to patches of more than `size` pixels, whose neighbours differ by at most `step`.

    Parameters
    ----------
    disparity : float array (h, w)
        NaN where unknown [px].
    size : int
        Largest patch that is left out; 0 keeps everything [px].
    step : float
        Largest difference of neighbours in a patch [px].

    Returns
    -------
    bool array (h, w)
        False where nothing is known too.
    """
    import cv2

    known = np.isfinite(disparity)
    if size == 0 or not known.any():
        return known
    # OpenCV does this with whole numbers of 16 bits: sixteenths of a pixel, or coarser if they would not fit.
    low, high = float(np.nanmin(disparity)), float(np.nanmax(disparity))
    unit = min(16.0, 32000.0 / max(high - low, 1e-9))
    coded = np.where(known, np.rint((np.where(known, disparity, low) - low) * unit), -1).astype(np.int16)
    cv2.filterSpeckles(coded, -1, size, step * unit)
    return np.asarray(coded >= 0)


def fill_from_behind(disparity: FloatArray) -> FloatArray:
    """Return disparities whose gaps are filled along rows with the smaller neighbour: what is hidden lies behind.

    Parameters
    ----------
    disparity : float array (h, w)
        NaN where unknown [px].

    Returns
    -------
    float array (h, w)
        Rows that know nothing stay NaN [px].
    """
    width = disparity.shape[1]
    columns = np.broadcast_to(np.arange(width), disparity.shape)
    known = np.isfinite(disparity)
    before = np.maximum.accumulate(np.where(known, columns, -1), axis=1)
    behind = np.minimum.accumulate(np.where(known, columns, width)[:, ::-1], axis=1)[:, ::-1]
    rows = np.arange(len(disparity))[:, None]
    left = np.where(before >= 0, disparity[rows, np.maximum(before, 0)], np.nan)
    right = np.where(behind < width, disparity[rows, np.minimum(behind, width - 1)], np.nan)
    return np.where(known, disparity, np.fmin(left, right))
