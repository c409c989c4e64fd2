"""Any heights on a grid, as a smooth surface."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from psstereo.errors import InputError
from psstereo.types import Array, BoolArray, FloatArray, IntArray
from psstereo_synth.shapes.checks import places, positive
from psstereo_synth.shapes.finite import FiniteRelief
from psstereo_synth.shapes.relief import Elevation

if TYPE_CHECKING:
    from scipy.interpolate import RectBivariateSpline

__all__ = ["HeightGrid"]

_TOLERANCE = 1e-9
"""How far outside the outermost heights a place may lie and still count as on the edge, for rounding [cells]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HeightGrid(FiniteRelief):
    """The bicubic spline through heights on a rectangular grid, centred on the origin: C², slopes those of the spline.

    Row 0 is at the top (largest y). A cell between four heights is there if all four are; the spline beside a hole
    depends a little on what is put into the hole, which is the nearest height. Where the heights jump, a spline
    overshoots by about a tenth of the jump: for cliffs take :class:`~psstereo_synth.shapes.cliffs.Cliffs`.

    Attributes
    ----------
    heights : float64 array (h, w)
        Heights, NaN where there is no surface; at least 4 × 4 [length].
    spacing : (float, float)
        Distances of columns along x and of rows along y; they may differ [length].

    Raises
    ------
    InputError
        If the grid is too small, holds infinities or no whole cell, or a distance is not positive.
    """

    name: ClassVar[str] = "grid"
    summary: ClassVar[str] = "Heights on a grid, such as an elevation model, as a smooth surface."
    heights: FloatArray
    spacing: tuple[float, float] = (1.0, 1.0)

    def __post_init__(self) -> None:
        z = np.array(self.heights, np.float64)
        if z.ndim != 2 or min(z.shape) < 4 or np.isinf(z).any():
            infinite = f" and {np.count_nonzero(np.isinf(z))} infinite values" if np.isinf(z).any() else ""
            raise InputError(
                given=f"The heights of a grid have the shape {z.shape}{infinite}.",
                needed="A spline needs at least 4 rows and 4 columns of finite heights, or NaN where there is none.",
                remedy="Give a larger grid, and NaN where nothing is known.",
            )
        if np.size(self.spacing) != 2:
            raise InputError(
                given=f"The spacing of a grid is {self.spacing}.",
                needed="Two distances: of columns along x, and of rows along y.",
                remedy="Give the same distance twice for square cells.",
            )
        dx, dy = (float(value) for value in self.spacing)
        positive("grid of heights", spacing_x=dx, spacing_y=dy)
        z.flags.writeable = False
        object.__setattr__(self, "heights", z)
        object.__setattr__(self, "spacing", (dx, dy))
        if not self._whole.any():
            raise InputError(
                given=f"No cell of a grid of {z.shape[1]} × {z.shape[0]} heights has all its four corners.",
                needed="At least one, or there is no surface.",
                remedy="Check the value that stands for missing heights.",
            )

    @cached_property
    def _whole(self) -> BoolArray:
        """Which cells are there, (h − 1, w − 1)."""
        known = np.isfinite(self.heights)
        return np.asarray(known[1:, 1:] & known[1:, :-1] & known[:-1, 1:] & known[:-1, :-1])

    @cached_property
    def _level(self) -> float:
        """A height in the middle, taken off so that no digits are lost far above the sea."""
        return 0.5 * (float(np.nanmin(self.heights)) + float(np.nanmax(self.heights)))

    @cached_property
    def _spline(self) -> "RectBivariateSpline":
        """The spline over row and column numbers."""
        from scipy.interpolate import RectBivariateSpline
        from scipy.ndimage import distance_transform_edt

        z = self.heights - self._level
        unknown = np.isnan(z)
        if unknown.any():
            nearest = distance_transform_edt(unknown, return_distances=False, return_indices=True)
            z = z[tuple(np.asarray(nearest))]
        return RectBivariateSpline(np.arange(z.shape[0]), np.arange(z.shape[1]), z, s=0)

    @cached_property
    def _bounds(self) -> tuple[float, float]:
        """Bounds of the Bézier points of all cells: the surface lies in their convex hull."""
        rows, columns = (np.arange(n) for n in self.heights.shape)
        f, fy, fx, fxy = (self._spline(rows, columns, dx=i, dy=j) for i, j in ((0, 0), (1, 0), (0, 1), (1, 1)))
        low, high = np.inf, -np.inf
        for down in (0, 1):
            for right in (0, 1):
                corner = slice(down, down - 1 or None), slice(right, right - 1 or None)
                values, by_y, by_x, by_xy = (array[corner][self._whole] for array in (f, fy, fx, fxy))
                v, u = (1 - 2 * down) / 3, (1 - 2 * right) / 3
                for point in (
                    values,
                    values + v * by_y,
                    values + u * by_x,
                    values + v * by_y + u * by_x + u * v * by_xy,
                ):
                    low, high = min(low, float(point.min())), max(high, float(point.max()))
        return low + self._level, high + self._level

    @property
    def bounds(self) -> tuple[float, float]:
        """See :attr:`Relief.bounds`."""
        return self._bounds

    @property
    def extent(self) -> tuple[float, float]:
        """See :attr:`FiniteRelief.extent`."""
        rows, columns = self.heights.shape
        return 0.5 * (columns - 1) * self.spacing[0], 0.5 * (rows - 1) * self.spacing[1]

    def evaluate(self, x: FloatArray, y: FloatArray) -> Elevation:
        """Return the spline's heights and slopes; see :meth:`Relief.evaluate`."""
        x, y = places(x, y)
        rows, columns = self.heights.shape
        right, down = x.ravel() / self.spacing[0], -y.ravel() / self.spacing[1]
        middle, centre = 0.5 * (columns - 1), 0.5 * (rows - 1)
        inside = np.flatnonzero((np.abs(right) <= middle + _TOLERANCE) & (np.abs(down) <= centre + _TOLERANCE))
        u, v = np.clip(right[inside] + middle, 0, columns - 1), np.clip(down[inside] + centre, 0, rows - 1)
        there = self._there(v, u)
        inside, u, v = inside[there], u[there], v[there]
        out = np.full((3, x.size), np.nan)
        out[0, inside] = self._spline.ev(v, u) + self._level
        out[1, inside] = self._spline.ev(v, u, dy=1) / self.spacing[0]
        out[2, inside] = -self._spline.ev(v, u, dx=1) / self.spacing[1]
        height, slope_x, slope_y = out.reshape(3, *x.shape)
        return Elevation(height=height, slope_x=slope_x, slope_y=slope_y)

    def _there(self, row: FloatArray, column: FloatArray) -> BoolArray:
        """Return whether places lie in a cell that is there; on a line between two cells, in either."""
        found = np.zeros(row.shape, bool)
        for i in _cells(row, self._whole.shape[0]):
            for j in _cells(column, self._whole.shape[1]):
                found |= self._whole[i, j]
        return found


def _cells(number: FloatArray, count: int) -> tuple[IntArray, IntArray]:
    """Return the cell before and the one after; the same twice, except on a line."""
    after, before = np.floor(number), np.ceil(number) - 1.0
    return _clipped(before, count), _clipped(after, count)


def _clipped(number: Array, count: int) -> IntArray:
    return np.clip(number, 0, count - 1).astype(np.intp)
