"""How badly normals of small blocks of pixels fit together, as they are and with the axes read otherwise.

A surface's slopes p = ∂z/∂x and q = ∂z/∂y have ∂p/∂y = ∂q/∂x. If the lights' x or y has the wrong sign, so have p or q,
and ∂p/∂y = −∂q/∂x instead; if x and y are exchanged, ∂p/∂x = ∂q/∂y; if the lights are turned by a quarter,
∂p/∂x = −∂q/∂y. All four are measured on the same scale, on which unrelated slopes give 1: the reading with the least is
believed if most blocks agree.
"""

import numpy as np

from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["READINGS", "curls", "tiles"]

READINGS = ("as given", "mirrored", "exchanged", "turned")
"""What the four figures are of."""

_GRAZING = 0.15
"""z of a unit normal below which slopes are not used."""


def tiles(pixels: IntArray, blocks: IntArray, side: int) -> IntArray:
    """Return which pixel stands where in each block, int (b, side, side), −1 where there is none.

    Parameters
    ----------
    pixels : int array (n, 2)
        Rows and columns.
    blocks : int array (n,)
        Block of each pixel.
    side : int
        Rows and columns that are kept, around the middle of each block [px].

    Returns
    -------
    int array (b, side, side)
        Indices.
    """
    count = int(blocks.max(initial=-1)) + 1
    found = np.full((count, side, side), -1, np.int64)
    where = []
    for axis in (0, 1):
        at = pixels[:, axis]
        first = np.full(count, np.iinfo(np.int64).max)
        last = np.full(count, -1)
        np.minimum.at(first, blocks, at)
        np.maximum.at(last, blocks, at)
        where.append(at - (first + np.maximum(last - first + 1 - side, 0) // 2)[blocks])
    down, right = where
    fits = (down >= 0) & (down < side) & (right >= 0) & (right < side)
    found[blocks[fits], down[fits], right[fits]] = np.flatnonzero(fits)
    return found


def curls(normals: FloatArray, usable: BoolArray, grid: IntArray, step: int) -> tuple[FloatArray, FloatArray]:
    """Measure the four curls in each block.

    Parameters
    ----------
    normals : float64 array (3, n)
        Normals of any positive length.
    usable : bool array (n,)
        Which of them count.
    grid : int array (b, side, side)
        Where they are, see :func:`tiles`.
    step : int
        Normals are averaged over step × step pixels first [px].

    Returns
    -------
    curl : float64 array (4, b)
        Weighted sums of squares; over `scale` they are 0 for a fit and 1 for unrelated slopes, on average.
    scale : float64 array (b,)
        Sums to divide by; 0 where a block has nothing.
    """
    p, q = _slopes(normals, usable, grid, step)
    with np.errstate(invalid="ignore"):
        px, py = _derivatives(p)
        qx, qy = _derivatives(q)
        energy = (px * px + py * py + qx * qx + qy * qy) / 2
        finite = np.isfinite(energy)
        middling = float(np.mean(energy[finite] ** 0.25)) ** 4 if finite.any() else 1.0
        weight = np.where(finite, 1.0 / (energy + middling + np.finfo(np.float64).tiny), 0.0)
        four = ((py - qx) ** 2, (py + qx) ** 2, (px - qy) ** 2, (px + qy) ** 2)
        curl = np.stack([np.where(finite, weight * one, 0.0).sum(axis=(1, 2)) for one in four])
        scale = np.where(finite, weight * energy, 0.0).sum(axis=(1, 2))
    return curl, scale


def _slopes(normals: FloatArray, usable: BoolArray, grid: IntArray, step: int) -> tuple[FloatArray, FloatArray]:
    """Return p and q of each bin of pixels, (b, r, c), NaN where one of its pixels is missing."""
    count = grid.shape[1] // step
    cut = grid[:, : count * step, : count * step]
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = normals / np.sqrt((normals * normals).sum(axis=0))
        unit = np.where(usable, unit, np.nan)
        field = np.where(cut >= 0, unit[:, cut], np.nan)
        mean = field.reshape(3, len(cut), count, step, count, step).mean(axis=(3, 5))
        depth = np.where(mean[2] > _GRAZING, mean[2], np.nan)
        return -mean[0] / depth, -mean[1] / depth


def _derivatives(field: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return derivatives along x (columns) and y (against the rows) at the corners between bins."""
    a, b, c, d = field[:, :-1, :-1], field[:, :-1, 1:], field[:, 1:, :-1], field[:, 1:, 1:]
    return (b + d - a - c) / 2, (a + b - c - d) / 2
