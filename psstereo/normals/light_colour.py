"""Colours of lights, told by how the same pixels change their colour from image to image.

A matte pixel shows ``V_icp = e_ic ρ_cp (n · l)`` in channel c, so that the logarithm of one channel over the mean of
all is a light's part plus a pixel's part, whatever its normal. Lights of several colours on a surface of several
colours would otherwise spoil the sum over channels: it is then no product of one light and one albedo.
"""

import numpy as np

from psstereo.types import BoolArray, FloatArray

__all__ = ["light_colours"]

_ROUNDS = 5
_EXACT = 1e-12
_NOTHING = 1e-300
_FREE = 1e-12
"""Singular value beside the largest below which a combination of lights is not told: their common factor."""
_BRIGHT = 0.2
"""Share of a pixel's brightest value from which an observation tells a colour."""


def light_colours(values: FloatArray) -> FloatArray:
    """Return the colour of each light, up to one factor a channel that all lights share.

    Not for interreflection between strong colours: the median over pixels does not see what a few pixels do, but
    takes what most of them do for the light's.

    Parameters
    ----------
    values : float64 array (c, m, p)
        Brightness; NaN where an observation is not usable.

    Returns
    -------
    float64 array (m, c)
        Factors whose logarithms have mean zero over channels and over lights; 1 where an image tells nothing.
    """
    channels, lights, _ = values.shape
    if channels == 1:
        return np.ones((lights, 1))
    gray = values.mean(axis=0)
    brightest = np.where(np.isfinite(gray), gray, 0.0).max(axis=0)
    told: BoolArray = (values > 0).all(axis=0) & (gray > _BRIGHT * brightest)
    excess = np.log(np.where(told, values, 1.0))
    excess -= excess.mean(axis=0)
    own = np.stack([_rows(part, told.astype(np.float64)) for part in excess], axis=1)
    own -= own.mean(axis=1, keepdims=True)
    return np.asarray(np.exp(own - own.mean(axis=0)))


def _rows(values: FloatArray, told: FloatArray) -> FloatArray:
    """Return r (m,) of mean zero with values (m, p) ≈ r_i + s_p where told, robustly."""
    weights = told
    rows = np.zeros(len(values))
    for _ in range(_ROUNDS):
        share = weights / np.maximum(weights.sum(axis=0), _NOTHING)
        columns = (share * values).sum(axis=0)
        matrix = np.diag(weights.sum(axis=1)) - share @ weights.T  # the columns' unknowns eliminated
        right = (weights * (values - columns)).sum(axis=1)
        rows = np.linalg.lstsq(matrix, right, rcond=_FREE)[0]
        rows -= rows.mean()
        residual = values - rows[:, None] - (share * (values - rows[:, None])).sum(axis=0)
        scale = max(1.4826 * float(np.median(np.abs(residual[told > 0]))) if told.any() else 0.0, _EXACT)
        weights = told / (1.0 + (residual / scale) ** 2)
    return np.asarray(rows)
