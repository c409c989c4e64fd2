"""Costs of matches and their smoothing along paths: the reference.

A *label* is a disparity or a depth, counted from 0. A pixel's brightness is a whole number with an interval around it
that says what half a pixel to either side would show, and so how far sampling alone can move it [1]_. Costs are
smoothed along straight paths through the image, each path by dynamic programming, and the paths are summed [2]_.

References
----------
.. [1] Birchfield, Tomasi, "A pixel dissimilarity measure that is insensitive to image sampling", IEEE Transactions on
   Pattern Analysis and Machine Intelligence 20(4), 1998. doi:10.1109/34.677269
.. [2] Hirschmüller, "Stereo processing by semiglobal matching and mutual information", IEEE Transactions on Pattern
   Analysis and Machine Intelligence 30(2), 2008. doi:10.1109/TPAMI.2007.1166
"""

import numpy as np

from psstereo.types import Array, FloatArray, IntArray

__all__ = ["FAR", "aggregate", "pair_costs", "winners"]

FAR = 30000
"""Path cost of a label that does not exist."""


def pair_costs(
    left: IntArray, right: IntArray, first: int, tops: IntArray, multiplier: int, rows: tuple[int, int], cost: Array
) -> None:
    """Fill some rows of the cost volume of a rectified pair.

    The cost of a channel is the distance between one pixel's value and the other's interval, whichever way is smaller,
    at most the channel's top. A pixel outside the other image costs all the tops.

    Parameters
    ----------
    left, right : int16 array (h, k, 3, w)
        Value, lower and upper end of its interval for k channels, within ±8192, ends within ±16384; `right` is
        mirrored, so that the last column comes first [steps].
    first : int
        Disparity of the label 0 [px].
    tops : int16 array (k,)
        Largest cost of each channel, 32767 together at most [steps].
    multiplier : int
        Cost of a step, times 65536, as a uint32.
    rows : (int, int)
        First row and the one after the last.
    cost : uint8 array (h, w, n)
        Filled in those rows.
    """
    height, _, _, width = left.shape
    count = cost.shape[2]
    x = np.arange(width)
    part = slice(*rows)
    mine = left[part].astype(np.int64)
    turned = right[part, :, :, ::-1].astype(np.int64)
    limit = np.asarray(tops, np.int64)[None, :, None]
    for label in range(count):
        source = x - first - label
        known = (source >= 0) & (source < width)
        there = turned[..., np.clip(source, 0, width - 1)]
        one = np.maximum(mine[:, :, 0] - there[:, :, 2], there[:, :, 1] - mine[:, :, 0])
        two = np.maximum(there[:, :, 0] - mine[:, :, 2], mine[:, :, 1] - there[:, :, 0])
        each = np.clip(np.minimum(one, two), 0, limit)
        each = np.where(known, each, limit)
        cost[part, :, label] = (each.sum(axis=1) * int(multiplier)) >> 16
    if not 0 <= rows[0] <= rows[1] <= height:
        raise IndexError(rows)


def aggregate(
    cost: Array, small: int, across: IntArray, along: IntArray, forward: bool, diagonal: bool, total: Array
) -> None:
    """Sum the path costs of one half of the directions: from the left and from above, or from the right and below.

    Parameters
    ----------
    cost : uint8 array (h, w, n)
        Cost of each label.
    small : int
        Penalty for a label that changes by one from a pixel to the next.
    across, along : uint16 array (h, w)
        Penalty for any larger change on the way into a pixel from its neighbour in the row, and from the row before.
    forward : bool
        Whether paths come from the left and from above.
    diagonal : bool
        Whether there are two diagonal paths as well.
    total : uint16 array (h, w, n)
        Filled.
    """
    if not forward:
        cost, across, along, total = cost[::-1, ::-1], across[::-1, ::-1], along[::-1, ::-1], total[::-1, ::-1]
    height, width, count = cost.shape
    rows = np.zeros((3, width + 2, count), np.int64)
    shifts = (-1, 0, 1) if diagonal else (0,)
    for y in range(height):
        c = cost[y].astype(np.int64)
        running = np.zeros(count, np.int64)
        for x in range(width):
            running = c[x] + _onward(running[None], small, across[y, x : x + 1])[0]
            total[y, x] = running
        after = np.zeros_like(rows)
        for shift in shifts:
            came = rows[shift + 1, 1 + shift : width + 1 + shift]
            after[shift + 1, 1:-1] = c + _onward(came, small, along[y])
            total[y] += after[shift + 1, 1:-1].astype(total.dtype)
        rows = after


def _onward(before: IntArray, small: int, large: IntArray) -> IntArray:
    """Return what the labels cost that one comes from, above the lowest of them."""
    lowest = before.min(axis=1)
    padded = np.pad(before, ((0, 0), (1, 1)), constant_values=FAR)
    step = np.minimum(padded[:, :-2], padded[:, 2:]) + small
    limit = (lowest + large.astype(np.int64))[:, None]
    return np.asarray(np.minimum(np.minimum(before, limit), step) - lowest[:, None])


def winners(
    one: Array,
    two: Array,
    first: int,
    paired: bool,
    rows: tuple[int, int],
    label: FloatArray,
    margin: FloatArray,
    other: FloatArray,
) -> None:
    """Choose the cheapest label of each pixel, between labels by two straight lines of equal slope.

    Parameters
    ----------
    one, two : uint16 array (h, w, n)
        Halves of the path costs.
    first : int
        Disparity of the label 0 [px].
    paired : bool
        Whether labels are disparities: then those that lead out of the other image do not count, and the other image's
        best labels are found too.
    rows : (int, int)
        First row and the one after the last.
    label : float32 array (h, w)
        Filled with the best label; NaN where none counts.
    margin : float32 array (h, w)
        Filled with how much more the best label costs that is no neighbour, over that cost [1].
    other : float32 array (h, w)
        Filled with the other image's best whole labels, if `paired`; NaN where it has none.
    """
    _, width, count = one.shape
    for y in range(*rows):
        cheapest, chosen = np.full(width, 65535), np.full(width, -1)
        for x in range(width):
            a, b = (max(0, x - width + 1 - first), min(count, x - first + 1)) if paired else (0, count)
            if b <= a:
                label[y, x], margin[y, x] = np.nan, 0.0
                continue
            part = one[y, x, a:b].astype(np.int64) + two[y, x, a:b]
            at = int(part.argmin())
            far = np.concatenate([part[: max(at - 1, 0)], part[at + 2 :], [65535]])
            margin[y, x] = (far.min() - part[at]) / max(far.min(), 1)
            label[y, x] = a + at + _between(part, at)
            if paired:
                theirs = x - first - np.arange(a, b)
                # Of equal values the first that comes stays, from the left image's left.
                better = part < cheapest[theirs]
                cheapest[theirs[better]] = part[better]
                chosen[theirs[better]] = np.arange(a, b)[better]
        if paired:
            other[y] = np.where(chosen < 0, np.nan, chosen)


def _between(part: IntArray, at: int) -> float:
    if not 0 < at < len(part) - 1:
        return 0.0
    before, behind = float(part[at - 1] - part[at]), float(part[at + 1] - part[at])
    steeper = max(before, behind)
    return 0.5 * (before - behind) / steeper if steeper > 0 else 0.0
