"""The Gauss–Newton matrix of shading over a height field, compiled: twin of :mod:`psstereo.kernels.terrain_product`."""

from typing import Any

import numba
import numpy as np

__all__ = ["fill_flows", "gather"]

_compile = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})


@_compile
def fill_flows(
    x_band: Any,
    y_band: Any,
    xx: Any,
    xy: Any,
    yy: Any,
    value: Any,
    flow_x: Any,
    flow_y: Any,
    first: int,
    last: int,
) -> None:
    """Fill rows of D G value; see :func:`psstereo.kernels.terrain_product.fill_flows`."""
    width = xx.shape[1]
    across = np.zeros(width)
    along = np.zeros(width)
    for i in range(first, last):
        row = value[i + 3]
        for j in range(width):
            across[j] = (
                x_band[0, j] * row[j]
                + x_band[1, j] * row[j + 1]
                + x_band[2, j] * row[j + 2]
                + x_band[3, j] * row[j + 3]
                + x_band[4, j] * row[j + 4]
                + x_band[5, j] * row[j + 5]
                + x_band[6, j] * row[j + 6]
            )
        along[:] = 0.0
        for k in range(7):
            c = y_band[i, k]
            other = value[i + k]
            for j in range(width):
                along[j] += c * other[j + 3]
        a, b, d = xx[i], xy[i], yy[i]
        to_x, to_y = flow_x[i + 3], flow_y[i + 3]
        for j in range(width):
            to_x[j + 3] = a[j] * across[j] + b[j] * along[j]
            to_y[j + 3] = b[j] * across[j] + d[j] * along[j]


@_compile
def gather(
    x_back: Any,
    y_back: Any,
    x_bend: Any,
    y_bend: Any,
    x_twist: Any,
    y_twist: Any,
    value: Any,
    flow_x: Any,
    flow_y: Any,
    out: Any,
    first: int,
    last: int,
) -> None:
    """Fill rows of Gᵀ flows + B value; see :func:`psstereo.kernels.terrain_product.gather`."""
    width = out.shape[1]
    twisted = np.zeros(width + 6)
    for i in range(first, last):
        o, flow, row = out[i], flow_x[i + 3], value[i + 3]
        up, own, down = y_twist[i, 2], y_twist[i, 3], y_twist[i, 4]
        above, below = value[i + 2], value[i + 4]
        for j in range(width + 6):
            twisted[j] = up * above[j] + own * row[j] + down * below[j]
        for j in range(width):
            o[j] = x_twist[2, j] * twisted[j + 2] + x_twist[3, j] * twisted[j + 3] + x_twist[4, j] * twisted[j + 4]
        for k in range(7):
            c, b = x_back[k], x_bend[k]
            for j in range(width):
                o[j] += c[j] * flow[j + k] + b[j] * row[j + k]
            p, q = y_back[i, k], y_bend[i, k]
            other_flow, other = flow_y[i + k], value[i + k]
            for j in range(width):
                o[j] += p * other_flow[j + 3] + q * other[j + 3]
