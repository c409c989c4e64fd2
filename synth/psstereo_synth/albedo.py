"""Albedo patterns."""

import numpy as np

from psstereo.types import FloatArray

__all__ = ["checker"]


def checker(
    shape: tuple[int, int], *, cells: int = 8, low: float = 0.25, high: float = 0.75, tint: bool = False
) -> FloatArray:
    """Make a checkerboard with a soft gradient over it.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns.
    cells : int
        Cells along the shorter side.
    low, high : float
        Albedo of dark and bright cells at the top; the gradient takes off up to a fifth at the bottom [1].
    tint : bool
        Whether to make three channels of slightly different colour.

    Returns
    -------
    float64 array (h, w) or (h, w, 3)
        Albedo πρ [1].
    """
    rows, columns = np.indices(shape) * cells / min(shape)
    even = (np.floor(rows) + np.floor(columns)) % 2 == 0
    gray = np.where(even, high, low) * (1 - 0.2 * np.linspace(0.0, 1.0, shape[0])[:, None])
    return np.asarray(gray[..., None] * np.array([1.0, 0.85, 0.7]) if tint else gray)
