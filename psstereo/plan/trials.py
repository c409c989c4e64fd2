"""Trying solvers on a few pixels: how far their normals move when lights are taken away.

The error of a normal is not known without its truth, but much of it shows when the lights change: noise, highlights
and shadows that come and go with a light, and a reflectance that a solver gets wrong, which pulls the normal toward
where the lights happen to be. So each solver solves a few pixels with all lights and again without one sector of the
sky, another one for each pixel in turn; the angle between the answers is its figure. What it cannot see is an error
that any choice of lights makes alike.

The readable reference of each solver is used, since loading compiled code costs more than these few pixels.
"""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from psstereo.errors import PsstereoError
from psstereo.flags import Flag
from psstereo.lights import Rig
from psstereo.metrics import angular_error
from psstereo.normals import NormalSolver, PixelNormals, Samples
from psstereo.types import FloatArray, IntArray

__all__ = ["Trial", "fold_count", "folds", "try_solver"]

_MANY, _FEW = 48, 24
"""Lights from which a third of them may be taken away, and up to which an eighth is enough."""
_UNSETTLED = 0.05
"""Share of pixels at which a solver may stop before it has converged and still be a choice."""
_LOST = np.radians(20.0)
"""What counts for a pixel that cannot be solved without some of the lights [rad]."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """How a solver did on a few pixels.

    Attributes
    ----------
    solver : str
        Its name.
    change_deg : float
        Mean angle by which its normals move without a sector of the lights [deg].
    pixels : int
        Pixels that were tried.
    seconds : float
        Time of its solution with all lights, by the readable reference [s].
    error_deg : float
        Standard error of `change_deg`: so few pixels tell it no better [deg].
    """

    solver: str
    change_deg: float
    pixels: int
    seconds: float
    error_deg: float = 0.0


def fold_count(lights: int) -> int:
    """Return into how many sectors so many lights are parted."""
    if lights >= _MANY:
        return 3
    return 5 if lights > _FEW else min(8, lights)


def folds(rig: Rig) -> list[IntArray]:
    """Return which lights stay when each sector of the sky is left out, as indices.

    Parameters
    ----------
    rig : Rig
        Distant lights.

    Returns
    -------
    list of int arrays
        Lights that stay; sectors have equally many lights, give or take one.
    """
    directions, count = rig.directions, len(rig)
    parts = fold_count(count)
    around = np.argsort(np.argsort(np.arctan2(directions[:, 1], directions[:, 0]), kind="stable"), kind="stable")
    return [np.flatnonzero(around * parts // count != part) for part in range(parts)]


def try_solver(solver: NormalSolver[Any], rig: Rig, values: FloatArray) -> tuple[Trial, PixelNormals] | None:
    """Solve a few pixels with all lights, and each without one of the sectors.

    Parameters
    ----------
    solver : NormalSolver
        The method.
    rig : Rig
        Distant lights.
    values : float64 array (m, n)
        Samples, NaN where not usable.

    Returns
    -------
    (Trial, PixelNormals) or None
        How it did, and its answer with all lights; None if it refuses these lights, or fewer of them, or does not
        settle at too many of the pixels.
    """
    chosen = folds(rig)
    if min(len(one) for one in chosen) < solver.least_lights:
        return None
    try:
        started = time.perf_counter()
        whole = solver.solve(solver.prepare(rig), Samples(values))
        seconds = time.perf_counter() - started
        if np.mean((whole.flags & np.uint16(Flag.NOT_CONVERGED)) != 0) > _UNSETTLED:
            return None
        moved = np.zeros(values.shape[1])
        for part, stays in enumerate(chosen):
            few, own = rig.select(stays), slice(part, None, len(chosen))
            seen = np.ascontiguousarray(values[stays][:, own])
            found = solver.solve(solver.prepare(few), Samples(seen)).scaled
            angle = angular_error(found, whole.scaled[own])
            moved[own] = np.where(np.isfinite(angle), angle, _LOST)
    except PsstereoError:  # it does not serve such lights, or not without some of them
        return None
    change = float(np.degrees(np.mean(moved)))
    count = values.shape[1]
    error = float(np.degrees(np.std(moved))) / float(np.sqrt(count))
    return Trial(solver=solver.name, change_deg=change, pixels=count, seconds=seconds, error_deg=error), whole
