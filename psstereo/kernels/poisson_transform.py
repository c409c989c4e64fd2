"""Around the cosine transform of a full rectangle whose edges all weigh the same: the readable reference in NumPy."""

import numpy as np

from psstereo.kernels.poisson_steps import steps
from psstereo.types import Array, BoolArray, FloatArray, IntArray

__all__ = ["divergence", "divide", "mismatch"]


def divergence(
    normals: Array,
    top: int,
    left: int,
    inside: BoolArray,
    matrix: FloatArray,
    places: FloatArray,
    central: bool,
    out: FloatArray,
    lost: IntArray,
    first: int,
    last: int,
) -> None:
    """Fill rows with the steps that arrive at each pixel less those that leave it, without keeping the steps.

    Parameters
    ----------
    normals, top, left, inside, matrix, places, central
        See :func:`psstereo.kernels.poisson_steps.steps`.
    out : float64 array (h, w)
        Filled on the rows.
    lost : int64 array (h,)
        Edges that are not usable, to the right of and below the rows; filled on the rows.
    first, last : int
        Rows.
    """
    height, width = inside.shape
    right, right_weight = np.zeros((height, width - 1)), np.zeros((height, width - 1))
    down, down_weight = np.zeros((height - 1, width)), np.zeros((height - 1, width))
    begin = max(first - 1, 0)
    every = np.zeros(height, np.int64)
    look = (matrix, places, central, 0.0, 0.0)
    steps(
        normals, top, left, inside, np.zeros((0, 0)), *look, right, down, right_weight, down_weight, every, begin, last
    )
    lost[first:last] = every[first:last]
    total = np.zeros(inside.shape)
    total[:, 1:] += right
    total[:, :-1] -= right
    total[1:] += down
    total[:-1] -= down
    out[first:last] = total[first:last]


def divide(spectrum: FloatArray, rows: FloatArray, columns: FloatArray, first: int, last: int) -> None:
    """Divide a spectrum by the eigenvalues, rows[j] + columns[k], and set the free constant to 0.

    Parameters
    ----------
    spectrum : float64 array (h, w)
        Changed on the rows.
    rows, columns : float64 arrays (h,) and (w,)
        Parts of the eigenvalues; only the first of both is 0.
    first, last : int
        Rows.
    """
    eigenvalues = rows[first:last, None] + columns[None, :]
    spectrum[first:last] = np.where(
        eigenvalues > 0, spectrum[first:last] / np.where(eigenvalues > 0, eigenvalues, 1), 0
    )


def mismatch(value: FloatArray, right_side: FloatArray, sums: FloatArray, first: int, last: int) -> None:
    """Sum squares of the right side less the Laplacian of the values, and of the right side, over each row.

    Parameters
    ----------
    value, right_side : float64 arrays (h, w)
        What solves and what was to be solved.
    sums : float64 array (h, 2)
        Filled on the rows.
    first, last : int
        Rows.
    """
    residual = right_side.copy()
    for axis in (0, 1):
        flow = np.diff(value, axis=axis)
        residual[(slice(1, None), slice(None)) if axis == 0 else (slice(None), slice(1, None))] -= flow
        residual[(slice(None, -1), slice(None)) if axis == 0 else (slice(None), slice(None, -1))] += flow
    sums[first:last, 0] = np.sum(residual[first:last] ** 2, axis=1)
    sums[first:last, 1] = np.sum(right_side[first:last] ** 2, axis=1)
