"""Rolling hills: a sum of Gaussians with analytic slopes, on a disc."""

import numpy as np

from psstereo.errors import InputError
from psstereo.types import FloatArray
from psstereo_synth.surface import Surface

__all__ = ["hills"]


def hills(width: int, height: int, *, count: int = 12, steepness: float = 0.6, seed: int = 0) -> Surface:
    """Make a smooth relief of Gaussian hills and hollows.

    Parameters
    ----------
    width, height : int
        Size of the image, at least 8 [px].
    count : int
        Number of Gaussians.
    steepness : float
        Height of a Gaussian over its standard deviation; its steepest slope is 0.61 times that [1].
    seed : int
        The same seed gives the same surface.

    Returns
    -------
    Surface
        Heights have mean zero on the mask, a centred disc.

    Raises
    ------
    InputError
        If the image is too small.
    """
    if min(width, height) < 8:
        raise InputError(
            given=f"The image is {width} × {height} pixels.",
            needed="Hills need at least 8 × 8.",
            remedy="Ask for a larger size.",
        )
    rng = np.random.default_rng(seed)
    rows, columns = np.indices((height, width), dtype=np.float64)
    x, y = columns - (width - 1) / 2, (height - 1) / 2 - rows
    radius = 0.45 * min(width, height)
    z, zx, zy = np.zeros((3, height, width))
    for _ in range(count):
        angle, distance = rng.uniform(0, 2 * np.pi), radius * np.sqrt(rng.uniform(0, 0.8))
        sigma = radius * rng.uniform(0.12, 0.3)
        dx, dy = x - distance * np.cos(angle), y - distance * np.sin(angle)
        amplitude = steepness * sigma * rng.uniform(0.5, 1.0) * rng.choice([-1.0, 1.0])
        bump = amplitude * np.exp(-(dx * dx + dy * dy) / (2 * sigma * sigma))
        z, zx, zy = z + bump, zx - bump * dx / sigma**2, zy - bump * dy / sigma**2
    mask = np.asarray(x * x + y * y <= radius * radius)
    return Surface(height=z - z[mask].mean(), normals=normals_of_slopes(zx, zy), mask=mask)


def normals_of_slopes(zx: FloatArray, zy: FloatArray) -> FloatArray:
    """Return the unit normals (h, w, 3) of a height field with slopes ∂z/∂x and ∂z/∂y [1]."""
    n = np.stack([-zx, -zy, np.ones_like(zx)], axis=-1)
    return np.asarray(n / np.sqrt((n * n).sum(axis=-1, keepdims=True)))
