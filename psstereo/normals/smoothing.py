"""Normals smoothed just as far as noise demands before they are differentiated."""

import numpy as np

from psstereo.normals.integrability import IntegrableBasis, integrable_basis
from psstereo.types import BoolArray, FloatArray

__all__ = ["smoothed", "steady_basis", "trust_of"]

_WIDTHS = (0.0, 1.0, 2.0)
"""Widths of the smoothing that are tried [px of the grid]; more blurs the shape itself."""
_CLEAR = 3.0
"""Ratio of the last singular values of integrability from which a basis stands out clearly."""


def trust_of(spread: FloatArray) -> FloatArray:
    """Return the weight of each pixel by its relative residual (p,): 1/2 at the median, zero without a normal."""
    fitted = np.isfinite(spread)
    known = np.where(fitted, spread, 0.0)
    typical = max(float(np.median(known[fitted])) if fitted.any() else 0.0, np.finfo(np.float64).eps)
    return np.asarray(np.where(fitted, 1.0 / (1.0 + (known / typical) ** 2), 0.0))


def smoothed(normals: FloatArray, trust: FloatArray, mask: BoolArray, width: float) -> FloatArray:
    """Return normals (3, p) averaged over their neighbours with Gaussian weights times trust.

    Parameters
    ----------
    normals : float64 array (3, p)
        Scaled normals of the pixels of the mask, in row-major order.
    trust : float64 array (p,)
        Weight of each [1].
    mask : bool array (h, w)
        Where the pixels lie.
    width : float
        Standard deviation; zero leaves them as they are [px].
    """
    from scipy.ndimage import gaussian_filter

    if not width > 0:
        return normals

    def blur(values: FloatArray) -> FloatArray:
        image = np.zeros(mask.shape)
        image[mask] = values
        return np.asarray(gaussian_filter(image, width, mode="constant")[mask])

    around = blur(trust)
    even = np.stack([blur(row * trust) for row in normals]) / np.where(trust > 0, around, 1.0)
    return np.where(trust > 0, even, normals)


def steady_basis(normals: FloatArray, spread: FloatArray, mask: BoolArray) -> tuple[IntegrableBasis, FloatArray]:
    """Find the basis in which normals belong to a surface, after the least smoothing that lets one stand out.

    Differences of neighbours drown in noise where images are noisy or pixels many; smoothing helps, and costs detail.

    Parameters
    ----------
    normals : float64 array (3, p)
        Factored normals of the pixels of the mask, in row-major order.
    spread : float64 array (p,)
        Relative residual of each pixel, infinite where it has no normal [1].
    mask : bool array (h, w)
        Where the pixels lie.

    Returns
    -------
    basis : IntegrableBasis
        The basis; of all widths the best if none lets it stand out clearly.
    normals : float64 array (3, p)
        The smoothed normals, in their old basis.

    Raises
    ------
    InputError
        If there are too few pixels, or more than one basis serves.
    """
    trust = trust_of(spread)
    found: list[tuple[IntegrableBasis, FloatArray]] = []
    for width in _WIDTHS:
        even = smoothed(normals, trust, mask, width)
        found.append((integrable_basis(even, spread, mask), even))
        if found[-1][0].ratio >= _CLEAR:
            return found[-1]
    return max(found, key=lambda one: one[0].ratio)
