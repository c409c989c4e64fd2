"""What everybody can do to integrate normals: a sparse factorisation, algebraic multigrid, a bare transform.

All solve the plain quadratic problem for parallel projection, Σ (z_b − z_a − c_ab)² over edges between neighbouring
pixels, with the step c_ab that of the normal midway, n_a + n_b.
"""

from typing import Any

import numpy as np

from psstereo.errors import UnsupportedError
from psstereo.types import Array, BoolArray, FloatArray

__all__ = ["algebraic_multigrid", "bare_transform", "sparse_direct"]


def sparse_direct(normals: FloatArray, mask: BoolArray) -> FloatArray:
    """Solve by SciPy's sparse factorisation.

    Parameters
    ----------
    normals : float array (h, w, 3)
        Unit normals [1].
    mask : bool array (h, w)
        Pixels to integrate, in one piece.

    Returns
    -------
    float64 array (h, w)
        Heights, NaN outside [px].
    """
    from scipy import sparse
    from scipy.sparse.linalg import splu

    matrix, right = _equations(normals, mask)
    values = splu(sparse.csc_array(matrix), permc_spec="MMD_AT_PLUS_A").solve(right)
    return _spread(values, mask)


def algebraic_multigrid(normals: FloatArray, mask: BoolArray) -> FloatArray:
    """Solve by conjugate gradients, preconditioned by PyAMG's smoothed aggregation, to 1e-8.

    Parameters
    ----------
    normals : float array (h, w, 3)
        Unit normals [1].
    mask : bool array (h, w)
        Pixels to integrate, in one piece.

    Returns
    -------
    float64 array (h, w)
        Heights, NaN outside [px].

    Raises
    ------
    UnsupportedError
        If PyAMG is not installed.
    """
    try:
        import pyamg
    except ImportError:
        raise UnsupportedError(
            given="PyAMG is not installed.", needed="It is the yardstick here.", remedy="pip install pyamg"
        ) from None
    matrix, right = _equations(normals, mask)
    kind: Any = pyamg.smoothed_aggregation_solver
    values = kind(matrix.tocsr()).solve(right, tol=1e-8, accel="cg")
    return _spread(values, mask)


def bare_transform(shape: tuple[int, int]) -> None:
    """Make a discrete cosine transform there and back, the least that integration of a rectangle by transforms costs.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns.
    """
    from scipy.fft import dctn, idctn

    ramp = np.arange(shape[0] * shape[1], dtype=np.float64).reshape(shape)
    idctn(dctn(ramp, overwrite_x=True), overwrite_x=True)


def _equations(normals: FloatArray, mask: BoolArray) -> tuple[Any, FloatArray]:
    """Return the normal equations' matrix and right side; a weight on the first pixel holds the free constant."""
    from scipy import sparse

    count = int(np.count_nonzero(mask))
    places = np.where(mask, np.cumsum(mask).reshape(mask.shape) - 1, -1)
    ends, steps = [], []
    for first, last, part, sign in (
        (np.s_[:, :-1], np.s_[:, 1:], 0, -1.0),
        (np.s_[:-1], np.s_[1:], 1, 1.0),
    ):
        both = mask[first] & mask[last]
        midway = normals[first][both] + normals[last][both]
        ends.append(np.stack([places[first][both], places[last][both]], axis=1))
        steps.append(sign * midway[:, part] / midway[:, 2])
    pairs, step = np.concatenate(ends), np.concatenate(steps)
    rows = np.arange(len(step))
    ones = np.ones(len(step))
    shape = (len(step), count)
    difference = sparse.csr_array((ones, (rows, pairs[:, 1])), shape=shape) - sparse.csr_array(
        (ones, (rows, pairs[:, 0])), shape=shape
    )
    pin = sparse.csr_array(([1.0], ([0], [0])), shape=(count, count))
    return difference.T @ difference + pin, np.asarray(difference.T @ step)


def _spread(values: Array, mask: BoolArray) -> FloatArray:
    heights = np.full(mask.shape, np.nan)
    heights[mask] = values
    return heights
