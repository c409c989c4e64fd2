"""From a cost volume to the best label of each pixel, smoothed along paths."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from psstereo.errors import OptionError
from psstereo.kernels.dispatch import kernel
from psstereo.types import Array, FloatArray, IntArray, Map

__all__ = ["Smoothing", "row_blocks"]

_BREAK_EVEN = 50_000
"""Labels of all pixels from which compiled code is sooner done, loading included [1]."""
_BLOCKS = 4
"""Parts of an image that threads share."""


@dataclass(frozen=True, kw_only=True)
class Smoothing:
    """Penalties for labels that change from a pixel to the next [1]_. All tops of the costs together are 240.

    Attributes
    ----------
    small : int
        For a change by one [cost].
    large : int
        For any larger change, where brightness does not change; above `small` [cost].
    soft : float
        Change of brightness that halves the large penalty, since surfaces end where brightness changes; it never
        falls below twice the small one [standard deviations].
    paths : 4 or 8
        Directions from which costs are gathered; 8 is better, 4 twice as fast.

    Raises
    ------
    OptionError
        If a number is out of range.

    References
    ----------
    .. [1] Hirschmüller, "Stereo processing by semiglobal matching and mutual information", IEEE Transactions on
       Pattern Analysis and Machine Intelligence 30(2), 2008. doi:10.1109/TPAMI.2007.1166
    """

    small: int = 16
    large: int = 128
    soft: float = 2.0
    paths: int = 8

    def __post_init__(self) -> None:
        if not (0 < self.small < self.large <= 10_000 and self.soft > 0 and self.paths in (4, 8)):
            raise OptionError(
                given=f"The penalties are {self.small} and {self.large}, softened at {self.soft}, on {self.paths} "
                "paths.",
                needed="0 < small < large ≤ 10000, a positive change of brightness, and 4 or 8 paths.",
                remedy="Leave them out to get the usual ones.",
            )

    def aggregate(self, cost: Array, right: FloatArray, down: FloatArray, over: Map) -> tuple[Array, Array]:
        """Smooth costs along all paths.

        Parameters
        ----------
        cost : uint8 array (h, w, n)
            Costs of the labels.
        right, down : float32 array (h, w)
            Change of brightness to the next pixel in the row, and to the next row [standard deviations].
        over : map-like
            Executes the two halves of the directions.

        Returns
        -------
        uint16 array (h, w, n), twice
            Sums of path costs from the left and above, and from the right and below.
        """
        halves = (np.zeros(cost.shape, np.uint16), np.zeros(cost.shape, np.uint16))
        run = kernel("matching", "aggregate", cost.size, _BREAK_EVEN)
        ahead = self._penalty(np.roll(right, 1, axis=1)), self._penalty(np.roll(down, 1, axis=0))
        back = self._penalty(right), self._penalty(down)

        def half(forward: bool) -> None:
            across, along = ahead if forward else back
            run(cost, self.small, across, along, forward, self.paths == 8, halves[0] if forward else halves[1])

        list(over(half, (True, False)))
        return halves

    def winners(
        self, halves: tuple[Array, Array], first: int, *, paired: bool, over: Map
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Choose labels; see :func:`psstereo.kernels.matching.winners`.

        Parameters
        ----------
        halves : uint16 array (h, w, n), twice
            From :meth:`aggregate`.
        first : int
            Disparity of the label 0 [px].
        paired : bool
            Whether labels are disparities.
        over : map-like
            Executes blocks of rows.

        Returns
        -------
        label, margin, other : float32 array (h, w)
            Labels of this view, their margins, and whole labels of the other view.
        """
        height, width, _ = halves[0].shape
        label, margin, other = (np.full((height, width), np.nan, np.float32) for _ in range(3))
        run = kernel("matching", "winners", halves[0].size, _BREAK_EVEN)

        def block(rows: tuple[int, int]) -> None:
            run(halves[0], halves[1], first, paired, rows, label, margin, other)

        list(over(block, row_blocks(height)))
        return label, margin, other

    def _penalty(self, change: FloatArray) -> IntArray:
        softened = self.large / (1 + change / self.soft)
        return np.asarray(np.maximum(softened, 2 * self.small)).astype(np.uint16)


def row_blocks(height: int) -> list[tuple[int, int]]:
    """Return first rows and the ones after the last of the parts that threads share."""
    edges = np.linspace(0, height, min(_BLOCKS, height) + 1).round().astype(int)
    return [(int(a), int(b)) for a, b in pairwise(edges)]
