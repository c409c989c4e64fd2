"""What a coarse elevation says: the mean height over each of its cells."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Tie", "block_means", "block_sums"]


def block_sums(field: FloatArray, block: tuple[int, int]) -> FloatArray:
    """Return sums over blocks of pixels, the last ones cut off by the border, float64 (⌈h / b⌉, ⌈w / b'⌉)."""
    down, across = block
    short = -field.shape[0] % down, -field.shape[1] % across
    whole = np.pad(field, ((0, short[0]), (0, short[1]))) if any(short) else field
    rows, columns = whole.shape[0] // down, whole.shape[1] // across
    return np.asarray(whole.reshape(rows, down, columns, across).sum(axis=(1, 3)))


def block_means(field: FloatArray, block: tuple[int, int]) -> FloatArray:
    """Return means over blocks of pixels; NaN where a pixel of the block is NaN or outside."""
    down, across = block
    sums = block_sums(field, block)
    whole = sums / (down * across)
    whole[field.shape[0] // down :] = np.nan
    whole[:, field.shape[1] // across :] = np.nan
    return np.asarray(whole)


@dataclass(frozen=True, kw_only=True, eq=False)
class Tie:
    """Σ over blocks of weight · (mean height of the block − target)².

    Attributes
    ----------
    block : (int, int)
        Rows and columns of a block [px].
    shape : (int, int)
        Rows and columns of the grid [px].
    target : float64 array (hb, wb)
        Mean heights; 0 where there is none [length].
    weight : float64 array (hb, wb)
        Weights; 0 where there is no target [length⁻²].
    valid : bool array (h, w), optional
        Pixels that a mean is taken over; all if left out.
    """

    block: tuple[int, int]
    shape: tuple[int, int]
    target: FloatArray
    weight: FloatArray
    valid: BoolArray | None = None

    @cached_property
    def present(self) -> FloatArray:
        """Pixels of each block's mean."""
        valid = np.ones(self.shape) if self.valid is None else self.valid.astype(np.float64)
        return block_sums(valid, self.block)

    @cached_property
    def counts(self) -> FloatArray:
        """The same, at least 1, to divide by."""
        return np.maximum(self.present, 1.0)

    def means(self, heights: FloatArray) -> FloatArray:
        """Return the mean heights of the blocks."""
        held = heights if self.valid is None else np.where(self.valid, heights, 0.0)
        return block_sums(held, self.block) / self.counts

    def back(self, blocks: FloatArray) -> FloatArray:
        """Return the transposed means: each block's value over its count, on each of its pixels."""
        spread = np.repeat(np.repeat(blocks / self.counts, self.block[0], axis=0), self.block[1], axis=1)
        spread = spread[: self.shape[0], : self.shape[1]]
        return spread if self.valid is None else np.where(self.valid, spread, 0.0)

    def pull(self, heights: FloatArray) -> FloatArray:
        """Return half the downhill gradient of the energy at heights, float64 (h, w)."""
        return self.back(self.weight * (self.target - self.means(heights)))

    def product(self, change: FloatArray) -> FloatArray:
        """Return half the energy's matrix times a change of heights, float64 (h, w)."""
        return self.back(self.weight * self.means(change))

    def window(self, rows: slice, columns: slice) -> "Tie":
        """Return the tie of a window whose corners are corners of blocks, or the end of the grid."""
        low = rows.start // self.block[0], columns.start // self.block[1]
        shape = rows.stop - rows.start, columns.stop - columns.start
        high = tuple(first + -(-size // side) for first, size, side in zip(low, shape, self.block, strict=True))
        part = np.s_[low[0] : high[0], low[1] : high[1]]
        return Tie(
            block=self.block,
            shape=shape,
            target=self.target[part],
            weight=self.weight[part],
            valid=None if self.valid is None else self.valid[rows, columns],
        )

    def coarser(self, factor: int) -> "Tie":
        """Return the tie on a grid of cells `factor` times as large, whose terms count `factor`² times less."""
        weight = np.where(self.counts == self.block[0] * self.block[1], self.weight, 0.0) / factor**2
        return Tie(
            block=(self.block[0] // factor, self.block[1] // factor),
            shape=(self.shape[0] // factor, self.shape[1] // factor),
            target=self.target,
            weight=weight,
        )

    def box(self, rows: FloatArray, columns: FloatArray) -> FloatArray:
        """Return the mean weight a pixel that plane waves feel: |transform of the block|² · weight / pixels."""
        response = _box(rows, self.block[0]) * _box(columns, self.block[1])
        return np.asarray(float(self.weight.mean()) / (self.block[0] * self.block[1]) * response * response)


def _box(wave: FloatArray, count: int) -> FloatArray:
    """Return the mean of exp(i k n) over `count` nodes, its modulus."""
    steps: IntArray = np.arange(count)
    return np.asarray(np.abs(np.exp(1j * wave[..., None] * steps).mean(axis=-1)))
