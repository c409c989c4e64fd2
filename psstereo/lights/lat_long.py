"""Geometry of latitude-longitude maps, and the irradiance from one in closed form.

The cell in row i and column j of a map (h, w) covers the polar angles θ from πi/h to π(i+1)/h, counted from +y, and the
azimuths φ from −π + 2πj/w to −π + 2π(j+1)/w, with the direction

    ω = (−sinθ sinφ, cosθ, sinθ cosφ)

so that the middle of the map looks along +z, its left half along +x, and both its sides along −z.

A surface with the unit normal n, turned so that n_y ≥ 0, sees at the azimuth φ what lies above the horizon θ_h(φ). With
s = √(n_x² + n_z²), u the azimuth counted from that of n, and a = s cos u:

    n·ω = n_y cosθ + a sinθ,   θ_h = atan2(n_y, −a)

The integral of L (n·ω) sinθ over θ from 0 to θ_h is, as long as the horizon stays in one cell,

    n_y K₁ + a K₂ + ½ L a θ_h

where K₁ and K₂ hold sums over the cells above. Its integral over u is closed too, by ∫ a θ_h du = G(u) with

    G = s sin u θ_h + atan2(n_y sin u, cos u) − n_y u

Hence the irradiance is a sum over the w + 2h pieces of the horizon between the borders of cells, exact for radiance
that is constant in each cell, whatever the size of the map.
"""

from collections.abc import Callable

import numpy as np

from psstereo.types import Array, FloatArray

__all__ = [
    "cell_solid_angles",
    "cell_squares",
    "cell_vectors",
    "cells_at",
    "column_sums",
    "horizon_irradiance",
    "lat_long_directions",
]


def cell_squares(height: int, width: int) -> Callable[[FloatArray, int, int, int, int], FloatArray]:
    """Return a function of a map (height, width) and of a box in it that returns ∫ L ω ωᵀ dω over the box, (3, 3).

    The box is given by its first row, the row after its last one, and the same for columns.
    """
    nodes, shares = np.polynomial.legendre.leggauss(12)  # to rounding, even for cells as large as octants
    steps = 0.5 + 0.5 * nodes
    theta = np.pi / height * (np.arange(height)[:, None] + steps)
    phi = 2.0 * np.pi / width * (np.arange(width)[:, None] + steps) - np.pi
    # ω ωᵀ is a product in θ times a product in φ, component by component.
    polar = np.stack([np.sin(theta), np.cos(theta), np.sin(theta)])
    around = np.stack([-np.sin(phi), np.ones_like(phi), np.cos(phi)])
    down = np.einsum("aik,bik,ik,k->abi", polar, polar, np.sin(theta), shares * (0.5 * np.pi / height))
    along = np.einsum("ajk,bjk,k->abj", around, around, shares * (np.pi / width))

    def square(radiance: FloatArray, a: int, b: int, c: int, d: int) -> FloatArray:
        return np.asarray(np.einsum("xyi,ij,xyj->xy", down[..., a:b], radiance[a:b, c:d], along[..., c:d]))

    return square


def column_sums(radiance: FloatArray) -> FloatArray:
    """Return what :func:`horizon_irradiance` needs to know of a map, for normals in its upper hemisphere.

    Parameters
    ----------
    radiance : float64 array (h, w, c)
        L [W m⁻² sr⁻¹], or relative.

    Returns
    -------
    float64 array (h, w, 3, c)
        K₁, K₂ and ½ L of a horizon in each cell, side by side since they are wanted together.
    """
    theta = np.linspace(0.0, np.pi, len(radiance) + 1)[:, None, None]
    square, wedge = 0.5 * np.sin(theta) ** 2, 0.5 * theta - 0.25 * np.sin(2.0 * theta)
    sums = np.zeros((*radiance.shape[:2], 3, radiance.shape[2]))
    for k, antiderivative in enumerate((square, wedge)):
        np.cumsum(radiance[:-1] * np.diff(antiderivative, axis=0)[:-1], axis=0, out=sums[1:, :, k])
        sums[:, :, k] -= radiance * antiderivative[:-1]
    sums[:, :, 2] = 0.5 * radiance
    sums[:, :, 0] += sums[:, :, 2]
    return sums


def lat_long_directions(height: int, width: int) -> FloatArray:
    """Return the directions in which the middles of a map's pixels look.

    Parameters
    ----------
    height, width : int
        Rows and columns [pixel].

    Returns
    -------
    float64 array (height, width, 3)
        Unit vectors: row 0 near +y, the middle of the map along +z, its left half along +x [1].
    """
    theta = (np.pi * (np.arange(height) + 0.5) / height)[:, None]
    phi = 2.0 * np.pi * (np.arange(width) + 0.5) / width - np.pi
    parts = -np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def cells_at(directions: FloatArray, height: int, width: int) -> tuple[Array, Array]:
    """Return the rows and columns of the cells that hold some finite directions (..., 3), int64 (...) each."""
    x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
    theta, phi = np.arctan2(np.hypot(x, z), y), np.arctan2(-x, z)
    rows = np.clip((theta * (height / np.pi)).astype(np.int64), 0, height - 1)
    columns = ((phi + np.pi) * (width / (2.0 * np.pi))).astype(np.int64) % width
    return rows, columns


def cell_solid_angles(height: int, width: int) -> FloatArray:
    """Return the solid angle of a cell in each row, float64 (height,): 2π/w · (cos θ_i − cos θ_i+1) [sr]."""
    middle = np.pi * (np.arange(height) + 0.5) / height
    return np.asarray(4.0 * np.pi / width * np.sin(middle) * np.sin(0.5 * np.pi / height))  # nothing cancels


def cell_vectors(height: int, width: int) -> FloatArray:
    """Return ∫ ω dω over each cell, float64 (height, width, 3) [sr]."""
    middle, half = np.pi * (np.arange(height) + 0.5) / height, 0.5 * np.pi / height
    phi = 2.0 * np.pi * (np.arange(width) + 0.5) / width - np.pi
    chord = 2.0 * np.sin(np.pi / width)
    # Differences of θ/2 − sin 2θ/4 and of sin²θ/2 over a row, by the sum formulas.
    outward = (half - 0.5 * np.cos(2.0 * middle) * np.sin(2.0 * half))[:, None]
    upward = (0.5 * np.sin(2.0 * middle) * np.sin(2.0 * half) * 2.0 * np.pi / width)[:, None]
    parts = -outward * chord * np.sin(phi), upward, outward * chord * np.cos(phi)
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def horizon_irradiance(sums: FloatArray, normals: FloatArray) -> FloatArray:
    """Return the irradiance from a map, of normals in its upper hemisphere.

    Parameters
    ----------
    sums : float64 array (h, w, 3, c)
        The map, by :func:`column_sums`.
    normals : float64 array (p, 3)
        Unit normals with y ≥ 0 in the map's frame [1].

    Returns
    -------
    float64 array (p, c)
        Irradiance [W m⁻²], or relative.
    """
    height, width, _, channels = sums.shape
    up = np.abs(normals[:, 1:2])  # no negative zero, which would turn the branch of atan2
    side = np.hypot(normals[:, :1], normals[:, 2:])
    azimuth = np.arctan2(-normals[:, :1], normals[:, 2:])
    u = _borders(up, side, azimuth, height, width)
    sine, cosine = np.sin(u), np.cos(u)
    closed = side * sine * np.arctan2(up, -side * cosine) + np.arctan2(up * sine, cosine) - up * u
    # The horizon rises and falls with cos u, so that the mean of its ends' cosines belongs to the piece between them.
    level = np.arctan2(up, -0.5 * side * (cosine[:, 1:] + cosine[:, :-1]))
    rows = (level * (height / np.pi)).astype(np.int64)
    middle = azimuth + 0.5 * (u[:, 1:] + u[:, :-1]) + 3.0 * np.pi  # one turn more, since integers are cut toward 0
    columns = (middle * (width / (2.0 * np.pi))).astype(np.int64) % width
    cells = np.minimum(rows, height - 1) * width + columns
    factors = np.stack([up * np.diff(u), side * np.diff(sine), np.diff(closed)], axis=-1)
    tables = sums.reshape(height * width, 3 * channels)[cells]
    terms = factors.reshape(len(normals), 1, -1) @ tables.reshape(len(normals), -1, channels)
    return np.asarray(np.maximum(terms[:, 0], 0.0))


def _borders(up: FloatArray, side: FloatArray, azimuth: FloatArray, height: int, width: int) -> FloatArray:
    """Return where each normal's horizon enters another cell, as azimuths from −π to π counted from the normal's."""
    theta = np.linspace(0.0, np.pi, height + 1)[1:-1]
    flat, rise = side * np.sin(theta), up * np.cos(theta)
    # Circles of latitude that the horizon does not reach give 0 or π: pieces without width.
    reach = np.arctan2(np.sqrt(np.maximum((flat - rise) * (flat + rise), 0.0)), -rise)
    meridians = 2.0 * np.pi / width * np.arange(width) - np.pi - azimuth
    meridians -= 2.0 * np.pi * np.floor((meridians + np.pi) / (2.0 * np.pi))
    end = np.full_like(azimuth, np.pi)
    # The lowest point parts a piece whose ends lie on the same circle, so that one end tells its row.
    lowest = np.zeros_like(azimuth)
    u = np.concatenate([-end, lowest, np.clip(meridians, -np.pi, np.pi), reach, -reach, end], axis=1)
    u.sort(axis=1)
    return u
