r"""One linearisation of shape from shading on the pixel grid: the reference.

The unknown is a height s, in pixels, over a grid with edges between neighbours. A pixel's slopes are the means of the
steps at its two sides, p along the row and q down the column (one side's step where the other is missing), and its
normal is N = A p + B q + C, with vectors that are affine over the image: so for parallel and central projection alike.
The light gives E(n) = c + b·n + nᵀ Q n with the unit normal n. Half of the energy's gradient and a positive
semidefinite operator (Gauss–Newton for the brightness, lagged weights for the rest) come from

    Σ w (E − I)²  +  λ Σ \|N\|^(−4κ) S  +  α Σ √(1 + G)  +  Σ μ (s − t)²

with S = s_xx² + s_yy² + 2 s_xy² (the last shared by the four pixels of a cell) and G the mean squares of the steps.
Dark pixels count only where E exceeds I: their brightness is a bound.
"""

from typing import TypeVar

import numpy as np

from psstereo.types import Array, BoolArray, FloatArray

__all__ = ["gradient", "linearise", "multiply", "shade"]

_A = TypeVar("_A", bound=Array)


def shade(normal: FloatArray, light: FloatArray) -> FloatArray:
    """Return E of vectors, which are normalised first.

    Parameters
    ----------
    normal : float64 array (3, ...)
        Normals of any length [1].
    light : float64 array (10,)
        c, b, then Q's entries xx, yy, zz, xy, xz, yz; the mixed ones count twice.

    Returns
    -------
    float64 array (...)
        Irradiance, below zero where the surface faces away.
    """
    x, y, z = normal / np.sqrt((normal * normal).sum(axis=0))
    c, bx, by, bz, xx, yy, zz, xy, xz, yz = light
    square = xx * x * x + yy * y * y + zz * z * z + 2.0 * (xy * x * y + xz * x * z + yz * y * z)
    return np.asarray(c + bx * x + by * y + bz * z + square)


def _steps(s: FloatArray, east: BoolArray, south: BoolArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the steps to the right, from the left, downward and from above, 0 where there is no edge."""
    right, below = np.zeros_like(s), np.zeros_like(s)
    right[:, :-1] = np.where(east[:, :-1], s[:, 1:] - s[:, :-1], 0.0)
    below[:-1] = np.where(south[:-1], s[1:] - s[:-1], 0.0)
    return right, _right(right), below, _down(below)


def _right(a: _A) -> _A:
    """Return the array moved by a column to the right."""
    out = np.zeros_like(a)
    out[:, 1:] = a[:, :-1]
    return out


def _down(a: _A) -> _A:
    """Return the array moved by a row down."""
    out = np.zeros_like(a)
    out[1:] = a[:-1]
    return out


def _left(a: _A) -> _A:
    """Return the array moved by a column to the left."""
    out = np.zeros_like(a)
    out[:, :-1] = a[:, 1:]
    return out


def _up(a: _A) -> _A:
    """Return the array moved by a row up."""
    out = np.zeros_like(a)
    out[:-1] = a[1:]
    return out


def _cells(east: BoolArray, south: BoolArray) -> BoolArray:
    """Return which pixels have the whole cell to their lower right."""
    return np.asarray(east & _up(east) & south & _left(south))


def linearise(
    s: FloatArray,
    east: BoolArray,
    south: BoolArray,
    target: FloatArray,
    weight: FloatArray,
    dark: BoolArray,
    frame: FloatArray,
    light: FloatArray,
    bending: float,
    kappa: float,
    area: float,
    pull: FloatArray,
    along: FloatArray,
    down: FloatArray,
    stiff: FloatArray,
    tension: FloatArray,
    sums: FloatArray,
    first: int,
    last: int,
) -> None:
    """Fill rows with what the gradient and the operator need, and sum the energies.

    Parameters
    ----------
    s : float64 array (h, w)
        Heights [px].
    east, south : bool arrays (h, w)
        Whether the pixel has an edge to its right and to the one below.
    target, weight : float64 arrays (h, w)
        Brightness I, and weight w of its square; weight 0 where the pixel says nothing [1].
    dark : bool array (h, w)
        Pixels whose brightness is only a bound.
    frame : float64 array (3, 3, 3)
        A, B, C by constant, column and row, by component.
    light : float64 array (10,)
        See :func:`shade`.
    bending, kappa, area : float
        λ, κ, α [1].
    pull : float64 array (2, h, w)
        Filled: derivatives with respect to p and q, times a half and the share of a step in a slope.
    along, down : float arrays (h, w)
        Filled: √w ∂E/∂p and √w ∂E/∂q times those shares.
    stiff, tension : float arrays (h, w)
        Filled: λ |N|^(−4κ) and α / √(1 + G).
    sums : float64 array (h, 3)
        Filled: brightness, bending, area; each row's energy.
    first, last : int
        Rows.
    """
    right, left, below, above = _steps(s, east, south)
    from_left, from_above = _right(east), _down(south)
    count_x, count_y = east * 1.0 + from_left, south * 1.0 + from_above
    share_x, share_y = 1.0 / np.maximum(count_x, 1.0), 1.0 / np.maximum(count_y, 1.0)
    p, q = share_x * (right + left), share_y * (below + above)
    rows, columns = np.indices(s.shape)
    a, b, c = (
        part[0][:, None, None] + part[1][:, None, None] * columns + part[2][:, None, None] * rows for part in frame
    )
    normal = a * p + b * q + c
    square = (normal * normal).sum(axis=0)
    n = normal / np.sqrt(square)
    turn = (light[1:4, None, None] + 2.0 * np.einsum("ij,jhw->ihw", _matrix(light), n)) / np.sqrt(square)
    turn -= (turn * n).sum(axis=0) * n
    heavy = np.where((count_x > 0) & (count_y > 0), weight, 0.0)
    misfit = shade(normal, light) - target
    heavy = np.where(dark & (misfit <= 0), 0.0, heavy)
    slope_p, slope_q = (turn * a).sum(axis=0), (turn * b).sum(axis=0)
    cell = np.where(_cells(east, south), _up(right) - right, 0.0) ** 2
    curve = (
        np.where(count_x > 1, right - left, 0.0) ** 2
        + np.where(count_y > 1, below - above, 0.0) ** 2
        + 0.5 * (cell + _right(cell) + _down(cell) + _down(_right(cell)))
    )
    lagged = bending * square ** (-2.0 * kappa)
    length = np.sqrt(1.0 + 0.5 * (right**2 + left**2 + below**2 + above**2))
    fade = -2.0 * kappa * lagged * curve / square
    part = slice(first, last)
    pull[0, part] = (share_x * (heavy * misfit * slope_p + fade * (normal * a).sum(axis=0)))[part]
    pull[1, part] = (share_y * (heavy * misfit * slope_q + fade * (normal * b).sum(axis=0)))[part]
    along[part] = (share_x * np.sqrt(heavy) * slope_p)[part]
    down[part] = (share_y * np.sqrt(heavy) * slope_q)[part]
    stiff[part] = lagged[part]
    tension[part] = (area / length)[part]
    # The pixels outside have no edges: their area, 1 each, is no part of the surface.
    held = (count_x + count_y) > 0
    for column, energy in enumerate((heavy * misfit**2, lagged * curve, area * np.where(held, length - 1.0, 0.0))):
        sums[part, column] = energy[part].sum(axis=1)


def _matrix(light: FloatArray) -> FloatArray:
    xx, yy, zz, xy, xz, yz = light[4:]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _divergence(
    s: FloatArray,
    east: BoolArray,
    south: BoolArray,
    force: tuple[FloatArray, FloatArray],
    stiff: FloatArray,
    tension: FloatArray,
) -> FloatArray:
    """Return what forces along slopes, stiffness and tension do to each pixel."""
    right, left, below, above = _steps(s, east, south)
    bend_x = np.where(east & _right(east), stiff * (right - left), 0.0)
    bend_y = np.where(south & _down(south), stiff * (below - above), 0.0)
    corners = stiff + _left(stiff) + _up(stiff) + _up(_left(stiff))
    twist = np.where(_cells(east, south), 0.5 * corners * (_up(right) - right), 0.0)
    flow_x = force[0] + _left(force[0]) + bend_x - _left(bend_x) + _down(twist) - twist
    flow_x = np.where(east, flow_x + 0.25 * (tension + _left(tension)) * right, 0.0)
    flow_y = force[1] + _up(force[1]) + bend_y - _up(bend_y)
    flow_y = np.where(south, flow_y + 0.25 * (tension + _up(tension)) * below, 0.0)
    return _right(flow_x) - flow_x + _down(flow_y) - flow_y


def gradient(
    s: FloatArray,
    east: BoolArray,
    south: BoolArray,
    free: BoolArray,
    pull: FloatArray,
    stiff: FloatArray,
    tension: FloatArray,
    prior: FloatArray,
    prior_weight: FloatArray,
    out: FloatArray,
    sums: FloatArray,
    first: int,
    last: int,
) -> None:
    """Fill rows of the negative half gradient, 0 where a pixel is not free, and sum the prior's energy.

    Parameters
    ----------
    s, east, south, pull, stiff, tension : arrays
        As for :func:`linearise`.
    free : bool array (h, w)
        Pixels that may move.
    prior, prior_weight : float64 arrays (h, w) or of size 0
        t and μ.
    out : float64 array (h, w)
        Filled on the rows.
    sums : float64 array (h,)
        Filled on the rows: the energy of the prior.
    first, last : int
        Rows.
    """
    total = _divergence(s, east, south, (pull[0], pull[1]), stiff, tension)
    part = slice(first, last)
    sums[part] = 0.0
    if prior_weight.size:
        total += prior_weight * (s - prior)
        sums[part] = (prior_weight * (s - prior) ** 2)[part].sum(axis=1)
    out[part] = np.where(free, -total, 0.0)[part]


def multiply(
    east: BoolArray,
    south: BoolArray,
    free: BoolArray,
    along: FloatArray,
    down: FloatArray,
    stiff: FloatArray,
    tension: FloatArray,
    diagonal: FloatArray,
    direction: FloatArray,
    out: FloatArray,
    sums: FloatArray,
    first: int,
    last: int,
) -> None:
    """Fill rows of the operator times a direction, and their products.

    Parameters
    ----------
    east, south, free : bool arrays (h, w)
        Edges, and pixels that may move.
    along, down, stiff, tension : float arrays (h, w)
        From :func:`linearise`.
    diagonal : float array (h, w)
        What is added on the diagonal.
    direction : float32 array (h + 3, w + 3)
        Padded by one above and on the left; 0 where a pixel is not free.
    out : float64 array (h, w)
        Filled on the rows.
    sums : float64 array (h,)
        Filled on the rows: the sum of direction times result.
    first, last : int
        Rows.
    """
    v = np.asarray(direction[1:-2, 1:-2], np.float64)
    right, left, below, above = _steps(v, east, south)
    change = along * (right + left) + down * (below + above)
    total = _divergence(v, east, south, (along * change, down * change), stiff, tension) + diagonal * v
    part = slice(first, last)
    out[part] = np.where(free, total, 0.0)[part]
    sums[part] = (out * v)[part].sum(axis=1)
