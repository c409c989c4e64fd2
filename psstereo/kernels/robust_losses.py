"""Weights of the losses that :data:`psstereo.kernels.robust_settings.LOSSES` names."""

from typing import Any

import numpy as np

from psstereo.types import FloatArray

__all__ = ["weight", "weight_slope"]


def weight(loss: int, t: FloatArray) -> FloatArray:
    """Return the weights of a loss for residuals over tuning constant and scale."""
    v = t * t
    by_loss: tuple[Any, ...] = (
        lambda: 1 / np.maximum(np.abs(t), 1e-3),
        lambda: 1 / np.maximum(np.abs(t), 1.0),
        lambda: 1 / (1 + v),
        lambda: 1 / (1 + v) ** 2,
        lambda: np.maximum(1 - v, 0) ** 2,
        lambda: np.exp(-v),
        lambda: np.ones_like(t),
    )
    return np.asarray(by_loss[loss]())


def weight_slope(loss: int, t: FloatArray) -> FloatArray:
    """Return the derivative of r · weight by r; its mean says how much of the data a loss uses."""
    v = t * t
    by_loss: tuple[Any, ...] = (
        lambda: np.ones_like(t),
        lambda: (v < 1).astype(np.float64),
        lambda: (1 - v) / (1 + v) ** 2,
        lambda: (1 - 3 * v) / (1 + v) ** 3,
        lambda: np.where(v < 1, (1 - v) * (1 - 5 * v), 0.0),
        lambda: (1 - 2 * v) * np.exp(-v),
        lambda: np.ones_like(t),
    )
    return np.asarray(by_loss[loss]())
