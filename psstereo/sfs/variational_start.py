"""The surface to begin with, on the coarsest grid."""

import numpy as np

from psstereo.depth.edges import EdgeSteps
from psstereo.depth.weighted import solve_weighted
from psstereo.sfs.variational_grid import Grid
from psstereo.types import BoolArray, FloatArray

__all__ = ["RELIEFS", "first_surface"]

RELIEFS = {"flat": 0.0, "convex": 1.0, "concave": -1.0}
"""What the surface begins as, and on which side of its border it lies."""
_STIFF = 1e6
"""Weight that holds a height beside edges of weight 1."""
_SOFT = 1e-4
"""Weight of a spring so soft and far away that it is a constant force."""
_SLOPE = 0.5
"""Steepest slope of a dome, about where a light at 30 degrees tells most [1]."""


def first_surface(grid: Grid, relief: str, *, toward_camera: float) -> FloatArray:
    """Return the tightest skin over known heights and prior, flat where there are none, bulged if wanted.

    Parameters
    ----------
    grid : Grid
        The coarsest grid.
    relief : str
        A key of ``RELIEFS``.
    toward_camera : float
        1 if heights grow toward the camera, −1 if away.

    Returns
    -------
    float64 array (h, w)
        Heights, 0 outside [px].
    """
    known = grid.inside & ~grid.free
    held, value = known.copy(), grid.known.copy()
    if grid.prior_weight.size:
        wanted = grid.free & (grid.prior_weight > 0)
        held, value = held | wanted, np.where(wanted, grid.prior, value)
    middle = float(value[held].mean()) if held.any() else 0.0
    surface = _skin(grid, np.where(held, _STIFF, 0.0), np.where(held, value - middle, 0.0)) + middle
    side = RELIEFS[relief] * toward_camera
    if side:
        surface = surface + side * _dome(grid, known)
    return np.where(grid.inside, np.where(known, grid.known, surface), 0.0)


def _dome(grid: Grid, known: BoolArray) -> FloatArray:
    """Return a bulge over the pixels that are not held, zero at known ones or at the border."""
    inner = grid.inside & grid.east & grid.south
    inner[:, 1:] &= grid.east[:, :-1]
    inner[1:] &= grid.south[:-1]
    inner[:, 0], inner[0] = False, False
    held = known if known.any() else grid.inside & ~inner
    dome = _skin(grid, np.where(held, _STIFF, _SOFT), np.where(held, 0.0, 1.0 / _SOFT))
    right = np.abs(np.diff(dome, axis=1))[grid.east[:, :-1]]
    down = np.abs(np.diff(dome, axis=0))[grid.south[:-1]]
    steepest = max(float(right.max(initial=0.0)), float(down.max(initial=0.0)))
    return dome * (_SLOPE / steepest) if steepest > 0 else dome


def _skin(grid: Grid, weight: FloatArray, value: FloatArray) -> FloatArray:
    """Return the surface of least squared steps that springs hold."""
    east, south = grid.east[:, :-1].astype(np.float64), grid.south[:-1].astype(np.float64)
    steps = EdgeSteps(
        right=np.zeros_like(east), down=np.zeros_like(south), right_weight=east, down_weight=south, left_out=0
    )
    return solve_weighted(steps, grid.inside, prior=value, prior_weight=weight, tolerance=1e-6).values
