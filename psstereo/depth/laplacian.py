"""The normal equations of the edges as a sparse matrix."""

from typing import Any

import numpy as np

from psstereo.depth.edges import EdgeSteps
from psstereo.types import BoolArray, FloatArray

__all__ = ["divergence", "edge_laplacian"]


def edge_laplacian(steps: EdgeSteps, inside: BoolArray) -> tuple[Any, FloatArray]:
    """Return the normal equations of the edges, L s = b.

    Parameters
    ----------
    steps : EdgeSteps
        The edges.
    inside : bool array (h, w)
        Pixels of the domain; the unknowns are these in row-major order.

    Returns
    -------
    matrix : sparse float64 array (p, p)
        L = Gᵀ W G with the differences G along the edges and their weights W; rows sum to zero.
    right_side : float64 array (p,)
        b = Gᵀ W c with the steps c.
    """
    from scipy.sparse import coo_array

    count = int(np.count_nonzero(inside))
    index = np.cumsum(inside, dtype=np.int32).reshape(inside.shape) - np.int32(1)
    right, down = steps.right_weight > 0, steps.down_weight > 0
    start = np.concatenate([index[:, :-1][right], index[:-1][down]])
    stop = np.concatenate([index[:, 1:][right], index[1:][down]])
    weight = np.concatenate([steps.right_weight[right], steps.down_weight[down]])
    every = np.arange(count, dtype=np.int32)
    diagonal = np.bincount(start, weight, count) + np.bincount(stop, weight, count)
    matrix = coo_array(
        (
            np.concatenate([-weight, -weight, diagonal]),
            (np.concatenate([start, stop, every]), np.concatenate([stop, start, every])),
        ),
        shape=(count, count),
    ).tocsr()
    return matrix, divergence(steps, inside.shape)[inside]


def divergence(steps: EdgeSteps, shape: tuple[int, ...]) -> FloatArray:
    """Return the weighted steps that arrive at each pixel minus those that leave it.

    Parameters
    ----------
    steps : EdgeSteps
        The edges.
    shape : (int, int)
        Rows and columns.

    Returns
    -------
    float64 array (h, w)
        b = Gᵀ W c [unit of the steps].
    """
    total = np.zeros(shape)
    flow = steps.right_weight * steps.right
    total[:, 1:] += flow
    total[:, :-1] -= flow
    flow = steps.down_weight * steps.down
    total[1:] += flow
    total[:-1] -= flow
    return total
