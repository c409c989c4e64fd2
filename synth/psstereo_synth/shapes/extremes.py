"""Bounds that hold for the heights of smooth surfaces over a square."""

from collections.abc import Callable

import numpy as np

from psstereo.types import FloatArray

__all__ = ["smooth_bounds"]

_SHARE = 0.01
"""The margin aimed at, as a share of the range of heights [1]."""
_MOST = 2049
"""Samples along a side at which the margin is taken as it is."""


def smooth_bounds(
    heights: Callable[[FloatArray], FloatArray], half_width: float, curvature: float
) -> tuple[float, float]:
    """Return heights below and above which a smooth surface over a square never is.

    Where a surface is highest its slope is zero, along the edge at least if it is there. Half a diagonal d of a cell of
    samples away it is lower by no more than curvature · d² / 2, which is the margin added on either side.

    Parameters
    ----------
    heights : function
        Takes places (n,) along one axis and returns heights (n, n) over the grid of them [length].
    half_width : float
        Half the side of the square [length].
    curvature : float
        A bound on the norm of the matrix of second derivatives [1 / length].

    Returns
    -------
    lowest, highest : float
        Bounds, mostly within a hundredth of the range of heights [length].
    """
    count = 129
    while True:
        z = heights(np.linspace(-half_width, half_width, count))
        low, high = float(z.min()), float(z.max())
        step = 2.0 * half_width / (count - 1)
        margin = 0.25 * curvature * step * step
        if margin <= _SHARE * (high - low) or count >= _MOST:
            return low - margin, high + margin
        count = 2 * count - 1
