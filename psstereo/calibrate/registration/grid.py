"""The pixels that frames are compared at, and moves of them."""

from dataclasses import dataclass

import numpy as np

from psstereo.stack.warped import interpolated
from psstereo.types import BoolArray, FloatArray

__all__ = ["Grid", "Placed", "looked_up", "robust_fit", "slopes"]

_ROUNDS = 3
"""Rounds of a robust fit: the first takes all, the others what lies near the one before."""
_CUT = 4.685
"""Residual over its scale from which a pixel is left out, Tukey's number."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """Where frames were found.

    Attributes
    ----------
    moves : float64 array (m, 3, 3)
        Place (x, y, 1) of the reference is found at ``move @ (x, y, 1)`` [px].
    errors : float64 array (m,)
        Standard errors by the misfit alone [px].
    agreement : float
        How well the frames agree: a correlation, or a residual, as the method says [1].
    rounds : int
        Rounds that were needed.
    converged : bool
        Whether nothing moved any more.
    """

    moves: FloatArray
    errors: FloatArray
    agreement: float
    rounds: int
    converged: bool


@dataclass(frozen=True, eq=False)
class Grid:
    """Compared pixels.

    Attributes
    ----------
    inside : bool array (h, w)
        Which they are.
    columns, rows : float64 array (n,)
        Where they are [px].
    model : {"shift", "affine"}
        What moves are like.
    """

    inside: BoolArray
    columns: FloatArray
    rows: FloatArray
    model: str

    @classmethod
    def of(cls, inside: BoolArray, model: str) -> "Grid":
        """List the pixels of a mask."""
        rows, columns = (axis.astype(np.float64) for axis in np.nonzero(inside))
        return cls(inside, columns, rows, model)

    @property
    def middle(self) -> FloatArray:
        """Mean column and row [px]."""
        return np.array([self.columns.mean(), self.rows.mean()])

    @property
    def reach(self) -> float:
        """How far pixels are from the middle at most [px]."""
        x, y = self.middle
        return max(float(np.hypot(self.columns - x, self.rows - y).max()), 1.0)

    def columns_of(self, gradient: FloatArray) -> FloatArray:
        """Return what a unit of each number of a move changes, (2, n) or (6, n), from the slopes (2, n)."""
        if self.model == "shift":
            return gradient
        x, y = (np.stack([self.columns, self.rows]) - self.middle[:, None]) / self.reach
        return np.vstack([gradient, gradient * x, gradient * y])

    def move(self, found: FloatArray) -> FloatArray:
        """Return a move (3, 3) of its two or six numbers."""
        matrix = np.eye(3)
        linear = found[2:].reshape(2, 2).T / self.reach if len(found) == 6 else np.zeros((2, 2))
        matrix[:2, :2] += linear
        matrix[:2, 2] = found[:2] - linear @ self.middle
        return matrix

    def furthest(self, change: FloatArray) -> float:
        """Return how far the corners of the compared part go at most under differences of moves (m, 3, 3) [px]."""
        x, y = np.array([self.columns.min(), self.columns.max()]), np.array([self.rows.min(), self.rows.max()])
        corners = np.stack([x[[0, 1, 0, 1]], y[[0, 0, 1, 1]], np.ones(4)])
        return float(np.linalg.norm((change @ corners)[:, :2], axis=1).max())


def looked_up(frame: FloatArray, move: FloatArray) -> FloatArray:
    """Return a frame (h, w) where a move puts its pixels; NaN outside."""
    rows, columns = np.indices(frame.shape, dtype=np.float64)
    along = move[:2, 0, None, None] * columns + move[:2, 1, None, None] * rows + move[:2, 2, None, None]
    places = np.ascontiguousarray(along, np.float32)
    return interpolated(frame, places[0], places[1])[..., 0]


def slopes(frame: FloatArray, inside: BoolArray) -> FloatArray:
    """Return the slopes to the right and down at the compared pixels, (2, n) [1/px]."""
    down, right = np.gradient(frame)
    return np.stack([np.asarray(right)[inside], np.asarray(down)[inside]])


def robust_fit(
    design: FloatArray, value: FloatArray, base: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Fit ``value + solution · design = 0`` by least squares that leave out what lies far off the rest.

    Parameters
    ----------
    design : float64 array (k, n)
        What the solution multiplies.
    value : float64 array (n,)
        What is to be made up for.
    base : bool array (n,)
        Which of them take part.

    Returns
    -------
    solution : float64 array (k,)
        The factors.
    left : float64 array (n,)
        What is left.
    weight : float64 array (n,)
        How much each took part, in the end [1].
    matrix : float64 array (k, k)
        Normal matrix of the last solution.
    """
    weight: FloatArray = base.astype(np.float64)
    for _ in range(_ROUNDS):
        weighted = design * weight
        matrix = weighted @ design.T
        matrix += np.diag(1e-9 * np.diagonal(matrix) + 1e-30)
        solution = -np.linalg.solve(matrix, weighted @ value)
        left = value + solution @ design
        weight = _tukey(left, base)
    return solution, left, weight, matrix


def _tukey(left: FloatArray, base: BoolArray) -> FloatArray:
    """Return weights that leave out what lies far off the rest, float64 (n,)."""
    spread = 1.4826 * float(np.median(np.abs(left[base]))) + 1e-9 if base.any() else 1.0
    return np.asarray(base * np.maximum(1.0 - (left / (_CUT * spread)) ** 2, 0.0) ** 2)
