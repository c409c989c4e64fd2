"""How far away the surface is, by the energy that exemplars of any amounts leave at each distance.

Materials that were told at a wrong distance have made up for part of the mistake, and what they leave unexplained pulls
the surface back by far too little. So whole surfaces are fitted anew, every lobe for itself, a little nearer and a
little farther, and a parabola says where the least energy is.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from psstereo.types import FloatArray

__all__ = ["Profile", "least_energy"]

_STEP = 0.02
"""First step to either side, in logarithms or in distances to the lamps [1]."""

_MOST_STEPS = 6
"""Steps on the way to a minimum; what is farther away takes another call."""

_FINER = 0.25
"""Second step over the first, once the minimum lies between its ends."""


class Profile(NamedTuple):
    """Where the least energy is.

    Attributes
    ----------
    shift : float
        From the present surface; zero where there is no minimum [unit of the step].
    stiffness : float
        Half of the energy's curvature there, zero where there is none.
    energy : float
        Least one.
    """

    shift: float
    stiffness: float
    energy: float


def least_energy(energy: Callable[[float], float], length: float) -> Profile:
    """Look for the nearest minimum of the energy.

    Parameters
    ----------
    energy : callable
        Energy of a surface that was moved as a whole by a number.
    length : float
        Unit of steps: 1 for logarithms, a distance for heights [length].

    Returns
    -------
    Profile
        The minimum.
    """
    known: dict[int, float] = {}
    step = _STEP * length

    def at(k: int) -> float:
        if k not in known:
            known[k] = energy(k * step)
        return known[k]

    k = 0
    for _ in range(_MOST_STEPS):
        lower = min((k - 1, k + 1), key=at)
        if not at(lower) < at(k):
            break
        k = lower
    else:
        return Profile(k * step, 0.0, at(k))
    first = _parabola(at(k - 1), at(k), at(k + 1))
    middle, fine = (k + first[0]) * step, _FINER * step
    left, centre, right = energy(middle - fine), energy(middle), energy(middle + fine)
    second = _parabola(left, centre, right)
    sound = second[1] > 0 and abs(second[0]) < 1.0 / _FINER
    shift = middle + (second[0] * fine if sound else 0.0)
    return Profile(shift, first[1] / step**2, min(centre, at(k)))


def _parabola(left: float, centre: float, right: float) -> FloatArray:
    """Return where the minimum is, in steps from the middle, and half of the curvature."""
    half = 0.5 * (left + right) - centre
    return np.array([0.25 * (left - right) / half if half > 0 else 0.0, max(half, 0.0)])
