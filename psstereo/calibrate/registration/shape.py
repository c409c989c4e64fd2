"""Frames laid over one another by their shading: each is nearly a mixture of three others, if all are in place."""

import numpy as np

from psstereo.calibrate.registration.grid import Grid, Placed, looked_up, robust_fit, slopes
from psstereo.types import BoolArray, FloatArray

__all__ = ["place_by_shape"]

_RANK = 3
"""Frames that any other of a matte surface is a mixture of; a constant is added to them."""
_SHADOW = 0.03
"""Share of a frame's brightest below which a pixel is in shadow, where mixtures do not hold."""
_ROUNDS = 40
_SETTLED = 2e-3
"""Largest move of a round from which rounds end [px]."""
_ALIKE = 16.0
"""Pixels whose misfits hang together: shadows and highlights are patches."""


def place_by_shape(light: FloatArray, start: Placed, grid: Grid, reference: int, rounds: int = _ROUNDS) -> Placed:
    """Move each frame until it is what a mixture of the others makes of it.

    Values that a mixture contradicts, at shadows and highlights, are replaced by what it predicts. Not where the
    surface is nearly flat and painted: there the mixtures can hold a move as well.

    Parameters
    ----------
    light : float32 array (m, h, w)
        Frames; NaN where unknown.
    start : Placed
        Moves to begin with.
    grid : Grid
        What is compared.
    reference : int
        The frame that stays.
    rounds : int
        Rounds at most.

    Returns
    -------
    Placed
        The moves; the agreement is the root-mean-square misfit over the frames' brightness [1].
    """
    moves = start.moves
    known: FloatArray | None = None
    weights = np.ones((len(light), len(grid.columns)), np.float32)
    done, converged = 0, False
    while done < rounds and not converged:
        done += 1
        warped = np.stack([looked_up(frame, move) for frame, move in zip(light, moves, strict=True)])
        seen = warped[:, grid.inside]
        guess = np.zeros_like(seen) if known is None else known
        share = np.where(np.isfinite(seen), weights, 0.0)
        data = np.where(share > 0, share * np.nan_to_num(seen) + (1.0 - share) * guess, guess)
        gram = data @ data.T
        found = [
            _fit(seen[i], grid.columns_of(slopes(warped[i], grid.inside)), _others(data, gram, i))
            for i in range(len(light))
        ]
        known, weights = np.stack([one[2] for one in found]), np.stack([one[3] for one in found])
        before = moves
        moves = moves @ np.stack([grid.move(one[0]) for one in found])
        moves = moves @ np.linalg.inv(moves[reference])
        converged = grid.furthest(moves - before) < _SETTLED
    total = max(float(weights.sum()), 1.0)
    return Placed(
        moves=moves,
        errors=np.sqrt([one[1] for one in found]),
        agreement=float(np.sqrt(sum(one[4] for one in found) / total)),
        rounds=start.rounds + done,
        converged=converged,
    )


def _others(data: FloatArray, gram: FloatArray, one: int) -> FloatArray:
    """Return the three leading mixtures of all frames but one, and a constant, float32 (4, n)."""
    keep = np.arange(len(data)) != one
    values, vectors = np.linalg.eigh(gram[np.ix_(keep, keep)].astype(np.float64))
    mixing = np.zeros((_RANK, len(data)), np.float32)
    mixing[:, keep] = (vectors[:, -_RANK:] / np.sqrt(np.maximum(values[-_RANK:], 1e-30))).T
    return np.vstack([mixing @ data, np.full((1, data.shape[1]), 1.0 / np.sqrt(data.shape[1]), np.float32)])


def _fit(
    seen: FloatArray, columns: FloatArray, basis: FloatArray
) -> tuple[FloatArray, float, FloatArray, FloatArray, float]:
    """Fit a frame by a mixture of the others and a move at once.

    Returns the move's numbers, the variance of the first two, the prediction, the weights and the sum of squares.
    """
    base: BoolArray = np.isfinite(seen) & np.isfinite(columns).all(axis=0)
    value = np.where(base, seen, 0.0).astype(np.float64)
    design = np.vstack([np.where(base, columns, 0.0), -basis]).astype(np.float64)
    base &= value > _SHADOW * float(np.quantile(value, 0.99))
    solution, left, weight, matrix = robust_fit(design, value, base)
    squares = float(weight @ left**2)
    inverse = np.linalg.inv(matrix)
    variance = _ALIKE * squares / max(float(weight.sum()), 1.0) * float(inverse[0, 0] + inverse[1, 1])
    count = len(columns)
    predicted = np.asarray(solution[count:] @ basis, np.float32)
    return solution[:count], variance, predicted, weight.astype(np.float32), squares
