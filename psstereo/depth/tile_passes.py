"""One iteration over the tiles: what each of its passes does with a tile.

The equations are those of :mod:`psstereo.depth.weighted` on the whole image. Tiles share files, not memory. A
tile writes nothing that another one of the same pass reads (:func:`relax` is run on sets of tiles whose overlaps do not
touch), so that they may be worked on in any order and at the same time.

Each step of :func:`lift` and :func:`relax` is a projection, to the accuracy of its own solve: it takes away a part of
the error's energy that adds up with all others, whatever weights and mask. So the iteration cannot diverge, and knows
how far it has come.
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from psstereo.depth.edges import EdgeSteps, components_of
from psstereo.depth.grid import COMPILED
from psstereo.depth.laplacian import divergence
from psstereo.depth.rows import Rows
from psstereo.depth.tile_input import EdgeFiles
from psstereo.depth.tile_levels import TileLevels, nodes
from psstereo.depth.tiles import FileArray, Tile, Window, inside_of
from psstereo.depth.weighted import solve_weighted
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Energy", "Work", "by_component", "coarse_weights", "lift", "relax", "restrict"]

_ROUNDING = 2e-15
"""Residual that is rounding, relative to the products that it is the difference of [1]."""
_MOST = 29
"""Iterations in a tile at most: at 30 the shared solve may turn to its algebraic hierarchy, for four times the room."""
Energy: TypeAlias = tuple[int, FloatArray]
"""Number of a component, and the energies of it and of the following ones."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Work:
    """What stays the same through all iterations.

    Attributes
    ----------
    files : EdgeFiles
        The equations.
    values : FileArray
        Depth so far (float64).
    levels : int
        The coarse grid takes every pixel whose row and column are multiples of 2 to this power.
    overlap : int
        Pixels by which a tile's own solve reaches beyond the tile [px].
    scale : float
        Factor for all weights that brings the largest to 1.
    sizes : float64 array (n + 1,)
        Square root of the energy of each component's right side, by which all are brought to the same size; 0 where
        there is nothing to solve.
    tolerance : float
        Relative residual to which the tiles' own equations are solved [1].
    compiled : bool
        Whether to use the compiled loops.
    threads : int
        Threads within a tile.
    """

    files: EdgeFiles
    values: FileArray
    levels: int
    overlap: int
    scale: float
    sizes: FloatArray
    tolerance: float
    compiled: bool
    threads: int

    @property
    def margin(self) -> int:
        """Pixels around a tile that its part of the coarse grid depends on, and of the values in the overlap."""
        node = 1 << self.levels
        return -(-(self.overlap + 1) // node) * node + 2 * node

    def hierarchy(self, steps: EdgeSteps, prior_weight: FloatArray, rows: Rows) -> TileLevels:
        """Return the finest levels on a window."""
        return TileLevels(
            steps.right_weight,
            steps.down_weight,
            prior_weight,
            scale=self.scale,
            rows=rows,
            compiled=self.compiled,
            depth=self.levels,
        )


def _less(steps: EdgeSteps, values: FloatArray) -> EdgeSteps:
    """Return what is left of the steps after those of some values; 0 where there is no edge."""
    return EdgeSteps(
        right=np.where(steps.right_weight > 0, steps.right - np.diff(values, axis=1), 0.0),
        down=np.where(steps.down_weight > 0, steps.down - np.diff(values, axis=0), 0.0),
        right_weight=steps.right_weight,
        down_weight=steps.down_weight,
        left_out=0,
    )


def _coarse(window: Window, levels: int) -> Window:
    return nodes(window[0], levels), nodes(window[1], levels)


def coarse_weights(work: Work, tile: Tile) -> tuple[FloatArray, ...]:
    """Return a tile's part of the coarse operator.

    Parameters
    ----------
    work : Work
        The equations.
    tile : Tile
        The tile.

    Returns
    -------
    tuple of float32 arrays (h', w')
        Weights east, south, southeast, southwest of the coarse nodes, and the prior's, of size 0 if there is none.
    """
    window = tile.grown(work.margin)
    steps, _, prior_weight = work.files.steps(window)
    with Rows(work.threads) as rows:
        found = work.hierarchy(steps, prior_weight, rows).stencil()
    own = inside_of(_coarse(tile.core, work.levels), _coarse(window, work.levels))
    return tuple(part[own].copy() if part.size else part for part in found)


def restrict(work: Work, tile: Tile) -> tuple[FloatArray, float]:
    """Carry the residual of a tile down to the coarse grid.

    Parameters
    ----------
    work : Work
        The equations.
    tile : Tile
        The tile.

    Returns
    -------
    residual : float64 array (h', w')
        Residual at the tile's coarse nodes, each component in its own size.
    square : float
        Sum of the squares of the residual in the tile, likewise.
    """
    window = tile.grown(work.margin)
    values, sizes = work.values.read(window), work.sizes[work.files.labels.read(window)]
    steps, prior, prior_weight = work.files.steps(window)
    residual = divergence(_less(steps, values), values.shape)
    if prior.size:
        residual += prior_weight * (prior - values)
    residual /= np.where(sizes > 0, sizes, 1.0)
    square = float(np.sum(residual[inside_of(tile.core, window)] ** 2))
    with Rows(work.threads) as rows:
        below = work.hierarchy(steps, prior_weight, rows).down(residual)
    part = inside_of(_coarse(tile.core, work.levels), _coarse(window, work.levels))
    return below[part].astype(np.float64), square


def lift(work: Work, item: tuple[Tile, FloatArray]) -> Energy:
    """Add the coarse correction to the values of a tile.

    Parameters
    ----------
    work : Work
        The equations.
    item : (Tile, float64 array)
        The tile, and the coarse correction at the nodes of its window.

    Returns
    -------
    Energy
        Of the correction, over the edges that begin in the tile.
    """
    tile, coarse = item
    window, more = tile.grown(work.margin), tile.grown(1, before=0)
    steps, _, prior_weight = work.files.steps(window)
    with Rows(work.threads) as rows:
        above = work.hierarchy(steps, prior_weight, rows).up(coarse)[inside_of(more, window)]
    labels = work.files.labels.read(more)
    change = np.where(labels > 0, above * work.sizes[labels], 0.0)
    own = inside_of(tile.core, more)
    work.values.write(tile.core, work.values.read(tile.core) + change[own])
    near = _within(steps, inside_of(more, window))
    held = prior_weight[inside_of(tile.core, window)] if prior_weight.size else prior_weight
    return _energy(near, held, change, labels[own])


def relax(work: Work, tile: Tile) -> tuple[Energy, int]:
    """Solve the equations of a tile and its overlap, the values farther out being held.

    Parameters
    ----------
    work : Work
        The equations; the values are written, in the overlap too.
    tile : Tile
        The tile.

    Returns
    -------
    energy : Energy
        Of the change.
    iterations : int
        Iterations it took.
    """
    own, reach = tile.grown(work.overlap), tile.grown(work.overlap + 1)
    values, cut = work.values.read(reach), inside_of(own, reach)
    steps, prior, prior_weight = work.files.steps(reach)
    left = _less(steps, values)
    target, held = _held(left, cut, values.shape)
    if prior.size:
        target += prior_weight * (prior - values)
        held += prior_weight
    target, held = np.ascontiguousarray(target[cut]), np.ascontiguousarray(held[cut])
    labels = work.files.labels.read(own)
    within = _within(left, cut)
    del steps, left
    reached = _reached(within)
    pieces = components_of(within, labels > 0)
    inside = _unsolved(pieces, divergence(within, target.shape) + target, (reached + held) * _size(values, cut))
    pieces *= inside
    for edges in (within.right_weight, within.right):
        np.multiply(edges, inside[:, :-1], out=edges)
    for edges in (within.down_weight, within.down):
        np.multiply(edges, inside[:-1], out=edges)
    held *= inside
    _pin(pieces, reached, held)
    solved = solve_weighted(
        within,
        inside,
        prior=target / np.where(held > 0, held, 1.0),
        prior_weight=held,
        components=pieces,
        tolerance=work.tolerance,
        max_iterations=_MOST,
        threads=work.threads,
        solves=COMPILED if work.compiled else 1,
    )
    work.values.write(own, values[cut] + solved.values)
    return _energy(within, held, solved.values, labels), solved.iterations


def _within(steps: EdgeSteps, cut: Window) -> EdgeSteps:
    """Return the edges between the pixels of a part."""
    rows, columns = cut
    across, below = (rows, slice(columns.start, columns.stop - 1)), (slice(rows.start, rows.stop - 1), columns)
    return EdgeSteps(
        right=np.ascontiguousarray(steps.right[across]),
        down=np.ascontiguousarray(steps.down[below]),
        right_weight=np.ascontiguousarray(steps.right_weight[across]),
        down_weight=np.ascontiguousarray(steps.down_weight[below]),
        left_out=0,
    )


def _held(steps: EdgeSteps, cut: Window, shape: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    """Return what edges that lead out of a part, to values of 0, demand of its pixels: weight times value, and weight.

    Such an edge is a prior of its own: minimising w (0 − s − c)² over s is minimising w (s + c)².
    """
    rows, columns = cut
    target, held = np.zeros(shape), np.zeros(shape)
    if rows.start > 0:
        weight = steps.down_weight[rows.start - 1]
        held[rows.start] += weight
        target[rows.start] += weight * steps.down[rows.start - 1]
    if rows.stop < shape[0]:
        weight = steps.down_weight[rows.stop - 1]
        held[rows.stop - 1] += weight
        target[rows.stop - 1] -= weight * steps.down[rows.stop - 1]
    if columns.start > 0:
        weight = steps.right_weight[:, columns.start - 1]
        held[:, columns.start] += weight
        target[:, columns.start] += weight * steps.right[:, columns.start - 1]
    if columns.stop < shape[1]:
        weight = steps.right_weight[:, columns.stop - 1]
        held[:, columns.stop - 1] += weight
        target[:, columns.stop - 1] -= weight * steps.right[:, columns.stop - 1]
    return target, held


def _reached(steps: EdgeSteps) -> FloatArray:
    """Return the sum of the weights of the edges at each pixel."""
    weight = np.zeros((steps.right.shape[0], steps.down.shape[1]))
    weight[:, :-1] += steps.right_weight
    weight[:, 1:] += steps.right_weight
    weight[:-1] += steps.down_weight
    weight[1:] += steps.down_weight
    return weight


def _size(values: FloatArray, cut: Window) -> FloatArray:
    """Return the magnitudes of the values of a part, or of their neighbours if those are larger."""
    size = np.abs(np.pad(values, 1))
    across = np.maximum(np.maximum(size[:, :-2], size[:, 2:]), size[:, 1:-1])[1:-1]
    below = np.maximum(size[:-2], size[2:])[:, 1:-1]
    return np.asarray(np.maximum(across, below)[cut])


def _unsolved(pieces: IntArray, residual: FloatArray, size: FloatArray) -> BoolArray:
    """Return the pixels of those pieces in which more than rounding is left.

    The shared solve brings each piece to the same size, and what has nothing but rounding would spoil its neighbours.
    """
    rounding = _ROUNDING * (size + np.finfo(np.float64).tiny)
    found = np.bincount(pieces.ravel(), (np.abs(residual) > rounding).ravel()) > 0
    found[0] = False
    return np.asarray(found[pieces])


def _pin(pieces: IntArray, reached: FloatArray, held: FloatArray) -> None:
    """Hold the first pixel of each piece that nothing holds, as its edges do.

    Once such a piece is solved, rounding is left, which need not sum to zero: without a hold no change would answer it.
    """
    loose = (np.bincount(pieces.ravel(), held.ravel()) == 0) & (np.bincount(pieces.ravel()) > 0)
    loose[0] = False
    if not loose.any():
        return
    where = np.flatnonzero(loose[pieces.ravel()])
    first = np.zeros(loose.size, np.int64)
    # Backwards, so that what is written last is the first.
    first[pieces.ravel()[where][::-1]] = where[::-1]
    pins = np.unravel_index(first[loose], held.shape)
    held[pins] = reached[pins]


def _energy(steps: EdgeSteps, held: FloatArray, change: FloatArray, labels: IntArray) -> Energy:
    """Return the energy of a change over the edges that begin at some pixels, by component."""
    height, width = labels.shape
    sums = held * change[:height, :width] ** 2 if held.size else np.zeros(labels.shape)
    across = steps.right_weight * np.diff(change, axis=1) ** 2
    below = steps.down_weight * np.diff(change, axis=0) ** 2
    sums[:, : across.shape[1]] += across[:height, :width]
    sums[: below.shape[0]] += below[:height, :width]
    return by_component(labels, sums)


def by_component(labels: IntArray, values: FloatArray) -> Energy:
    """Return the sum of an array over each component.

    Parameters
    ----------
    labels : int32 array (h, w)
        Components; 0 outside.
    values : float64 array (h, w)
        What is summed.

    Returns
    -------
    first : int
        Number of the first component.
    sums : float64 array (n',)
        Sums of it and of the following ones.
    """
    used = labels > 0
    numbers = labels[used]
    if not numbers.size:
        return 0, np.zeros(0)
    first = int(numbers.min())
    return first, np.bincount(numbers - first, values[used]).astype(np.float64, copy=False)
