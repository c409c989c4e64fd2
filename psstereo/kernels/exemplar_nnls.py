"""Least squares whose unknowns may not be negative, for many pixels at once: the readable reference.

The active-set method of Lawson and Hanson [1]_ on the normal equations A x = b. Unknowns are either free or held at
zero. A step goes to the minimum over the free ones, or only so far as none turns negative; the one that would is held.
At the minimum, the unknown held at zero whose release lowers the sum most is released.

References
----------
.. [1] C. L. Lawson, R. J. Hanson, "Solving Least Squares Problems", SIAM, 1995. doi:10.1137/1.9781611971217
"""

import numpy as np

from psstereo.types import BoolArray, FloatArray

__all__ = ["NOTHING", "STEPS", "nnls"]

STEPS = 4
"""Steps at most, for each unknown."""
NOTHING = 1e-10
"""Slope of the sum that is none, over the sum of weights."""


def nnls(a: FloatArray, b: FloatArray, unbounded: int, x: FloatArray, mass: FloatArray) -> FloatArray:
    """Return the x without negative entries that minimises ``xᵀ A x / 2 − bᵀ x``.

    Parameters
    ----------
    a : float64 array (p, q, q)
        Positive definite matrices.
    b : float64 array (p, q)
        Right sides.
    unbounded : int
        How many unknowns, from the last, may be negative.
    x : float64 array (p, q)
        Where to start, none of the others negative.
    mass : float64 array (p,)
        Sums of weights, for what counts as nothing.

    Returns
    -------
    float64 array (p, q)
        The solutions.
    """
    size = a.shape[1]
    bounded = np.arange(size) < size - unbounded
    x, passive, going = x.copy(), (x > 0) | ~bounded, np.arange(len(x))
    for _ in range(STEPS * size):
        if len(going) == 0:
            break
        free, now = passive[going], x[going]
        z = _minimum(a[going], b[going], free)
        negative = free & bounded & (z <= 0)
        stuck = negative.any(axis=1)
        gap = np.where(negative & (now > z), now - z, 1.0)
        share = np.where(negative, now / gap, np.inf)
        hit = share.argmin(axis=1)
        step = np.where(stuck, share[np.arange(len(going)), hit], 1.0)
        now = now + step[:, None] * (z - now)
        rows = np.flatnonzero(stuck)
        now[rows, hit[rows]], free[rows, hit[rows]] = 0.0, False
        slope = b[going] - (a[going] @ now[..., None])[..., 0]
        slope = np.where(free | stuck[:, None], -np.inf, slope)
        best = slope.argmax(axis=1)
        released = np.flatnonzero(slope[np.arange(len(going)), best] > NOTHING * mass[going])
        free[released, best[released]] = True
        x[going], passive[going] = now, free
        stuck[released] = True
        going = going[stuck]
    return x


def _minimum(a: FloatArray, b: FloatArray, free: BoolArray) -> FloatArray:
    """Return the minimum over the free unknowns, zero elsewhere."""
    both = free[:, :, None] & free[:, None, :]
    matrix = np.where(both, a, np.eye(a.shape[1]))
    return np.asarray(np.linalg.solve(matrix, np.where(free, b, 0.0)[..., None])[..., 0])
