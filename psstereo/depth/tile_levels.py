r"""The coarse grid that joins the tiles: a level of the grid's own multigrid, put together tile by tile.

The hierarchy of :class:`psstereo.depth.grid.GridCycle` is local: the weights of a coarse node depend on the pixels
around it and on nothing else. So a tile with a margin finds, to the last bit, those that the whole image would give,
and the coarse operator of the image is put together from the tiles' middles. The same holds for carrying residuals down
to it and corrections up from it.
"""

from collections.abc import Sequence

import numpy as np

from psstereo.depth.grid import GridCycle
from psstereo.depth.rows import Rows
from psstereo.kernels.multigrid import prolong
from psstereo.types import FloatArray

__all__ = ["CoarseGrid", "TileLevels", "nodes"]

_MOST = 60
"""Iterations on the coarse grid at most: it only steers the iteration on the pixels."""


def nodes(pixels: slice, levels: int) -> slice:
    """Return the coarse rows or columns of some pixels.

    Parameters
    ----------
    pixels : slice
        Rows or columns; the first is a multiple of 2 to the power of `levels`.
    levels : int
        How often every other row and column was left out.

    Returns
    -------
    slice
        Coarse rows or columns.
    """
    return slice(pixels.start >> levels, -(-pixels.stop >> levels))


class TileLevels(GridCycle):
    """The finest levels of the multigrid on a window, to go down to a coarse grid and up again.

    Parameters
    ----------
    right_weight, down_weight, prior_weight, scale, rows, compiled
        See :class:`~psstereo.depth.grid.GridCycle`.
    depth : int
        The coarse level that is meant.
    """

    def __init__(
        self,
        right_weight: FloatArray,
        down_weight: FloatArray,
        prior_weight: FloatArray,
        *,
        scale: float,
        rows: Rows,
        compiled: bool,
        depth: int,
    ) -> None:
        super().__init__(right_weight, down_weight, prior_weight, scale=scale, rows=rows, compiled=compiled)
        # An image smaller than a coarse cell is a single node sooner, and stays one.
        self._depth = min(depth, self.levels - 1)

    def stencil(self) -> tuple[FloatArray, ...]:
        """Return the coarse weights: east, south, southeast, southwest, and the prior's, of size 0 if there is none."""
        return tuple(part[1:-2, 1:-2] if part.size else part for part in self._levels[self._depth].stencil)

    def down(self, residual: FloatArray) -> FloatArray:
        """Return a residual on the coarse grid, by the transpose of the interpolation; float (h, w) to float32."""
        self.right_side[1:-2, 1:-2] = residual
        for k in range(self._depth):
            level, following = self._levels[k], self._levels[k + 1]
            # Of a value of zero: the residual is then the right side itself.
            part = (*level.stencil, level.shares, level.value, level.right_side, following.right_side)
            self._rows(self._pass["restrict_residual"], part, 1, following.height + 1, 2 * level.width)
        return self._levels[self._depth].right_side[1:-2, 1:-2]

    def up(self, coarse: FloatArray) -> FloatArray:
        """Return coarse values interpolated to the pixels; float (H, W) to float32 (h, w)."""
        values: FloatArray = np.zeros((coarse.shape[0] + 3, coarse.shape[1] + 3), np.float32)
        values[1:-2, 1:-2] = coarse
        for k in range(self._depth - 1, -1, -1):
            level = self._levels[k]
            values = prolong(level.shares, values, (level.height + 3, level.width + 3))
        return values[1:-2, 1:-2]


class CoarseGrid(GridCycle):
    """The coarse problem of the whole image in memory: conjugate gradients with the multigrid's further levels.

    Parameters
    ----------
    stencil : sequence of float32 arrays (H + 3, W + 3)
        Weights east, south, southeast, southwest, and the prior's, of size 0 if there is none; padded.
    rows : Rows
        How passes are run.
    compiled : bool
        Whether to use the compiled loops.
    """

    def __init__(self, stencil: Sequence[FloatArray], *, rows: Rows, compiled: bool) -> None:
        east, south, southeast, southwest, prior = stencil
        none = np.zeros((0, 0))
        height, width = east.shape[0] - 3, east.shape[1] - 3
        # The smoother's coefficients and the passes are set up by the parent, on the smallest grid there is.
        super().__init__(np.zeros((1, 0)), np.zeros((0, 1)), none, scale=1.0, rows=rows, compiled=compiled)
        self._levels = [self._level(height, width, (east, south, southeast, southwest, prior))]
        while self._levels[-1].height > 1 or self._levels[-1].width > 1:
            self._levels.append(self._coarser(self._levels[-1]))
        self.sums = np.zeros(height + 3)

    def solve(self, right_side: FloatArray, tolerance: float) -> FloatArray:
        """Solve the coarse equations.

        Parameters
        ----------
        right_side : float64 array (H, W)
            Residual on the coarse grid.
        tolerance : float
            Relative residual wanted, in the norm of the preconditioner [1].

        Returns
        -------
        float64 array (H, W)
            Correction, up to a constant on each component.
        """
        left, values = right_side.copy(), np.zeros_like(right_side)
        update = self._precondition(left)
        direction, energy = update, float(np.sum(left * update))
        target, done = tolerance**2 * energy, 0
        while energy > target and done < _MOST:
            image = self._multiply(direction)
            curvature = float(np.sum(direction * image))
            if not curvature > 0:
                break
            length = energy / curvature
            values += length * direction
            left -= length * image
            update = self._precondition(left)
            following = float(np.sum(left * update))
            direction, energy, done = update + (following / energy) * direction, following, done + 1
        return values

    def _precondition(self, left: FloatArray) -> FloatArray:
        shrink = float(np.abs(left).max(initial=0.0)) or 1.0
        self.right_side[1:-2, 1:-2] = left * (1.0 / shrink)
        self.run()
        return np.asarray(self.value[1:-2, 1:-2] * np.float64(shrink))

    def _multiply(self, value: FloatArray) -> FloatArray:
        east, south, southeast, southwest, prior = self._levels[0].stencil
        out = prior[1:-2, 1:-2] * value if prior.size else np.zeros_like(value)
        everything, ahead, behind = slice(None), slice(1, None), slice(None, -1)
        pairs = (
            (east, (everything, behind), (everything, ahead)),
            (south, (behind, everything), (ahead, everything)),
            (southeast, (behind, behind), (ahead, ahead)),
            (southwest, (behind, ahead), (ahead, behind)),
        )
        for weights, start, stop in pairs:
            flow = weights[1:-2, 1:-2][start] * (value[start] - value[stop])
            out[start] += flow
            out[stop] -= flow
        return out
