"""Random factors."""

import numpy as np

__all__ = ["factor"]


def factor(spread: float, rng: np.random.Generator) -> float:
    """Draw a log-normal factor, which is never negative.

    Parameters
    ----------
    spread : float
        Standard deviation about the mean of 1; 0 gives exactly 1 [1].
    rng : numpy Generator
        Source of one normal number.

    Returns
    -------
    float
        The factor [1].
    """
    variance = np.log1p(spread * spread)
    return float(np.exp(np.sqrt(variance) * rng.standard_normal() - variance / 2))
