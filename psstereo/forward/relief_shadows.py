"""Shadows that a height field throws under parallel light."""

from typing import ClassVar

import numpy as np

from psstereo.errors import UnsupportedError
from psstereo.forward.horizon import shadow_height
from psstereo.forward.shadows import Shadows
from psstereo.lights import Beam
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["ReliefShadows"]

_ON_NODE = 1e-6
"""Points closer than this to a node are that node: no interpolation, so no rounding either [px]."""


class ReliefShadows(Shadows):
    """Cast shadows of a height field on itself, by the horizon of :func:`psstereo.forward.horizon.shadow_height`.

    Where even the steepest slope of the field is gentler than the light's elevation nothing can be in shadow, and the
    sweep is left out. Not for lamps, whose rays are not parallel: cast rays at a mesh of the field.

    Parameters
    ----------
    height : float array (h, w)
        Heights of the nodes, NaN where there is no surface [length].
    spacing : (float, float)
        Distance of neighbouring columns and of neighbouring rows [length].
    origin : (float, float)
        x and y of the node (0, 0); columns grow with x, rows against y [length].
    """

    name: ClassVar[str] = "horizon sweep"

    def __init__(
        self, height: FloatArray, spacing: tuple[float, float], origin: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        self._height = np.asarray(height, np.float64)
        self._spacing = spacing
        self._origin = origin
        self._steepest = _steepest(self._height, spacing)
        self._last: tuple[FloatArray, _Places] | None = None

    def may_block(self, direction: FloatArray) -> bool:
        """Return whether light from a direction can be blocked at all.

        Parameters
        ----------
        direction : float array (3,)
            Unit vector toward the light [1].

        Returns
        -------
        bool
            False if the light stands higher than the field's steepest slope.
        """
        return bool(direction[2] < self._steepest * np.hypot(direction[0], direction[1]))

    def lit(self, points: FloatArray, normals: FloatArray, beam: Beam) -> BoolArray:
        """Return which points lie above the shadow; see :meth:`Shadows.lit`.

        Raises
        ------
        UnsupportedError
            If the beam is not parallel.
        """
        del normals  # heights are compared, nothing has to step off the surface
        if not beam.parallel:
            raise UnsupportedError(
                given="A lamp at a finite distance shines on a height field.",
                needed="The sweep along the horizon takes parallel light.",
                remedy="Cast rays at a mesh of the height field.",
            )
        if not self.may_block(beam.directions):
            return np.ones(len(points), np.bool_)
        shadow = shadow_height(self._height, self._spacing, beam.directions)
        return np.asarray(points[:, 2] >= self._places(points).read(shadow))

    def _places(self, points: FloatArray) -> "_Places":
        """Return where points lie on the grid; the same points mostly come again, with the next light."""
        known = self._last
        if known is None or known[0] is not points:
            known = points, _Places(points, self._spacing, self._origin, self._height.shape)
            self._last = known
        return known[1]


class _Places:
    """Points as nodes of a grid, or as places between them."""

    def __init__(
        self, points: FloatArray, spacing: tuple[float, float], origin: tuple[float, float], shape: tuple[int, ...]
    ) -> None:
        columns = (points[:, 0] - origin[0]) / spacing[0]
        rows = (origin[1] - points[:, 1]) / spacing[1]
        node_columns, node_rows = np.rint(columns), np.rint(rows)
        off = np.maximum(np.abs(columns - node_columns), np.abs(rows - node_rows))
        inside = (node_columns >= 0) & (node_columns < shape[1]) & (node_rows >= 0) & (node_rows < shape[0])
        self._nodes: IntArray | None = None
        self._between = np.stack([rows, columns])
        if (inside & (off < _ON_NODE)).all():
            self._nodes = np.asarray(node_rows * shape[1] + node_columns, np.intp)

    def read(self, field: FloatArray) -> FloatArray:
        """Return a field's values at the points, linear between nodes."""
        if self._nodes is not None:
            return np.asarray(field.ravel()[self._nodes])
        from scipy.ndimage import map_coordinates

        # Beyond the grid nothing is known to be in the way.
        return np.asarray(map_coordinates(field, self._between, order=1, mode="constant", cval=-np.inf))


def _steepest(height: FloatArray, spacing: tuple[float, float]) -> float:
    """Return a bound on the slope between any two nodes of a field, also across gaps in it [1]."""
    known = ~np.isnan(height)
    if not known.any():
        return 0.0
    if not known.all():
        # Across a gap any two nodes may face each other; the whole relief over one pixel bounds that.
        return float(np.ptp(height[known])) / min(spacing)
    across = np.abs(np.diff(height, axis=1)).max(initial=0.0) / spacing[0]
    along = np.abs(np.diff(height, axis=0)).max(initial=0.0) / spacing[1]
    return float(np.hypot(across, along))
