"""Differences between neighbouring pixels of one surface: central inside, one-sided at its borders.

Labels say what belongs together: pixels of the same positive label are neighbours, all others are not, so that no
difference reaches across a gap, a mask's border or a jump of the depth.

    right = Differences(labels, axis=1)
    slope_across, other_across = right(height), right(other)
"""

import numpy as np

from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Differences"]


class Differences:
    """Derivatives along one axis of an image, for any number of maps on the same pixels.

    Central where both neighbours are there. With one neighbour, the difference to that; with `three_points` and a
    second pixel behind it, the one-sided difference of second order, exact on parabolas like the central one, but with
    3.6 times its noise. NaN without any neighbour.

    Parameters
    ----------
    labels : int array (h, w)
        Which surface a pixel belongs to; 0 for none.
    axis : int
        0 for derivatives down the rows, 1 for derivatives to the right.
    three_points : bool
        Whether borders are served to second order too.
    """

    def __init__(self, labels: IntArray, *, axis: int, three_points: bool = False) -> None:
        self._axis = axis
        own = labels if axis == 0 else labels.T
        self._joined: BoolArray = (own[1:] == own[:-1]) & (own[1:] > 0)
        ahead, behind = np.zeros(own.shape, np.bool_), np.zeros(own.shape, np.bool_)
        ahead[:-1], behind[1:] = self._joined, self._joined
        both = 0.5 * (ahead & behind)
        self._ahead = np.where(both > 0, both, ahead)[:-1]
        self._behind = np.where(both > 0, both, behind)[1:]
        self._alone = ~(ahead | behind)
        self._ends = (self._far(ahead & ~behind, 1), self._far(behind & ~ahead, -1)) if three_points else ()

    def _far(self, single: BoolArray, sense: int) -> tuple[IntArray, IntArray, int]:
        """Return the pixels with a neighbour on one side only and another pixel behind that."""
        row, column = np.nonzero(single)
        step = row + 1 if sense > 0 else row - 2
        fine = (step >= 0) & (step < len(self._joined))
        row, column, step = row[fine], column[fine], step[fine]
        joined = self._joined[step, column]
        return row[joined], column[joined], sense

    def __call__(self, values: FloatArray) -> FloatArray:
        """Return the derivative of a map.

        Parameters
        ----------
        values : float array (h, w)
            The map; read only where labels are positive.

        Returns
        -------
        float64 array (h, w)
            Derivative for a step of one pixel; NaN without a neighbour [unit of the values].
        """
        own = values if self._axis == 0 else values.T
        out = np.zeros(own.shape) if self._axis == 0 else np.zeros(own.shape[::-1]).T
        steps = np.subtract(own[1:], own[:-1], where=self._joined, out=np.zeros_like(out[1:]))
        np.multiply(steps, self._ahead, out=out[:-1])
        out[1:] += steps * self._behind
        for row, column, sense in self._ends:
            near, far = (row, row + 1) if sense > 0 else (row - 1, row - 2)
            out[row, column] = 1.5 * steps[near, column] - 0.5 * steps[far, column]
        out[self._alone] = np.nan
        return out if self._axis == 0 else out.T
