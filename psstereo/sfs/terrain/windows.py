"""Overlapping windows of a large grid, and how their answers are blended without seams."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from psstereo.sfs.terrain.system import MARGIN
from psstereo.types import FloatArray

__all__ = ["Window", "windows"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Window:
    """One window.

    Attributes
    ----------
    rows, columns : slice
        The window with its margin, in the grid.
    inner : (slice, slice)
        The window proper in that, whose heights may change.
    blend : (float64 array, float64 array)
        Weights along rows and columns of the window with its margin: their products add up to 1 over all windows.
    """

    rows: slice
    columns: slice
    inner: tuple[slice, slice]
    blend: tuple[FloatArray, FloatArray]

    @property
    def proper(self) -> tuple[slice, slice]:
        """The window proper, in the grid."""
        down, across = self.inner
        return (
            slice(self.rows.start + down.start, self.rows.start + down.stop),
            slice(self.columns.start + across.start, self.columns.start + across.stop),
        )


def windows(shape: tuple[int, int], block: tuple[int, int], tile: int | None, overlap: int) -> list[Window]:
    """Return windows that cover a grid; their corners are corners of blocks.

    Neighbouring windows share twice `overlap` pixels, over which the weight goes from one to the other.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the grid [px].
    block : (int, int)
        Rows and columns of a block [px].
    tile : int or None
        Side of what a window is responsible for, its overlap aside; None for one window over everything [px].
    overlap : int
        How far a window reaches beyond that [px].
    """
    down, across = (
        _along(size, side, size if tile is None else tile, overlap) for size, side in zip(shape, block, strict=True)
    )
    return [
        Window(rows=one[0], columns=other[0], inner=(one[1], other[1]), blend=(one[2], other[2]))
        for one in down
        for other in across
    ]


def _along(size: int, block: int, tile: int, overlap: int) -> list[tuple[slice, slice, FloatArray]]:
    """Return windows with margin, windows proper in them, and weights, along one axis."""
    reach = -(-overlap // block) * block
    pace = max(-(-tile // block) * block, 2 * reach)
    # A short rest at the end joins its neighbour: no tile is narrower than the ramps at its sides.
    count = max(size // pace, 1)
    edges = [pace * i for i in range(count)] + [size]
    found: list[tuple[slice, slice, FloatArray]] = []
    for first, last in pairwise(edges):
        start, stop = max(first - reach, 0), min(last + reach, size)
        low, high = max(start - MARGIN, 0), min(stop + MARGIN, size)
        place = np.arange(low, high) + 0.5
        weight = np.ones(high - low)
        if first > 0:
            weight *= np.clip((place - (first - reach)) / (2 * reach), 0.0, 1.0) if reach else place > first
        if last < size:
            weight *= np.clip(((last + reach) - place) / (2 * reach), 0.0, 1.0) if reach else place < last
        found.append((slice(low, high), slice(start - low, stop - low), weight))
    return found
