"""Gram matrices of images, summed over blocks of pixels so that no second copy of the samples is ever held."""

import numpy as np

from psstereo.types import FloatArray

__all__ = ["weighted_gram"]

_BLOCK = 4096


def weighted_gram(values: FloatArray) -> FloatArray:
    """Return Σ_p v_p v_pᵀ / |v_p|², float64 (m, m), which gives every pixel the same say.

    Parameters
    ----------
    values : float array (m, p)
        Brightness, finite; pixels without any light are left out.

    Returns
    -------
    float64 array (m, m)
        The Gram matrix.
    """
    total = np.zeros((len(values), len(values)))
    for start in range(0, values.shape[1], _BLOCK):
        block = np.array(values[:, start : start + _BLOCK], np.float64)
        length = np.sqrt((block * block).sum(axis=0))
        block = block[:, length > 0] / length[length > 0]
        total += block @ block.T
    return total
