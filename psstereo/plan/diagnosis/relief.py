"""A smooth height that goes with scattered normals: enough to say which pixels stand nearer to the lights."""

import numpy as np

from psstereo.types import FloatArray

__all__ = ["smooth_relief"]

_DEGREE = 5
_RIDGE = 1e-4


def smooth_relief(place: FloatArray, normals: FloatArray) -> FloatArray:
    """Fit a polynomial of fifth degree to slopes, each weighted by the cosine to the view.

    Parameters
    ----------
    place : float64 array (2, n)
        x and y, about −1 to 1 [length].
    normals : float64 array (3, n)
        Normals of any length.

    Returns
    -------
    float64 array (n,)
        Heights, of mean zero [length].
    """
    x, y = place
    powers = [(i, j) for i in range(_DEGREE + 1) for j in range(_DEGREE + 1 - i) if i + j > 0]
    rows, height = [], []
    for i, j in powers:
        along_x = i * x ** max(i - 1, 0) * y**j
        along_y = j * x**i * y ** max(j - 1, 0)
        rows.append(np.concatenate([normals[2] * along_x, normals[2] * along_y]))
        height.append(x**i * y**j)
    matrix = np.array(rows)
    right = -matrix @ np.concatenate([normals[0], normals[1]])
    table = matrix @ matrix.T
    ridge = _RIDGE * np.trace(table) / len(table) + np.finfo(np.float64).tiny
    found = np.linalg.solve(table + ridge * np.eye(len(table)), right) @ np.array(height)
    return np.asarray(found - found.mean()) if found.size else found
