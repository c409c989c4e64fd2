"""Albedo of terrain that varies little from cell to cell, from the images at known heights."""

import numpy as np

from psstereo.depth.edges import EdgeSteps
from psstereo.depth.weighted import solve_weighted
from psstereo.types import BoolArray, FloatArray

__all__ = ["fill_smoothly", "smooth_albedo"]


def smooth_albedo(
    evidence: FloatArray, weight: FloatArray, stiffness: float, start: FloatArray, *, threads: int
) -> FloatArray:
    """Minimise Σ weight (A − evidence)² + stiffness Σ (steps of A)², and bring the mean to 1.

    The mean is free, since exposures are: it is taken over the pixels that have evidence.

    Parameters
    ----------
    evidence : float64 array (h, w)
        Albedo that the images ask for; read where the weight is above 0 [1].
    weight : float64 array (h, w)
        Weights, squared shading [1].
    stiffness : float
        Weight of each step between neighbours [1].
    start : float64 array (h, w)
        Albedo so far [1].
    threads : int
        Threads at most.

    Returns
    -------
    float64 array (h, w)
        Albedo, at least 0.05 [1].
    """
    height, width = evidence.shape
    steps = EdgeSteps(
        right=np.zeros((height, width - 1)),
        down=np.zeros((height - 1, width)),
        right_weight=np.full((height, width - 1), stiffness),
        down_weight=np.full((height - 1, width), stiffness),
        left_out=0,
    )
    found = solve_weighted(
        steps,
        np.ones(evidence.shape, np.bool_),
        prior=evidence,
        prior_weight=weight,
        start=start,
        tolerance=1e-4,
        threads=threads,
        solves=4,
    ).values
    total = float(weight.sum())
    mean = float(np.sum(weight * found)) / total if total > 0 else 1.0
    return np.asarray(np.maximum(found / mean, 0.05))


def fill_smoothly(field: FloatArray, known: BoolArray) -> FloatArray:
    """Return a field whose gaps hold the harmonic function through their rims.

    Parameters
    ----------
    field : float64 array (h, w)
        Values; read where known.
    known : bool array (h, w)
        Where; at least one.

    Returns
    -------
    float64 array (h, w)
        The values, and between them a membrane.
    """
    if known.all():
        return field.copy()
    level = float(field[known].mean())
    height, width = field.shape
    steps = EdgeSteps(
        right=np.zeros((height, width - 1)),
        down=np.zeros((height - 1, width)),
        right_weight=np.ones((height, width - 1)),
        down_weight=np.ones((height - 1, width)),
        left_out=0,
    )
    found = solve_weighted(
        steps,
        np.ones(field.shape, np.bool_),
        prior=np.where(known, field - level, 0.0),
        prior_weight=np.where(known, 1e4, 0.0),
        tolerance=1e-6,
    )
    return np.where(known, field, found.values + level)
