"""How far disparities are from the truth."""

import numpy as np

from psstereo.errors import InputError
from psstereo.matching.disparity import fill_from_behind
from psstereo.types import BoolArray, FloatArray

__all__ = ["disparity_score", "visible_in_right"]

_LIMITS = (0.5, 1.0, 2.0, 4.0)
_NEARER = 1.0
"""Disparity by which something else must be nearer to hide a point [px]."""


def disparity_score(disparity: FloatArray, truth: FloatArray, visible: BoolArray) -> dict[str, float]:
    """Score a disparity map as Middlebury does: the share of pixels that are off by more than a limit.

    Parameters
    ----------
    disparity : float array (h, w)
        What was found, NaN where nothing was [px].
    truth : float array (h, w)
        NaN where unknown [px].
    visible : bool array (h, w)
        Points that the other view sees too; only these count.

    Returns
    -------
    dict
        ``bad-0.5`` to ``bad-4`` with what is missing counted as bad, the same with gaps filled from behind as
        ``bad-1 filled`` and so on [%]; ``missing`` [%]; ``median`` and ``rms`` of the errors of what was found [px].

    Raises
    ------
    InputError
        If shapes disagree, or there is nothing to score.
    """
    counted = visible & np.isfinite(truth) if disparity.shape == truth.shape == visible.shape else None
    if counted is None or not counted.any():
        raise InputError(
            given=f"Disparities {disparity.shape}, truth {truth.shape}, visible points {visible.shape}.",
            needed="The same pixels, with some truth that both views see.",
            remedy="Score against the truth of the same view.",
        )
    error = np.abs(disparity - truth)[counted]
    filled = np.abs(fill_from_behind(disparity) - truth)[counted]
    found = error[np.isfinite(error)]
    score = {f"bad-{limit:g}": 100 * float((~(error <= limit)).mean()) for limit in _LIMITS}
    score |= {f"bad-{limit:g} filled": 100 * float((~(filled <= limit)).mean()) for limit in _LIMITS}
    score["missing"] = 100 * float(np.isnan(error).mean())
    score["median"] = float(np.median(found)) if found.size else float("nan")
    score["rms"] = float(np.sqrt((found**2).mean())) if found.size else float("nan")
    return score


def visible_in_right(truth: FloatArray) -> BoolArray:
    """Return which points of the left view the right one sees, told from the left view's true disparity alone.

    Parameters
    ----------
    truth : float array (h, w)
        NaN where unknown [px].

    Returns
    -------
    bool array (h, w)
        False where unknown, outside the right image, or where a point at least a pixel of disparity nearer falls into
        the same pixel.
    """
    height, width = truth.shape
    known = np.isfinite(truth)
    column = np.arange(width) - np.where(known, truth, 0.0)
    rows = np.broadcast_to(np.arange(height)[:, None], truth.shape)
    nearest = np.full(truth.shape, -np.inf)
    for target in (np.floor(column), np.ceil(column)):
        hit = known & (target >= 0) & (target < width)
        np.maximum.at(nearest, (rows[hit], target[hit].astype(np.intp)), truth[hit])
    at = np.rint(column)
    inside = known & (at >= 0) & (at < width)
    with np.errstate(invalid="ignore"):
        return np.asarray(inside & (nearest[rows, np.clip(at, 0, width - 1).astype(np.intp)] <= truth + _NEARER))
