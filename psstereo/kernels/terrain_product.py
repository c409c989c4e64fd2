"""The Gauss–Newton matrix of shading over a height field, applied to a change of heights: the readable reference.

The matrix is Gᵀ D G + B: G takes the two slopes of a change by differences, D is a symmetric 2 × 2 tensor at each
pixel, what the images tell of the slopes there, and B is the bending energy. All differences are *band tables*, seven
numbers a column or row: entry (k, j) of a table over columns multiplies the value of column j + k − 3, so that a table
holds its own treatment of the borders. Fields that are read at neighbours are padded by `HALO` zeros on every side.

Rows `first` to `last` − 1, from 0, are worked on, so that threads can share them without a trace in the result.
"""

import numpy as np

from psstereo.types import FloatArray

__all__ = ["HALO", "fill_flows", "gather"]

HALO = 3
"""Zeros around every padded field, the reach of a band table [px]."""


def fill_flows(
    x_band: FloatArray,
    y_band: FloatArray,
    xx: FloatArray,
    xy: FloatArray,
    yy: FloatArray,
    value: FloatArray,
    flow_x: FloatArray,
    flow_y: FloatArray,
    first: int,
    last: int,
) -> None:
    """Fill rows of D G value.

    Parameters
    ----------
    x_band, y_band : float64 arrays (7, w) and (h, 7)
        Differences along columns and rows [length⁻¹].
    xx, xy, yy : float64 arrays (h, w)
        The tensor's entries.
    value : float64 array (h + 6, w + 6)
        Change of heights, padded [length].
    flow_x, flow_y : float64 arrays (h + 6, w + 6)
        Filled on the rows, inside of the padding.
    first, last : int
        Rows.
    """
    width = xx.shape[1]
    inner = slice(HALO, HALO + width)
    rows = value[first + HALO : last + HALO]
    across, along = np.zeros((2, last - first, width))
    for k in range(2 * HALO + 1):
        across += x_band[k] * rows[:, k : k + width]
        along += y_band[first:last, k, None] * value[first + k : last + k, inner]
    flow_x[first + HALO : last + HALO, inner] = xx[first:last] * across + xy[first:last] * along
    flow_y[first + HALO : last + HALO, inner] = xy[first:last] * across + yy[first:last] * along


def gather(
    x_back: FloatArray,
    y_back: FloatArray,
    x_bend: FloatArray,
    y_bend: FloatArray,
    x_twist: FloatArray,
    y_twist: FloatArray,
    value: FloatArray,
    flow_x: FloatArray,
    flow_y: FloatArray,
    out: FloatArray,
    first: int,
    last: int,
) -> None:
    """Fill rows of Gᵀ flows + B value.

    Parameters
    ----------
    x_back, y_back : float64 arrays (7, w) and (h, 7)
        The transposed differences [length⁻¹].
    x_bend, y_bend : float64 arrays (7, w) and (h, 7)
        Squared second differences along columns and rows.
    x_twist, y_twist : float64 arrays (7, w) and (h, 7)
        Squared first differences, three numbers wide, whose product is the energy of the mixed derivative.
    value, flow_x, flow_y : float64 arrays (h + 6, w + 6)
        Change of heights and flows, padded.
    out : float64 array (h, w)
        Filled on the rows.
    first, last : int
        Rows.
    """
    width = out.shape[1]
    inner = slice(HALO, HALO + width)
    rows = slice(first + HALO, last + HALO)
    total = np.zeros((last - first, width))
    for k in range(2 * HALO + 1):
        shifted = slice(k, k + width)
        total += x_back[k] * flow_x[rows, shifted] + x_bend[k] * value[rows, shifted]
        total += y_back[first:last, k, None] * flow_y[first + k : last + k, inner]
        total += y_bend[first:last, k, None] * value[first + k : last + k, inner]
    for i in (2, 3, 4):
        for j in (2, 3, 4):
            total += y_twist[first:last, i, None] * x_twist[j] * value[first + i : last + i, j : j + width]
    out[first:last] = total
