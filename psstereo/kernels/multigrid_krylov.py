"""Passes of conjugate gradients over the edges of a pixel grid: the readable reference in NumPy.

Arrays of the finest grid in double precision are not padded; `right_weight` is (h, w − 1), `down_weight` (h − 1, w).
What the preconditioner reads or writes is padded (:mod:`psstereo.kernels.multigrid`). Rows `first` to `last` − 1, from
0, are worked on, and sums are by row: whoever splits the rows among threads and adds the sums in their order gets the
same bytes.
"""

import numpy as np

from psstereo.types import FloatArray

__all__ = ["advance", "multiply", "residual", "turn"]


def _flows(
    right_weight: FloatArray, down_weight: FloatArray, right: FloatArray, down: FloatArray, first: int, last: int
) -> FloatArray:
    """Return what flows into each pixel of the rows less what flows out, of flows weight · step."""
    stop = min(last, down_weight.shape[0])
    total = np.zeros((last - first, down_weight.shape[1]))
    flow = right_weight[first:last] * right[first:last]
    total[:, 1:] += flow
    total[:, :-1] -= flow
    total[: stop - first] -= down_weight[first:stop] * down[first:stop]
    start = max(first, 1)
    total[start - first :] += down_weight[start - 1 : last - 1] * down[start - 1 : last - 1]
    return total


def residual(
    right_weight: FloatArray,
    down_weight: FloatArray,
    right: FloatArray,
    down: FloatArray,
    prior_weight: FloatArray,
    prior: FloatArray,
    value: FloatArray,
    out: FloatArray,
    first: int,
    last: int,
) -> None:
    """Fill rows of b − A value: Gᵀ W (c − G value) + λ (t − value).

    Parameters
    ----------
    right_weight, down_weight, right, down : float64 arrays (h, w − 1) and (h − 1, w)
        Edges: weights W and steps c.
    prior_weight, prior : float64 arrays (h, w) or of size 0
        Weights λ and values t.
    value : float64 array (h, w)
        Where.
    out : float64 array (h, w)
        Filled on the rows.
    first, last : int
        Rows.
    """
    out[first:last] = _flows(
        right_weight, down_weight, right - np.diff(value, axis=1), down - np.diff(value, axis=0), first, last
    )
    if prior_weight.size:
        out[first:last] += prior_weight[first:last] * (prior[first:last] - value[first:last])


def multiply(
    right_weight: FloatArray,
    down_weight: FloatArray,
    prior_weight: FloatArray,
    direction: FloatArray,
    out: FloatArray,
    sums: FloatArray,
    first: int,
    last: int,
) -> None:
    """Fill rows of A direction, and the sums over each row of its products with the direction.

    Parameters
    ----------
    right_weight, down_weight, prior_weight : float64 arrays (h, w − 1), (h − 1, w), (h, w) or of size 0
        The operator.
    direction : float array (h + 3, w + 3)
        Padded.
    out : float64 array (h, w)
        Filled on the rows.
    sums : float64 array (h,)
        Filled on the rows.
    first, last : int
        Rows.
    """
    value = np.asarray(direction[1:-2, 1:-2], np.float64)
    out[first:last] = _flows(right_weight, down_weight, np.diff(value, axis=1), np.diff(value, axis=0), first, last)
    if prior_weight.size:
        out[first:last] += prior_weight[first:last] * value[first:last]
    sums[first:last] = np.sum(out[first:last] * value[first:last], axis=1)


def advance(
    length: float,
    direction: FloatArray,
    image: FloatArray,
    scale: float,
    value: FloatArray,
    left: FloatArray,
    scaled: FloatArray,
    first: int,
    last: int,
) -> None:
    """Go along the direction: value += length · direction, left −= length · image, scaled = scale · left.

    Parameters
    ----------
    length : float
        How far.
    direction : float array (h + 3, w + 3)
        Padded.
    image : float64 array (h, w)
        A direction.
    scale : float
        For the preconditioner's right side.
    value, left : float64 arrays (h, w)
        Solution and residual; changed on the rows.
    scaled : float array (h + 3, w + 3)
        Padded; filled on the rows.
    first, last : int
        Rows.
    """
    value[first:last] += length * direction[first + 1 : last + 1, 1:-2]
    left[first:last] -= length * image[first:last]
    scaled[first + 1 : last + 1, 1:-2] = scale * left[first:last]


def turn(value: FloatArray, ratio: float, direction: FloatArray, first: int, last: int) -> None:
    """Take the next direction: direction = value + ratio · direction.

    Parameters
    ----------
    value, direction : float arrays (h + 3, w + 3)
        Padded; the direction is changed on the rows.
    ratio : float
        Share of the old direction [1].
    first, last : int
        Rows, from 0.
    """
    rows = slice(first + 1, last + 1)
    direction[rows, 1:-2] = value[rows, 1:-2] + direction.dtype.type(ratio) * direction[rows, 1:-2]
