"""The iteration over the tiles: coarse grid, tiles, coarse grid, … until the equations of the whole image hold."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from psstereo.depth.rows import Rows
from psstereo.depth.tile_levels import CoarseGrid, nodes
from psstereo.depth.tile_passes import Energy, Work, coarse_weights, lift, relax, restrict
from psstereo.depth.tiles import Tile, Window
from psstereo.types import FloatArray, Map

__all__ = ["Found", "solve_tiles"]

_COARSE = 1e-2
"""Relative residual to which the coarse equations are solved; smaller ones save no iteration [1]."""
_IDLE = 3
"""Iterations that must gain something together, or rounding is all that is left."""


@dataclass(frozen=True, kw_only=True)
class Found:
    """How the iteration ended.

    Attributes
    ----------
    iterations : int
        Iterations over all tiles.
    tile_iterations : int
        Iterations of conjugate gradients in the tiles, all together.
    residual : float
        Estimate of the worst component's relative error, in the energy norm of the equations [1].
    residual_length : float
        Length of the residual of the equations of the whole image, relative to their right side [1].
    """

    iterations: int
    tile_iterations: int
    residual: float
    residual_length: float


def solve_tiles(
    work: Work,
    tiles: Sequence[Tile],
    *,
    side: int,
    tolerance: float,
    max_iterations: int,
    over: Map,
    report: Callable[[float], None],
) -> Found:
    """Iterate until the tolerance is met.

    Parameters
    ----------
    work : Work
        The equations; its values are the start, zero, and the result.
    tiles : sequence of Tile
        The tiles that have pixels inside.
    side : int
        Side of a tile [px].
    tolerance : float
        Relative error wanted, of each component [1].
    max_iterations : int
        Iterations at most.
    over : map
        How tiles are worked on.
    report : callable
        Told the relative error after each iteration.

    Returns
    -------
    Found
        How it ended.
    """
    colours = _colours(tiles, side)
    with Rows(work.threads) as rows:
        coarse = _coarse_grid(work, tiles, over, rows)
        removed, before = np.zeros(work.sizes.size), np.zeros(work.sizes.size)
        history: list[float] = []
        used = work.sizes > 0
        done = tile_iterations = 0
        start, residual = 0.0, math.inf
        while True:
            below, square = _down(work, tiles, over)
            start = start or square
            idle = len(history) > _IDLE and history[-1] > 0.99 * history[-1 - _IDLE]
            if residual <= tolerance or done >= max_iterations or idle:
                length = math.sqrt(square / start) if start > 0 else 0.0
                break
            correction = coarse.solve(below, _COARSE)
            energy = np.zeros(work.sizes.size)
            items = ((tile, correction[_nodes(work, tile.grown(work.margin))]) for tile in tiles)
            _add(energy, over(partial(lift, work), items))
            for colour in colours:
                found = list(over(partial(relax, work), colour))
                _add(energy, (one[0] for one in found))
                tile_iterations += sum(one[1] for one in found)
            removed += energy
            residual = _error(energy, before, removed)
            before, done = energy, done + 1
            history.append(float(np.sqrt(np.sum(energy[used] / work.sizes[used] ** 2))))
            report(residual)
    return Found(iterations=done, tile_iterations=tile_iterations, residual=residual, residual_length=length)


def _error(energy: FloatArray, before: FloatArray, removed: FloatArray) -> float:
    """Return the worst component's relative error in the energy norm, from the energies removed so far.

    Each step is a projection, so that the energies removed add up to that of the first error. What is left follows
    from the pace, if that is slow; if it is fast, the last iteration's share is more than that.
    """
    used = removed > 0
    if not used.any():
        return 0.0
    last, total = energy[used], removed[used]
    pace = np.minimum(last / np.where(before[used] > 0, before[used], np.maximum(last, 1e-300)), 0.999)
    slow = np.where(before[used] > 0, pace / (1.0 - pace), 1.0)
    return float(np.sqrt(np.max(last / total * np.maximum(slow, 1.0))))


def _colours(tiles: Sequence[Tile], side: int) -> list[list[Tile]]:
    """Return four sets of tiles, no two of a set with overlaps that touch."""

    def colour(tile: Tile) -> tuple[int, int]:
        return tile.core[0].start // side % 2, tile.core[1].start // side % 2

    return [[tile for tile in tiles if colour(tile) == one] for one in ((0, 0), (1, 1), (0, 1), (1, 0))]


def _add(total: FloatArray, parts: Iterable[Energy]) -> None:
    for first, energies in parts:
        total[first : first + energies.size] += energies


def _nodes(work: Work, window: Window) -> Window:
    return nodes(window[0], work.levels), nodes(window[1], work.levels)


def _size(work: Work) -> tuple[int, int]:
    height, width = work.values.shape
    return nodes(slice(0, height), work.levels).stop, nodes(slice(0, width), work.levels).stop


def _coarse_grid(work: Work, tiles: Sequence[Tile], over: Map, rows: Rows) -> CoarseGrid:
    """Put the coarse operator together."""
    height, width = _size(work)
    shape = (height + 3, width + 3)
    prior = shape if work.files.prior is not None else (0, 0)
    stencil = [np.zeros(size, np.float32) for size in (shape, shape, shape, shape, prior)]
    for tile, found in zip(tiles, over(partial(coarse_weights, work), tiles), strict=True):
        for whole, part in zip(stencil, found, strict=True):
            if part.size:
                whole[1:-2, 1:-2][_nodes(work, tile.core)] = part
    return CoarseGrid(stencil, rows=rows, compiled=work.compiled)


def _down(work: Work, tiles: Sequence[Tile], over: Map) -> tuple[FloatArray, float]:
    """Return the residual on the coarse grid, and the square of its length on the pixels."""
    below, square = np.zeros(_size(work)), 0.0
    for tile, (part, own) in zip(tiles, over(partial(restrict, work), tiles), strict=True):
        below[_nodes(work, tile.core)] = part
        square += own
    return below, square
