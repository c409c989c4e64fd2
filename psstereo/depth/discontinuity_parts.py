"""Which pixels move together once edges have given way.

A crack seldom closes without a gap: where the slopes on both sides happen to agree, an edge or two hold across the
deepest jump, and with them a whole handle in the wrong place. So what hangs together by far fewer edges than a border
has is counted as two pieces: gaps in the cracks are closed first, and opened again where a good part of the border
between two pieces holds.
"""

import numpy as np

from psstereo.depth.edges import EdgeSteps
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["pieces_of"]

_HELD = 0.01
"""Factor of an edge's weight from which it holds its ends together [1]."""
_BRIDGE = 0.1
"""Share of a border that must hold for both sides to be one piece [1]."""
_CLOSING = 2
"""Half the length of the gaps in cracks that are closed at first [px]."""
_GROWTH = 8
"""Pixels by which pieces grow back into the cracks before the rest is divided up [px]."""
_SMALLEST = 64
"""Pixels below which a piece goes with the neighbour that holds it best [px]."""

_SIDES = (np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1, :], np.s_[1:, :])

Two = tuple[FloatArray, FloatArray]


def pieces_of(inside: BoolArray, plain: EdgeSteps, factor: Two) -> IntArray:
    """Number the pieces that edges hold together.

    Parameters
    ----------
    inside : bool array (h, w)
        Pixels of the domain.
    plain : EdgeSteps
        Steps and their weights before anything was let go.
    factor : float64 arrays (h, w − 1) and (h − 1, w)
        Share of its weight that each edge has kept [1].

    Returns
    -------
    int array (h, w)
        Pieces from 0, small ones with the neighbour that holds them best; 0 outside as well.
    """
    there = [weight > 0 for weight in (plain.right_weight, plain.down_weight)]
    held = [edge & (part > _HELD) for edge, part in zip(there, factor, strict=True)]
    index = np.cumsum(inside).reshape(inside.shape) - 1
    start, stop = (
        np.concatenate([index[side[k]][edge] for side, edge in zip(_SIDES, there, strict=True)]) for k in (0, 1)
    )
    weight = np.concatenate([plain.right_weight[there[0]], plain.down_weight[there[1]]])
    kept = weight * np.concatenate([part[edge] for part, edge in zip(factor, there, strict=True)])
    holds = np.concatenate([part[edge] for part, edge in zip(held, there, strict=True)])
    piece = _joined(start[holds], stop[holds], int(np.count_nonzero(inside)))
    if not holds.all():
        closed = _joined_within(_by_cores(inside, there, held)[inside], start, stop, holds)
        piece = _without_bridges(closed, start, stop, holds)
    pieces = np.zeros(inside.shape, np.intp)
    pieces[inside] = _without_small(piece, start, stop, kept)
    return pieces


def _joined(a: IntArray, b: IntArray, size: int) -> IntArray:
    """Number what pairs connect."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(a.size, np.int8), (a, b)), shape=(size, size))
    return np.asarray(connected_components(graph, directed=False)[1])


def _by_cores(inside: BoolArray, there: list[BoolArray], held: list[BoolArray]) -> IntArray:
    """Number the pieces that are left when cracks are widened until their gaps close, grown back; 0 for no piece."""
    from scipy.ndimage import binary_dilation, label

    crack = np.zeros(inside.shape, np.bool_)
    for (a, b), edge, holding in zip(_SIDES, there, held, strict=True):
        broken = edge & ~holding
        crack[a] |= broken
        crack[b] |= broken
    wide = np.asarray(binary_dilation(crack, np.ones((3, 3), np.bool_), iterations=_CLOSING))
    piece = np.asarray(label(inside & ~wide)[0], np.intp)
    for _ in range(_GROWTH):
        grown = piece.copy()
        for (a, b), holding in zip(_SIDES, held, strict=True):
            for one, two in ((a, b), (b, a)):
                grown[two] = np.where((grown[two] == 0) & holding, piece[one], grown[two])
        piece = grown
    return piece


def _joined_within(piece: IntArray, start: IntArray, stop: IntArray, holds: BoolArray) -> IntArray:
    """Number each piece's parts that hold together anew, with what belonged to none."""
    alike = holds & (piece[start] == piece[stop])
    return _joined(start[alike], stop[alike], piece.size)


def _without_bridges(piece: IntArray, start: IntArray, stop: IntArray, holds: BoolArray) -> IntArray:
    """Join pieces again as long as a good part of the border between two of them holds."""
    while True:
        ends = piece[start], piece[stop]
        apart = ends[0] != ends[1]
        count = int(piece.max(initial=0)) + 1
        keys = np.minimum(*ends)[apart] * count + np.maximum(*ends)[apart]
        pairs, owner = np.unique(keys, return_inverse=True)
        share = np.bincount(owner, holds[apart], pairs.size) / np.bincount(owner, minlength=pairs.size)
        strong = pairs[share > _BRIDGE]
        if strong.size == 0:
            return piece
        piece = _joined(strong // count, strong % count, count)[piece]


def _without_small(piece: IntArray, start: IntArray, stop: IntArray, weight: FloatArray) -> IntArray:
    """Give each small piece to the neighbour that holds it best."""
    while True:
        sizes = np.bincount(piece)
        apart = piece[start] != piece[stop]
        start, stop, weight = start[apart], stop[apart], weight[apart]
        ends = np.concatenate([piece[start], piece[stop]]), np.concatenate([piece[stop], piece[start]])
        small = sizes[ends[0]] < _SMALLEST
        if not small.any():
            return piece
        order = np.lexsort((-np.concatenate([weight, weight])[small], ends[0][small]))
        own, other = ends[0][small][order], ends[1][small][order]
        best = np.unique(own, return_index=True)[1]
        piece = _joined(own[best], other[best], sizes.size)[piece]
