"""Multigrid on a pixel grid, one pass a function: the readable reference in NumPy.

A level is a graph Laplacian on a grid, held by its edge weights: `east` (to the next column), `south` (to the next
row), and on coarse levels also `southeast` and `southwest`; `prior` adds to the diagonal. All arrays are padded: pixel
(i, j) stands at [i + 1, j + 1], and two more rows and columns of zeros follow, so that no loop asks for borders. What a
level lacks (diagonals on the finest, a prior) is an array of size 0. The operator is

    (A z)_a = Σ_b w_ab (z_a − z_b) + prior_a z_a,

in differences, so that single precision keeps its digits where neighbouring values hardly differ.

The smoother is Chebyshev's polynomial of degree 2 in the scaled matrix, two steps z ← z + c · inverse · (r − A z):
forward and backward on the way down and up, so that the cycle is symmetric. Passes work on rows `first` to `last` − 1
(padded) and write nothing else: who splits the rows among threads gets the same bytes.

The twin in :mod:`psstereo.kernels.multigrid_compiled` keeps three rows of work in the nearest cache and needs a
twentieth of the time.
"""

import numpy as np

from psstereo.types import FloatArray

__all__ = ["correct_relax", "invert", "prolong", "relax_first", "relax_last", "restrict_residual"]


def _all_weights(
    east: FloatArray, south: FloatArray, southeast: FloatArray, southwest: FloatArray, first: int, last: int
) -> list[tuple[FloatArray, int, int]]:
    """Return (weights, row offset, column offset) of the four or eight neighbours of the rows first to last − 1."""
    rows, above = slice(first, last), slice(first - 1, last - 1)
    here, left, right = slice(1, -2), slice(0, -3), slice(2, -1)
    found = [
        (east[rows, here], 0, 1),
        (east[rows, left], 0, -1),
        (south[rows, here], 1, 0),
        (south[above, here], -1, 0),
    ]
    if southeast.size:
        found += [
            (southeast[rows, here], 1, 1),
            (southeast[above, left], -1, -1),
            (southwest[rows, here], 1, -1),
            (southwest[above, right], -1, 1),
        ]
    return found


def _residual(
    east: FloatArray,
    south: FloatArray,
    southeast: FloatArray,
    southwest: FloatArray,
    prior: FloatArray,
    value: FloatArray,
    right_side: FloatArray,
    first: int,
    last: int,
) -> FloatArray:
    """Return right side minus A value on some rows, without the padding of columns."""
    rows, width = slice(first, last), value.shape[1]
    own = value[rows, 1:-2]
    residual = right_side[rows, 1:-2].copy()
    for weight, down, across in _all_weights(east, south, southeast, southwest, first, last):
        residual -= weight * (own - value[first + down : last + down, 1 + across : width - 2 + across])
    if prior.size:
        residual -= prior[rows, 1:-2] * own
    return np.asarray(residual)


def invert(
    east: FloatArray,
    south: FloatArray,
    southeast: FloatArray,
    southwest: FloatArray,
    prior: FloatArray,
    inverse: FloatArray,
    tiny: float,
    first: int,
    last: int,
) -> None:
    """Fill the smoother's scale: one over the diagonal, or over half the sum of magnitudes of a row if that is more.

    So the spectrum of inverse · A ends at 2 at most. A diagonal below `tiny` times the magnitudes is rounding: 0 then.

    Parameters
    ----------
    east, south, southeast, southwest, prior : float arrays (h + 3, w + 3) or of size 0
        The level.
    inverse : float array (h + 3, w + 3)
        Filled on the rows.
    tiny : float
        Rounding of the weights [1].
    first, last : int
        Rows, padded.
    """
    weights = [part[0] for part in _all_weights(east, south, southeast, southwest, first, last)]
    diagonal = np.sum(weights, axis=0)
    magnitude = np.sum(np.abs(weights), axis=0)
    if prior.size:
        diagonal = diagonal + prior[first:last, 1:-2]
        magnitude = magnitude + prior[first:last, 1:-2]
    used = diagonal > tiny * magnitude
    bound = np.where(used, np.maximum(diagonal, 0.5 * (diagonal + magnitude)), 1.0)
    inverse[first:last, 1:-2] = np.where(used, 1.0 / bound, 0.0)


def relax_first(
    east: FloatArray,
    south: FloatArray,
    southeast: FloatArray,
    southwest: FloatArray,
    prior: FloatArray,
    inverse: FloatArray,
    right_side: FloatArray,
    one: float,
    two: float,
    value: FloatArray,
    first: int,
    last: int,
) -> None:
    """Do both steps of the smoother from zero, step `one`, then step `two`.

    Parameters
    ----------
    east, south, southeast, southwest, prior, inverse : float arrays (h + 3, w + 3) or of size 0
        The level.
    right_side : float array (h + 3, w + 3)
        The residual to smooth.
    one, two : float
        Chebyshev's steps [1].
    value : float array (h + 3, w + 3)
        Filled on the rows.
    first, last : int
        Rows, padded.
    """
    start = one * inverse * right_side
    residual = _residual(east, south, southeast, southwest, prior, start, right_side, first, last)
    value[first:last, 1:-2] = start[first:last, 1:-2] + two * inverse[first:last, 1:-2] * residual


def restrict_residual(
    east: FloatArray,
    south: FloatArray,
    southeast: FloatArray,
    southwest: FloatArray,
    prior: FloatArray,
    shares: FloatArray,
    value: FloatArray,
    right_side: FloatArray,
    coarse: FloatArray,
    first: int,
    last: int,
) -> None:
    """Fill rows of the coarse right side with the residual, by the transpose of the interpolation.

    Parameters
    ----------
    east, south, southeast, southwest, prior : float arrays (h + 3, w + 3) or of size 0
        The level.
    shares : float array (8, H + 3, W + 3)
        Interpolation (:mod:`psstereo.kernels.multigrid_setup`).
    value, right_side : float arrays (h + 3, w + 3)
        What the residual is of.
    coarse : float array (H + 3, W + 3)
        Filled on the rows.
    first, last : int
        Rows of the coarse grid, padded.
    """
    tall, width = coarse.shape[0] - 3, coarse.shape[1] - 3
    start, stop = max(2 * first - 2, 1), min(2 * last - 1, east.shape[0] - 2)
    residual = np.zeros((2 * tall + 2, 2 * width + 2), value.dtype)
    residual[start:stop, 1 : value.shape[1] - 2] = _residual(
        east, south, southeast, southwest, prior, value, right_side, start, stop
    )
    rows, above, here, left = slice(first, last), slice(first - 1, last - 1), slice(1, width + 1), slice(0, width)
    odd, even, before = (
        slice(2 * first - 1, 2 * last - 1, 2),
        slice(2 * first, 2 * last, 2),
        slice(2 * first - 2, 2 * last - 2, 2),
    )
    on, right_of, left_of = slice(1, 2 * width, 2), slice(2, 2 * width + 1, 2), slice(0, 2 * width - 1, 2)
    coarse[rows, here] = (
        residual[odd, on]
        + shares[0, rows, here] * residual[odd, right_of]
        + shares[1, rows, left] * residual[odd, left_of]
        + shares[2, rows, here] * residual[even, on]
        + shares[3, above, here] * residual[before, on]
        + shares[4, rows, here] * residual[even, right_of]
        + shares[5, rows, left] * residual[even, left_of]
        + shares[6, above, here] * residual[before, right_of]
        + shares[7, above, left] * residual[before, left_of]
    )


def prolong(shares: FloatArray, coarse: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Return coarse values interpolated to the pixels of a padded array.

    Parameters
    ----------
    shares : float array (8, H + 3, W + 3)
        Interpolation (:mod:`psstereo.kernels.multigrid_setup`).
    coarse : float array (H + 3, W + 3)
        Values.
    shape : (int, int)
        Shape of the finer arrays, padding included.

    Returns
    -------
    float array of `shape`
        Fine values.
    """
    rows, columns = slice(1, -2), slice(1, -2)
    down, right = slice(2, -1), slice(2, -1)
    part = shares[:, 1:-2, 1:-2]
    own, east = coarse[rows, columns], coarse[rows, right]
    south, southeast = coarse[down, columns], coarse[down, right]
    fine = np.zeros((2 * own.shape[0] + 3, 2 * own.shape[1] + 3), coarse.dtype)
    fine[1:-2:2, 1:-2:2] = own
    fine[1:-2:2, 2:-1:2] = part[0] * own + part[1] * east
    fine[2:-1:2, 1:-2:2] = part[2] * own + part[3] * south
    fine[2:-1:2, 2:-1:2] = part[4] * own + part[5] * east + part[6] * south + part[7] * southeast
    fine = fine[: shape[0], : shape[1]]
    fine[shape[0] - 2 :], fine[:, shape[1] - 2 :] = 0.0, 0.0
    return np.asarray(fine)


def correct_relax(
    east: FloatArray,
    south: FloatArray,
    southeast: FloatArray,
    southwest: FloatArray,
    prior: FloatArray,
    inverse: FloatArray,
    shares: FloatArray,
    coarse: FloatArray,
    right_side: FloatArray,
    step: float,
    value: FloatArray,
    result: FloatArray,
    first: int,
    last: int,
) -> None:
    """Add the interpolated coarse correction and do the first step of the smoother on the way up.

    Parameters
    ----------
    east, south, southeast, southwest, prior, inverse : float arrays (h + 3, w + 3) or of size 0
        The level.
    shares : float array (8, H + 3, W + 3)
        Interpolation.
    coarse : float array (H + 3, W + 3)
        Correction.
    right_side, value : float arrays (h + 3, w + 3)
        The level's right side and what was found on the way down.
    step : float
        Chebyshev's step [1].
    result : float array (h + 3, w + 3)
        Filled on the rows; not `value` itself.
    first, last : int
        Rows, padded.
    """
    start = value + prolong(shares, coarse, (value.shape[0], value.shape[1]))
    residual = _residual(east, south, southeast, southwest, prior, start, right_side, first, last)
    result[first:last, 1:-2] = start[first:last, 1:-2] + step * inverse[first:last, 1:-2] * residual


def relax_last(
    east: FloatArray,
    south: FloatArray,
    southeast: FloatArray,
    southwest: FloatArray,
    prior: FloatArray,
    inverse: FloatArray,
    right_side: FloatArray,
    step: float,
    value: FloatArray,
    result: FloatArray,
    sums: FloatArray,
    first: int,
    last: int,
) -> None:
    """Do the last step of the smoother, and sum right side times result over each row.

    Parameters
    ----------
    east, south, southeast, southwest, prior, inverse : float arrays (h + 3, w + 3) or of size 0
        The level.
    right_side, value : float arrays (h + 3, w + 3)
        The level's right side and its value so far.
    step : float
        Chebyshev's step [1].
    result : float array (h + 3, w + 3)
        Filled on the rows; not `value` itself.
    sums : float64 array (h + 3,)
        Filled on the rows; of size 0 if not wanted.
    first, last : int
        Rows, padded.
    """
    residual = _residual(east, south, southeast, southwest, prior, value, right_side, first, last)
    found = value[first:last, 1:-2] + step * inverse[first:last, 1:-2] * residual
    result[first:last, 1:-2] = found
    if sums.size:
        sums[first:last] = np.sum(np.float64(found) * right_side[first:last, 1:-2], axis=1)
