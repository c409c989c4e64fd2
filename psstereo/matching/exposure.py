"""Whether two views have the same exposure, and by how much they differ if not."""

from typing import NamedTuple

import numpy as np

from psstereo.errors import InputError
from psstereo.matching.images import ViewImages
from psstereo.results import Step
from psstereo.types import BoolArray, FloatArray

__all__ = ["Exposure", "compare_exposures", "refine_exposure", "require_same_exposure"]

_LEVELS = np.linspace(0.02, 0.98, 49)
"""Shares of the pixels at whose brightness views are compared."""
_ALLOWED = 0.15
"""Difference of brightness between views that their different contents alone can make [share]."""
_ENOUGH = 20_000
"""Pixels that are looked at."""
_ROUNDS = 8
_LEAST = 50
"""Pixels below which no line is fitted."""


class Exposure(NamedTuple):
    """What makes the right view's values those of the left: left ≈ gain · right + offset [1, share of full scale]."""

    gain: float
    offset: float


def compare_exposures(left: ViewImages, right: ViewImages) -> Exposure:
    """Fit gain and offset between the brightness of two views, without knowing which pixels belong together.

    The same scene has about the same share of pixels above any brightness, seen from a little aside. The line through
    these brightnesses is fitted with least absolute deviations.

    Parameters
    ----------
    left, right : ViewImages
        The views.

    Returns
    -------
    Exposure
        A first guess; where one view shows what the other does not, it is off by a few hundredths.
    """
    x, y = _quantiles(right), _quantiles(left)
    gain, offset = _line(x, y)
    if not gain > 0:
        gain, offset = float(np.median(y) / max(float(np.median(x)), 1e-12)), 0.0
    return Exposure(gain, offset)


def refine_exposure(left: ViewImages, right: ViewImages, disparity: FloatArray, sure: BoolArray) -> Exposure:
    """Fit gain and offset at pixels that were matched.

    Parameters
    ----------
    left, right : ViewImages
        The views.
    disparity : float array (h, w)
        Of the left view [px].
    sure : bool array (h, w)
        Where it is believed.

    Returns
    -------
    Exposure
        No change where too few pixels are sure.
    """
    rows, columns = np.nonzero(sure)
    target = np.rint(columns - disparity[rows, columns]).astype(np.intp)
    a, b = left.values[:, :, rows, columns], right.values[:, :, rows, target]
    fine = ~(left.saturated[:, :, rows, columns] | right.saturated[:, :, rows, target])
    if np.count_nonzero(fine) < _LEAST:
        return Exposure(1.0, 0.0)
    gain, offset = _line(np.asarray(b[fine], np.float64), np.asarray(a[fine], np.float64))
    return Exposure(gain, offset) if gain > 0 else Exposure(1.0, 0.0)


def require_same_exposure(left: ViewImages, right: ViewImages) -> Step:
    """Refuse views of which one is clearly brighter all over.

    Parameters
    ----------
    left, right : ViewImages
        The views.

    Returns
    -------
    Step
        What was found.

    Raises
    ------
    InputError
        If gain or offset between them is more than different contents can make.
    """
    x, y = _quantiles(right), _quantiles(left)
    typical = max(float(np.mean(y)), 1e-12)
    ratio = float(np.mean(y)) / max(float(np.mean(x)), 1e-12)
    spread = float(np.mean(np.abs(y - x))) / typical
    if not (1 / (1 + _ALLOWED) < ratio < 1 + _ALLOWED) or spread > 2 * _ALLOWED:
        found = compare_exposures(left, right)
        brighter, times = ("right", 1 / ratio) if ratio < 1 else ("left", ratio)
        raise InputError(
            given=f"The exposures differ: {brighter} is {times:.3g} times as bright as the other view "
            f"({left.name} ≈ {found.gain:.3g} · {right.name} {found.offset:+.3g} of full scale).",
            needed="A matte point has the same value in both views only if both have the same exposure.",
            remedy="Ask for gain and offset to be estimated (exposure = estimate), or give linear values.",
        )
    return Step(
        name="exposure",
        done=True,
        reason=f"The left view is {ratio:.3f} times as bright as the right one: the same exposure.",
    )


def _quantiles(view: ViewImages) -> FloatArray:
    step = max(1, round((view.mask.size / _ENOUGH) ** 0.5))  # a pixel of so many by so many
    mask = view.mask[::step, ::step]
    values = np.asarray(view.values[:, :, ::step, ::step].mean(axis=(0, 1)), np.float64)
    return np.asarray(np.quantile(values[mask] if mask.any() else values, _LEVELS))


def _line(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Fit y = a x + b with least absolute deviations, by reweighting."""
    weight = np.ones_like(x)
    a, b = 1.0, 0.0
    scale = max(float(np.abs(y).max()), 1e-12)
    for _ in range(_ROUNDS):
        total = weight.sum()
        mean_x, mean_y = (weight * x).sum() / total, (weight * y).sum() / total
        spread = (weight * (x - mean_x) ** 2).sum()
        if spread <= 1e-18 * total:
            return float(mean_y / mean_x) if mean_x > 0 else 1.0, 0.0
        a = float((weight * (x - mean_x) * (y - mean_y)).sum() / spread)
        b = float(mean_y - a * mean_x)
        weight = 1 / np.maximum(np.abs(y - a * x - b), 1e-6 * scale)
    return a, b
