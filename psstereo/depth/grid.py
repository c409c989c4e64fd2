"""A multigrid cycle on the pixel grid itself, as preconditioner for conjugate gradients.

Levels take every other row and column; interpolation follows the weights and the mask, coarse weights are Galerkin
products (:mod:`psstereo.kernels.multigrid_setup`), the smoother is Chebyshev's of degree 2. Cycles run in single
precision: they only steer the iteration, and half the memory moves twice as fast. On discs, rectangles and slanted
surfaces an iteration gains a factor of 20 at any size; cracks of any weight along curves cost two to four times as
many iterations. Mazes, and weights that jump over decades from pixel to pixel, need the algebraic hierarchy
(:mod:`psstereo.depth.multigrid`), which sees the graph but costs ten times as much.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from psstereo.depth.rows import Rows
from psstereo.kernels.dispatch import kernel
from psstereo.types import FloatArray

__all__ = ["COMPILED", "GridCycle"]

COMPILED = 100_000
"""Pixels times solves from which loading the compiled loops pays."""
_SPECTRUM = (0.4, 2.0)
"""Part of the spectrum that the smoother takes care of; the coarser grids do the rest [1]."""
_TINY = 1e-5
"""Rounding of single precision over a row of weights: a smaller diagonal is none [1]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Level:
    """One level: its stencil, the smoother's scale, the interpolation from the next, and room to work in."""

    height: int
    width: int
    stencil: tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]
    inverse: FloatArray
    shares: FloatArray
    value: FloatArray
    other: FloatArray
    right_side: FloatArray


class GridCycle:
    """A symmetric V-cycle for the weighted Laplacian of a pixel grid.

    Write the residual, padded by one, into :attr:`right_side` and call :meth:`run`; the correction stands in
    :attr:`value` until the next call.

    Parameters
    ----------
    right_weight, down_weight : float64 arrays (h, w − 1) and (h − 1, w)
        Weights of the edges, 0 where there is none.
    prior_weight : float64 array (h, w) or of size 0
        Additions to the diagonal.
    scale : float
        Factor for all weights that brings the largest near 1, so that single precision holds them.
    rows : Rows
        How passes are run.
    compiled : bool
        Whether to use the compiled loops.
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
    ) -> None:
        work = float(COMPILED) if compiled else None
        self._rows = rows
        self._pass: dict[str, Callable[..., Any]] = {
            name: kernel(module, name, work, COMPILED)
            for module, names in {
                "multigrid": ("invert", "relax_first", "restrict_residual", "correct_relax", "relax_last"),
                "multigrid_setup": ("interpolation", "centres", "galerkin"),
            }.items()
            for name in names
        }
        low, high = _SPECTRUM
        centre, half = (high + low) / 2, (high - low) / 2
        self._steps = tuple(np.float32(1.0 / (centre - half * math.cos(math.pi * turn / 4))) for turn in (1, 3))
        height, width = down_weight.shape[0] + 1, right_weight.shape[1] + 1
        none = np.zeros((0, 0), np.float32)
        east, south = (np.zeros((height + 3, width + 3), np.float32) for _ in range(2))
        np.multiply(right_weight, scale, out=east[1:-2, 1:-3], casting="same_kind")
        np.multiply(down_weight, scale, out=south[1:-3, 1:-2], casting="same_kind")
        prior = none
        if prior_weight.size:
            prior = np.zeros((height + 3, width + 3), np.float32)
            np.multiply(prior_weight, scale, out=prior[1:-2, 1:-2], casting="same_kind")
        self._levels = [self._level(height, width, (east, south, none, none, prior))]
        while self._levels[-1].height > 1 or self._levels[-1].width > 1:
            self._levels.append(self._coarser(self._levels[-1]))
        self.sums = np.zeros(height + 3)

    @property
    def right_side(self) -> FloatArray:
        """Float32 array (h + 3, w + 3) to put a residual into."""
        return self._levels[0].right_side

    @property
    def value(self) -> FloatArray:
        """Float32 array (h + 3, w + 3) with the last correction."""
        return self._levels[0].value

    @property
    def levels(self) -> int:
        """Number of levels."""
        return len(self._levels)

    def run(self) -> float:
        """Do one cycle and return the product of right side and correction."""
        deepest = len(self._levels) - 1
        none = np.zeros(0)
        one, two = self._steps
        for k in range(deepest):
            level, following = self._levels[k], self._levels[k + 1]
            part = (*level.stencil, level.inverse, level.right_side)
            self._over(level, "relax_first", (*part, one, two, level.value))
            restricted = (*level.stencil, level.shares, level.value, level.right_side, following.right_side)
            self._rows(self._pass["restrict_residual"], restricted, 1, following.height + 1, 2 * level.width)
        last = self._levels[deepest]
        last.value[...] = last.inverse * last.right_side
        for k in range(deepest - 1, -1, -1):
            level, following = self._levels[k], self._levels[k + 1]
            corrected = (level.inverse, level.shares, following.value, level.right_side, two, level.value, level.other)
            self._over(level, "correct_relax", (*level.stencil, *corrected))
            sums = none if k else self.sums
            relaxed = (level.inverse, level.right_side, one, level.other, level.value, sums)
            self._over(level, "relax_last", (*level.stencil, *relaxed))
        if deepest == 0:
            return float(np.sum(np.float64(last.value) * last.right_side))
        return float(self.sums.sum())

    def _over(self, level: _Level, name: str, arguments: tuple[Any, ...]) -> None:
        self._rows(self._pass[name], arguments, 1, level.height + 1, level.width)

    def _level(
        self, height: int, width: int, stencil: tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]
    ) -> _Level:
        shape = (height + 3, width + 3)
        inverse, value, other, right_side = (np.zeros(shape, np.float32) for _ in range(4))
        self._rows(self._pass["invert"], (*stencil, inverse, _TINY), 1, height + 1, width)
        single = height == 1 and width == 1
        coarse = ((height + 1) // 2 + 3, (width + 1) // 2 + 3)
        shares = np.zeros((8, *((0, 0) if single else coarse)), np.float32)
        if not single:
            finer = (*stencil[:4], shares)
            self._rows(self._pass["interpolation"], finer, 1, coarse[0] - 2, 2 * width)
            self._rows(self._pass["centres"], finer, 1, coarse[0] - 2, 2 * width)
        return _Level(
            height=height,
            width=width,
            stencil=stencil,
            inverse=inverse,
            shares=shares,
            value=value,
            other=other,
            right_side=right_side,
        )

    def _coarser(self, level: _Level) -> _Level:
        height, width = (level.height + 1) // 2, (level.width + 1) // 2
        east, south, southeast, southwest = (np.zeros((height + 3, width + 3), np.float32) for _ in range(4))
        prior = np.zeros((height + 3, width + 3) if level.stencil[4].size else (0, 0), np.float32)
        stencil = (east, south, southeast, southwest, prior)
        self._rows(self._pass["galerkin"], (*level.stencil, level.shares, *stencil), 1, height + 1, 2 * width)
        return self._level(height, width, stencil)
