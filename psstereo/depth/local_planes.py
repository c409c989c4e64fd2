"""Slopes of noisy maps: planes fitted around each pixel, with Gaussian weights."""

import math

import numpy as np

from psstereo.types import FloatArray, IntArray

__all__ = ["local_planes"]

_REACH = 4.0
"""Radius of the neighbourhood, in standard deviations of the weights [1]."""
_FLAT = 1e-6
"""Least determinant of the neighbourhood's covariance beside the square of its trace; below it is a line [1]."""


def local_planes(values: FloatArray, labels: IntArray, scale: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit a plane to a map around each pixel, and return its value and its derivatives there.

    Pixels of the same label count, with the weight exp(−r² / (2 scale²)) at the distance r. Where all neighbours are
    there, the derivative is that of the map smoothed by the Gaussian: a wave of wavelength Λ [px] keeps the share
    exp(−2 π² scale² / Λ²), and noise of standard deviation s leaves s / (√(8 π) scale²). At borders and beside holes
    the fit is still exact on planes, which a smoothed map is not.

    Parameters
    ----------
    values : float array (h, w, c)
        Maps, fitted each by itself; finite where labels are positive.
    labels : int array (h, w)
        Which surface a pixel belongs to; 0 for none.
    scale : float
        Standard deviation of the weights, 0.5 or more [px].

    Returns
    -------
    value, right, down : float64 arrays (h, w, c)
        Value of the plane, its derivative along the row and along the column, for a step of one pixel; NaN where the
        label is 0 or its neighbours lie on one line [unit of the values].
    """
    from scipy.ndimage import find_objects

    shape = values.shape
    out = np.full(shape, np.nan), np.full(shape, np.nan), np.full(shape, np.nan)
    # Labels of any size would make a list as long as the largest.
    kinds, dense = np.unique(labels, return_inverse=True)
    dense = dense.reshape(labels.shape) + (0 if kinds[0] == 0 else 1)
    for number, window in enumerate(find_objects(dense), start=1):
        mine = dense[window] == number
        parts = _fit(np.where(mine[..., None], values[window], 0.0), mine.astype(np.float64), scale)
        for whole, part in zip(out, parts, strict=True):
            np.copyto(whole[window], part, where=mine[..., None])
    return out


def _fit(values: FloatArray, mask: FloatArray, scale: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit planes to all pixels of a window; values must be 0 where the mask is."""
    import cv2

    reach = math.ceil(_REACH * scale)
    offset = np.arange(-reach, reach + 1, dtype=np.float64)
    weight: FloatArray = np.exp(-0.5 * (offset / scale) ** 2)
    weight = weight / weight.sum()
    kernels = weight, weight * offset, weight * offset * offset

    def moment(image: FloatArray, across: int, along: int) -> FloatArray:
        done = cv2.sepFilter2D(image, cv2.CV_64F, kernels[across], kernels[along], borderType=cv2.BORDER_CONSTANT)
        return np.asarray(done, np.float64).reshape(image.shape)

    total = moment(mask, 0, 0)
    # Outside the mask nothing is asked for, and far from it there is nothing to divide by.
    share = np.divide(1.0, total, where=mask > 0, out=np.zeros_like(total))
    u, v = moment(mask, 1, 0) * share, moment(mask, 0, 1) * share
    uu, uv, vv = (moment(mask, a, b) * share - c for a, b, c in ((2, 0, u * u), (1, 1, u * v), (0, 2, v * v)))
    determinant = uu * vv - uv * uv
    fine = (mask > 0) & (determinant > _FLAT * (uu + vv) ** 2)
    inverse = np.divide(1.0, determinant, where=fine, out=np.full_like(total, np.nan))

    def wide(part: FloatArray) -> FloatArray:
        return part[..., None]

    mean = moment(values, 0, 0) * wide(share)
    with_u = moment(values, 1, 0) * wide(share) - wide(u) * mean
    with_v = moment(values, 0, 1) * wide(share) - wide(v) * mean
    right = wide(vv * inverse) * with_u - wide(uv * inverse) * with_v
    down = wide(uu * inverse) * with_v - wide(uv * inverse) * with_u
    return mean - wide(u) * right - wide(v) * down, right, down
