"""Frames laid over one another by their paint: short details of the logarithm, which the light hardly changes."""

import numpy as np

from psstereo.calibrate.registration.grid import Grid, Placed, looked_up, robust_fit, slopes
from psstereo.types import BoolArray, FloatArray

__all__ = ["place_by_paint"]

_SHADOW = 0.05
"""Share of a frame's brightest below which a pixel is in shadow."""
_FLOOR = 0.01
"""Share of a frame's brightest that is added before the logarithm, against noise. More would let the light through."""
_GROWN = 5
"""Size of the square by which shadows and unknown pixels are grown [px]."""
_BLUR = 1.0
_COARSE, _FINE = 6.0, 2.0
"""Standard deviations of what is taken for shading and taken out [px]."""
_ROUNDS = 12
_SETTLED = 2e-3
"""Largest move of a round from which rounds end [px]."""
_ALIKE = 16.0
"""Pixels whose misfits hang together."""


def place_by_paint(light: FloatArray, moves: FloatArray, grid: Grid, reference: int, *, fine: bool = False) -> Placed:
    """Move each frame until its details are those of the mean of all others.

    Parameters
    ----------
    light : float32 array (m, h, w)
        Frames; NaN where unknown.
    moves : float64 array (m, 3, 3)
        To begin with [px].
    grid : Grid
        What is compared.
    reference : int
        The frame that stays.
    fine : bool
        Whether to begin with the finest details, for frames that are nearly in place.

    Returns
    -------
    Placed
        The moves; the agreement is the mean correlation of a frame's details with those of the others' mean [1].
    """
    found = Placed(moves=moves, errors=np.full(len(light), np.inf), agreement=0.0, rounds=0, converged=False)
    for smooth in (_FINE,) if fine else (_COARSE, _FINE):
        details = np.stack([_detail(frame, smooth) for frame in light])
        found = _settle(details, found, grid, reference)
    return found


def _detail(frame: FloatArray, smooth: float) -> FloatArray:
    """Return the high-passed logarithm; NaN near shadows and unknown pixels, whose edges go with the light."""
    import cv2

    known = np.isfinite(frame)
    top = float(np.quantile(frame[known], 0.99))
    blurred = np.asarray(cv2.GaussianBlur(np.where(known, frame, top).astype(np.float32), (0, 0), _BLUR))
    level = np.log(np.maximum(blurred, 0.0) + _FLOOR * top)
    high = level - np.asarray(cv2.GaussianBlur(level, (0, 0), smooth))
    out = ~known | (blurred < _SHADOW * top)
    high[cv2.dilate(out.astype(np.uint8), np.ones((_GROWN, _GROWN), np.uint8)) > 0] = np.nan
    return high


def _settle(details: FloatArray, start: Placed, grid: Grid, reference: int) -> Placed:
    moves = start.moves
    rounds, converged = 0, False
    found: list[tuple[FloatArray, float, float]] = []
    while rounds < _ROUNDS and not converged:
        rounds += 1
        warped = np.stack([looked_up(one, move) for one, move in zip(details, moves, strict=True)])
        known = np.isfinite(warped)
        total, count = np.where(known, warped, 0.0).sum(axis=0), known.sum(axis=0)
        found = []
        for one, seen in zip(warped, known, strict=True):
            others = np.maximum(count - seen, 1)
            mean = np.where(count > seen, (total - np.where(seen, one, 0.0)) / others, np.nan)
            found.append(_step(one[grid.inside], mean[grid.inside], grid.columns_of(slopes(mean, grid.inside))))
        before = moves
        moves = moves @ np.stack([grid.move(step) for step, _, _ in found])
        moves = moves @ np.linalg.inv(moves[reference])
        converged = grid.furthest(moves - before) < _SETTLED
    return Placed(
        moves=moves,
        errors=np.sqrt([variance for _, variance, _ in found]),
        agreement=float(np.mean([correlation for _, _, correlation in found])),
        rounds=start.rounds + rounds,
        converged=converged,
    )


def _step(seen: FloatArray, mean: FloatArray, columns: FloatArray) -> tuple[FloatArray, float, float]:
    """Return the step of one frame, its variance [px²], and the correlation of its details with the mean."""
    base: BoolArray = np.isfinite(seen) & np.isfinite(mean) & np.isfinite(columns).all(axis=0)
    value, target = np.where(base, seen, 0.0), np.where(base, mean, 0.0)
    design = np.vstack([np.where(base, columns, 0.0), -target, -np.ones(len(target))]).astype(np.float64)
    solution, left, weight, matrix = robust_fit(design, value, base)
    total = max(float(weight.sum()), 1.0)
    inverse = np.linalg.inv(matrix)
    variance = _ALIKE * float(weight @ left**2) / total * float(inverse[0, 0] + inverse[1, 1])
    a, b = value - weight @ value / total, target - weight @ target / total
    spread = np.sqrt(float(weight @ a**2) * float(weight @ b**2))
    return solution[:-2], variance, float(weight @ (a * b)) / spread if spread > 0 else 0.0
