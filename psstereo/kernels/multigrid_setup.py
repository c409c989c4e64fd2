"""Coarser levels of a multigrid on a pixel grid: the readable reference in NumPy.

The coarse grid takes every other row and column; coarse node (I, J) stands for the block of the pixels 2I, 2I + 1 by
2J, 2J + 1. Its own pixel (2I, 2J) takes its value. The other three take shares of the nodes around them, as in
black-box multigrid [1]_: a pixel between two nodes in the ratio of its connections to either side, the pixel in the
middle of four as the mean of its neighbours weighed by its connections. So the correction is continuous where the
surface is stiff and breaks where edges are weak or missing. New here: a pixel with no connection toward the nodes at
its sides (the end of a spit, a bridge one pixel wide off the coarse lines) takes the value of its block's node, even
if that node's own pixel lies outside. Shares always sum to 1; thus constants pass to every level, whatever the mask.

Coarse weights are Galerkin products, cell by cell: an edge of weight w whose ends take shares p and q of the four
nodes k of a cell has the energy ``w (Σ_k d_k Z_k)²``, d = p − q with Σ d = 0, and that is the energy of edges between
nodes with the weights ``−w d_k d_l``. Rows of the coarse matrix therefore sum to zero without rounding.

References
----------
.. [1] J. E. Dendy, "Black box multigrid", Journal of Computational Physics 48, 1982.
   doi:10.1016/0021-9991(82)90057-2
"""

import numpy as np

from psstereo.types import FloatArray

__all__ = ["TIE", "centres", "galerkin", "interpolation"]

TIE = 1e-6
"""Share of a pixel's connections below which those toward the nodes at its sides count as missing [1]."""


def _positive(weights: FloatArray, rows: slice, columns: slice) -> FloatArray:
    return np.asarray(np.maximum(weights[rows, columns], 0.0)) if weights.size else np.zeros(1, weights.dtype)


def _neighbours(
    east: FloatArray,
    south: FloatArray,
    southeast: FloatArray,
    southwest: FloatArray,
    row: int,
    column: int,
    grid: tuple[int, int],
) -> list[FloatArray]:
    """Return the weights n, s, w, e, nw, ne, sw, se, none negative, of every other pixel from (row, column), padded."""
    tall, wide = grid

    def at(weights: FloatArray, down: int, across: int) -> FloatArray:
        i, j = row + down, column + across
        return _positive(weights, slice(i, i + 2 * tall - 1, 2), slice(j, j + 2 * wide - 1, 2))

    return [
        at(south, -1, 0),
        at(south, 0, 0),
        at(east, 0, -1),
        at(east, 0, 0),
        at(southeast, -1, -1),
        at(southwest, -1, 1),
        at(southwest, 0, 0),
        at(southeast, 0, 0),
    ]


def _two_shares(a: FloatArray, b: FloatArray, total: FloatArray) -> tuple[FloatArray, FloatArray]:
    sides = a + b
    reached = sides > TIE * total
    divisor = np.where(reached, sides, 1.0)
    return np.where(reached, a / divisor, total > 0), np.where(reached, b / divisor, 0.0)


def interpolation(
    east: FloatArray,
    south: FloatArray,
    southeast: FloatArray,
    southwest: FloatArray,
    shares: FloatArray,
    first: int,
    last: int,
) -> None:
    """Fill the shares of the pixels between two nodes.

    Parameters
    ----------
    east, south, southeast, southwest : float arrays (h + 3, w + 3) or of size 0
        The level.
    shares : float array (8, H + 3, W + 3)
        By pixel of the block: 0, 1 the one to the right, of the nodes left and right of it; 2, 3 the one below, of the
        nodes above and below it; 4 to 7 the one in the middle, of its four nodes (by :func:`centres`). Filled on the
        rows.
    first, last : int
        Rows of the coarse grid, padded.
    """
    grid = (last - first, shares.shape[2] - 3)
    weights = (east, south, southeast, southwest)
    rows, columns = slice(first, last), slice(1, -2)
    n, s, w, e, nw, ne, sw, se = _neighbours(*weights, 2 * first - 1, 2, grid)
    total = n + s + w + e + nw + ne + sw + se
    shares[0, rows, columns], shares[1, rows, columns] = _two_shares(w + nw + sw, e + ne + se, total)
    n, s, w, e, nw, ne, sw, se = _neighbours(*weights, 2 * first, 1, grid)
    total = n + s + w + e + nw + ne + sw + se
    shares[2, rows, columns], shares[3, rows, columns] = _two_shares(n + nw + ne, s + sw + se, total)


def centres(
    east: FloatArray,
    south: FloatArray,
    southeast: FloatArray,
    southwest: FloatArray,
    shares: FloatArray,
    first: int,
    last: int,
) -> None:
    """Fill the shares of the pixels in the middle of four nodes, when those of all lines are there.

    Parameters
    ----------
    east, south, southeast, southwest : float arrays (h + 3, w + 3) or of size 0
        The level.
    shares : float array (8, H + 3, W + 3)
        See :func:`interpolation`; the last four are filled on the rows.
    first, last : int
        Rows of the coarse grid, padded.
    """
    grid = (last - first, shares.shape[2] - 3)
    n, s, w, e, nw, ne, sw, se = _neighbours(east, south, southeast, southwest, 2 * first, 2, grid)
    here, below = shares[:, first:last, 1:-2], shares[:, first + 1 : last + 1, 1:-2]
    beside = shares[:, first:last, 2:-1]
    parts = [
        nw + n * here[0] + w * here[2],
        ne + n * here[1] + e * beside[2],
        sw + s * below[0] + w * here[3],
        se + s * below[1] + e * beside[3],
    ]
    total, reach = n + s + w + e + nw + ne + sw + se, np.sum(parts, axis=0)
    reached = reach > TIE * total
    for k, part in enumerate(parts):
        shares[4 + k, first:last, 1:-2] = np.where(
            reached, part / np.where(reached, reach, 1.0), (total > 0) if k == 0 else 0.0
        )


def galerkin(
    east: FloatArray,
    south: FloatArray,
    southeast: FloatArray,
    southwest: FloatArray,
    prior: FloatArray,
    shares: FloatArray,
    coarse_east: FloatArray,
    coarse_south: FloatArray,
    coarse_southeast: FloatArray,
    coarse_southwest: FloatArray,
    coarse_prior: FloatArray,
    first: int,
    last: int,
) -> None:
    """Add the coarse level's weights to arrays of zeros.

    Parameters
    ----------
    east, south, southeast, southwest, prior : float arrays (h + 3, w + 3) or of size 0
        The level.
    shares : float array (8, H + 3, W + 3)
        Interpolation, see :func:`interpolation`.
    coarse_east, coarse_south, coarse_southeast, coarse_southwest, coarse_prior : float arrays (H + 3, W + 3)
        Added to on the rows; the prior's of size 0 if there is none.
    first, last : int
        Rows of the coarse grid, padded. Cells of the row before are gone through as well, for what they have below.
    """
    start = max(first - 1, 1)
    tall, wide = last - start, coarse_east.shape[1] - 3
    fine = _cells(shares, start, last)
    energy = np.zeros((4, 4, tall, wide), shares.dtype)
    hold = np.zeros((4, tall, wide), shares.dtype)

    def part(weights: FloatArray, row: int, column: int) -> FloatArray:
        i, j = 2 * start - 1 + row, 1 + column
        return weights[i : i + 2 * tall - 1 : 2, j : j + 2 * wide - 1 : 2]

    # An edge belongs to the cell it crosses; those on the lines between nodes to the cell below or to the right.
    edges = [(east, row, column, (row, column), (row, column + 1)) for row in (0, 1) for column in (0, 1)]
    edges += [(south, row, column, (row, column), (row + 1, column)) for row in (0, 1) for column in (0, 1)]
    if southeast.size:
        edges += [(southeast, row, column, (row, column), (row + 1, column + 1)) for row in (0, 1) for column in (0, 1)]
        edges += [(southwest, row, column, (row, column), (row + 1, column - 1)) for row in (0, 1) for column in (1, 2)]
    for weights, row, column, a, b in edges:
        difference = fine[a] - fine[b]
        energy -= part(weights, row, column) * difference[:, None] * difference[None, :]
    if prior.size:
        for place in ((0, 0), (0, 1), (1, 0), (1, 1)):
            held = part(prior, *place)
            hold += held * fine[place]
            energy -= held * fine[place][:, None] * fine[place][None, :]
    own, under = slice(first - start, tall), slice(first - start - 1 if first > start else 0, tall - 1)
    rows, below = slice(first, last), slice(first + (first == start), last)
    left, right = slice(1, wide + 1), slice(2, wide + 2)
    coarse_east[rows, left] += energy[0, 1, own]
    coarse_east[below, left] += energy[2, 3, under]
    coarse_south[rows, left] += energy[0, 2, own]
    coarse_south[rows, right] += energy[1, 3, own]
    coarse_southeast[rows, left] += energy[0, 3, own]
    coarse_southwest[rows, right] += energy[1, 2, own]
    if prior.size:
        coarse_prior[rows, left] += hold[0, own]
        coarse_prior[rows, right] += hold[1, own]
        coarse_prior[below, left] += hold[2, under]
        coarse_prior[below, right] += hold[3, under]


def _cells(shares: FloatArray, first: int, last: int) -> dict[tuple[int, int], FloatArray]:
    """Return the shares of the cells' 3 × 3 pixels in their four corners, (4, rows, columns) each."""
    here, below = shares[:, first:last, 1:-2], shares[:, first + 1 : last + 1, 1:-2]
    beside = shares[:, first:last, 2:-1]
    none, one = np.zeros_like(here[0]), np.ones_like(here[0])
    return {
        (0, 0): np.stack([one, none, none, none]),
        (0, 1): np.stack([here[0], here[1], none, none]),
        (0, 2): np.stack([none, one, none, none]),
        (1, 0): np.stack([here[2], none, here[3], none]),
        (1, 1): np.stack([here[4], here[5], here[6], here[7]]),
        (1, 2): np.stack([none, beside[2], none, beside[3]]),
        (2, 0): np.stack([none, none, one, none]),
        (2, 1): np.stack([none, none, below[0], below[1]]),
        (2, 2): np.stack([none, none, none, one]),
    }
