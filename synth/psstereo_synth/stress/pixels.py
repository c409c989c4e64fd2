"""What the cases for normal solvers share: pixels that have nothing to do with each other, and errors against truth."""

from typing import Any

import numpy as np

from psstereo.bench.stress import Answer
from psstereo.capture import Capture
from psstereo.lights import Rig
from psstereo.normals import NormalSolver, estimate_normals
from psstereo.results import NormalsResult
from psstereo.stack import MemoryStack
from psstereo.types import Array, FloatArray

__all__ = ["PROMISED", "angles", "cap", "eps", "exact_bound", "relative", "solved", "spread"]

PROMISED = float(np.radians(1e-6))
"""What solvers that iterate promise on exact matte data of moderate condition [rad]."""


def eps(kind: str) -> float:
    """Return the distance of 1 from the next number of a type of data [1]."""
    return float(np.finfo(kind).eps)


def exact_bound(directions: FloatArray, kind: str, *, iterates: bool = False) -> float:
    """Return C κ ε, what the rounding of data alone may do to the length-weighted normal, C = 8 √m.

    Parameters
    ----------
    directions : float array (m, 3)
        Unit directions toward the lights [1].
    kind : str
        Type of the data.
    iterates : bool
        Whether the method stops at a tolerance, which adds what it promises, `PROMISED`, times its condition over 100.

    Returns
    -------
    float
        Relative error [1].
    """
    condition = float(np.linalg.cond(directions))
    more = PROMISED * max(1.0, condition / 100.0) if iterates else 0.0
    return float(8.0 * np.sqrt(len(directions)) * condition * eps(kind) + more)


def cap(count: int, tilt: float, seed: int = 0) -> FloatArray:
    """Return unit normals (p, 3) spread evenly up to an angle from the view [rad]."""
    rng = np.random.default_rng(seed)
    drop = 2.0 * np.sin(tilt / 2.0) ** 2 * rng.random(count)
    turn, radius = 2.0 * np.pi * rng.random(count), np.sqrt(drop * (2.0 - drop))
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), 1.0 - drop], axis=1)


def solved(
    values: Array,
    directions: FloatArray,
    solver: NormalSolver[Any] | None = None,
    *,
    strengths: FloatArray | None = None,
    white: float | None = None,
) -> NormalsResult:
    """Solve samples (m, p) as a capture of one row, by way of the public interface."""
    stack = MemoryStack(np.ascontiguousarray(values[:, None, :]), white=white)
    return estimate_normals(Capture(stack=stack, rig=Rig.distant(directions, strengths)), solver)


def angles(found: NormalsResult, truth: FloatArray) -> FloatArray:
    """Return angles between normals of a row and true ones (p, 3), NaN where there is none [rad]."""
    normals = np.asarray(found.normals[0], np.float64)
    across = np.linalg.norm(np.cross(normals, truth), axis=-1)
    return np.asarray(np.arctan2(across, (normals * truth).sum(axis=-1)))


def relative(found: NormalsResult, scaled: FloatArray) -> FloatArray:
    """Return the errors of albedo times normal beside true ones (p, 3) [1]."""
    b = np.asarray(found.albedo[0], np.float64)[:, None] * np.asarray(found.normals[0], np.float64)
    with np.errstate(over="ignore"):
        size = np.abs(scaled).max(axis=-1, keepdims=True)  # so that squares neither overflow nor vanish
        return np.asarray(np.linalg.norm((b - scaled) / size, axis=-1) / np.linalg.norm(scaled / size, axis=-1))


def spread(found: NormalsResult, scaled: FloatArray, bound: float | FloatArray, *, bars: bool = False) -> Answer:
    """Return the relative errors, flags and, if asked for, error bars of a row as an answer."""
    bar = np.asarray(found.uncertainty[0], np.float64) if bars else None
    return Answer(error=relative(found, scaled), bound=bound, flags=found.flags[0], bar=bar)
