"""Differences on a rectangular grid of heights: slopes, bending, and their matrices as band tables."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from psstereo.types import FloatArray

__all__ = ["LEAST", "Stencils"]

LEAST = 8
"""Rows and columns that a grid must have, so that differences of sixth order fit in [px]."""

_CENTRAL: dict[int, tuple[float, ...]] = {1: (0.5,), 2: (2 / 3, -1 / 12), 3: (0.75, -0.15, 1 / 60)}
"""Weights of the neighbours at distance 1, 2, 3 in central differences of second, fourth and sixth order."""


@dataclass(frozen=True, eq=False)
class Stencils:
    """Slopes and bending energy of heights on a grid.

    Slopes are central differences of sixth order, of lower order beside the border. Second order, which is common,
    finds 64 % of the slope of a wave four pixels long, sixth order 93 %; what is missing there is made up for by waves
    that are too high. (The mean slope over a pixel's area, which a camera sees, is 90 % of that at its centre.)

    Attributes
    ----------
    shape : (int, int)
        Rows and columns, at least `LEAST` of each.
    cell : (float, float)
        Distances of columns and rows [length].
    """

    shape: tuple[int, int]
    cell: tuple[float, float]

    @cached_property
    def _matrices(self) -> tuple[Any, Any]:
        """Sparse differences along columns and along rows; y grows up, rows run down."""
        height, width = self.shape
        return (_difference(width) / self.cell[0]).tocsr(), (-_difference(height) / self.cell[1]).tocsr()

    def slopes(self, heights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the slopes along x and y, float64 (h, w) each [1]."""
        x, y = self._matrices
        return np.ascontiguousarray((x @ heights.T).T), np.asarray(y @ heights)

    def slopes_back(self, along_x: FloatArray, along_y: FloatArray) -> FloatArray:
        """Return the transposed slopes of two fields, float64 (h, w): Gᵀ (along_x, along_y)."""
        x, y = self._matrices
        return np.asarray((x.T @ along_x.T).T + y.T @ along_y)

    @cached_property
    def slope_bands(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Band tables of the differences and of their transposes, (7, w), (h, 7), (7, w), (h, 7)."""
        x, y = self._matrices
        return _band(x), _band(y).T.copy(), _band(x.T), _band(y.T).T.copy()

    @cached_property
    def bend_bands(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Band tables of the bending energy per unit weight: along x, along y, and the two factors of the twist.

        The energy is Σ dx dy (z_xx² + 2 z_xy² + z_yy²), the squared change of slope from cell to cell.
        """
        height, width = self.shape
        dx, dy = self.cell
        area = dx * dy
        x, y = (_square(_second(n)) for n in (width, height))
        x_twist, y_twist = (_square(_first(n)) for n in (width, height))
        twist = 2.0 * area / (dx * dy) ** 2
        return (
            _band(x * (area / dx**4)),
            _band(y * (area / dy**4)).T.copy(),
            _band(x_twist * twist),
            _band(y_twist).T.copy(),
        )

    def bend(self, heights: FloatArray) -> FloatArray:
        """Return the bending energy's matrix times heights, for unit weight, float64 (h, w)."""
        height, width = self.shape
        dx, dy = self.cell
        area = dx * dy
        x, y = (_square(_second(n)) for n in (width, height))
        x_twist, y_twist = (_square(_first(n)) for n in (width, height))
        out = (x @ heights.T).T * (area / dx**4) + y @ heights * (area / dy**4)
        return np.asarray(out + (x_twist @ (y_twist @ heights).T).T * (2.0 * area / (dx * dy) ** 2))

    def symbols(self, rows: FloatArray, columns: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return what slopes along x and y (times −i) and the bending energy do to plane waves.

        Parameters
        ----------
        rows, columns : float64 arrays
            Wave numbers along rows and columns, which broadcast together [rad/px].

        Returns
        -------
        float64 arrays
            Of the shapes of `columns`, `rows` and both.
        """
        dx, dy = self.cell
        x, y = (_symbol(wave) for wave in (columns, rows))
        bend = (2.0 - 2.0 * np.cos(columns)) / dx**2 + (2.0 - 2.0 * np.cos(rows)) / dy**2
        return x / dx, -y / dy, dx * dy * bend * bend


def _symbol(wave: FloatArray) -> FloatArray:
    """Return what the sixth-order difference does to waves, times −i."""
    return np.asarray(2.0 * sum(weight * np.sin((k + 1) * wave) for k, weight in enumerate(_CENTRAL[3])))


def _difference(count: int) -> Any:
    """Return the sparse matrix of first derivatives on `count` nodes one apart."""
    from scipy.sparse import csr_array

    reach = np.minimum(np.minimum(np.arange(count), np.arange(count)[::-1]), 3)
    rows, columns, values = [0, 0, 0], [0, 1, 2], [-1.5, 2.0, -0.5]
    for i in range(1, count - 1):
        for k, weight in enumerate(_CENTRAL[int(reach[i])], start=1):
            rows += [i, i]
            columns += [i + k, i - k]
            values += [weight, -weight]
    rows += [count - 1] * 3
    columns += [count - 1, count - 2, count - 3]
    values += [1.5, -2.0, 0.5]
    return csr_array((values, (rows, columns)), shape=(count, count))


def _first(count: int) -> Any:
    """Return the sparse matrix of steps from node to node."""
    from scipy.sparse import diags_array

    return diags_array([-1.0, 1.0], offsets=[0, 1], shape=(count - 1, count)).tocsr()


def _second(count: int) -> Any:
    """Return the sparse matrix of second differences."""
    return (_first(count - 1) @ _first(count)).tocsr()


def _square(matrix: Any) -> Any:
    return (matrix.T @ matrix).tocsr()


def _band(matrix: Any) -> FloatArray:
    """Return the seven middle diagonals of a square matrix, (7, n): entry (k, j) multiplies value j + k − 3."""
    count = matrix.shape[0]
    table = np.zeros((7, count))
    for k in range(7):
        offset = k - 3
        diagonal = matrix.diagonal(offset)
        start = max(0, -offset)
        table[k, start : start + diagonal.size] = diagonal
    return table
