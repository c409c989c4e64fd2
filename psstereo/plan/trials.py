"""Trying solvers on a few pixels: which of them is nearest to the truth that nobody knows.

The error of a normal is not known without its truth, but two things show of it. What comes and goes with the lights,
such as noise, highlights and shadows, moves the normal when lights are taken away: each pixel is solved with all lights
and again without one sector of the sky, another one for each pixel in turn. What a solver gets wrong with any choice
of lights, such as a reflectance that it cannot follow, leaves brightness unexplained that another normal explains:
each pixel's normal is compared with that of the solver whose normal explains this pixel best, whatever it is made of
(:mod:`psstereo.plan.explanation`). The product of the two angles tells solvers apart: each by itself is deceived, the
first by a solver that is wrong but steady, the second by one whose mistakes a highlight could explain.

Each solver uses the loop that the whole run would use, the readable reference or its compiled twin, so that what is
loaded here is loaded once; both solutions come in one go. A solver that learns from the object before it solves learns
from these pixels, all lights on: without that its trial would be the trial of another solver.
"""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from psstereo.errors import PsstereoError
from psstereo.flags import Flag
from psstereo.lights import Rig
from psstereo.metrics import angular_error
from psstereo.normals import NormalSolver, Samples
from psstereo.plan.explanation import best_explained
from psstereo.types import FloatArray, IntArray

__all__ = ["Attempt", "Trial", "attempt", "fold_count", "folds", "judged"]

_MANY, _FEW = 48, 24
"""Lights from which a third of them may be taken away, and up to which an eighth is enough."""
_UNSETTLED = 0.08
"""Share of pixels at which a solver may stop before it has converged and still be a choice: that of a twentieth, from
which a whole run counts as not converged, and half as much again, since a hundred pixels tell it no better and a solver
that learns from so few settles more slowly than the run will."""
_LOST = np.radians(20.0)
"""What counts for a pixel that cannot be solved, or not without some of the lights [rad]."""
_FURTHEST = np.radians(30.0)
"""Distance from the best explained normal that counts at most [rad]."""
_USUAL = 0.98
"""Rank of the angle that larger ones are taken for: so few pixels say nothing about rare ones [1]."""
_FLOOR = 0.0005
"""Angle below which nothing is told apart [deg]."""


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
        Time of both solutions, with what was loaded for them [s].
    error_deg : float
        Standard error of `change_deg`: so few pixels tell it no better [deg].
    apart_deg : float
        Mean angle between its normals and those that explain the pixels best [deg].
    beside_deg : float or None
        Mean angle between its normals and those of the last solver that was tried, the richest one; None if it is that
        one [deg].
    """

    solver: str
    change_deg: float
    pixels: int
    seconds: float
    error_deg: float = 0.0
    apart_deg: float = 0.0
    beside_deg: float | None = None

    @property
    def doubt_deg(self) -> float:
        """Geometric mean of the two angles, with a floor below which nothing is told apart [deg]."""
        return float(np.sqrt((self.change_deg + _FLOOR) * (self.apart_deg + _FLOOR)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Attempt:
    """What a solver found at a few pixels.

    Attributes
    ----------
    solver : str
        Its name.
    scaled : float64 array (n, 3)
        Albedo times normals with all lights; NaN where there is none [any unit].
    moved : float64 array (n,)
        Angle to the normal without a sector [rad].
    seconds : float
        Time that both took [s].
    ambient : float64 array (n,) or None
        Ambient level, from solvers that tell it [any unit].
    """

    solver: str
    scaled: FloatArray
    moved: FloatArray
    seconds: float
    ambient: FloatArray | None = None


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


def attempt(solver: NormalSolver[Any], rig: Rig, values: FloatArray, whole: int | None = None) -> Attempt | None:
    """Solve a few pixels with all lights, and each without one of the sectors.

    Parameters
    ----------
    solver : NormalSolver
        The method.
    rig : Rig
        Distant lights.
    values : float64 array (m, n)
        Samples, NaN where not usable.
    whole : int, optional
        Pixels of the run that this is a trial for, which says whether its loops are compiled; few if absent [1].

    Returns
    -------
    Attempt or None
        What it found; None if it refuses these lights, or does not settle at too many of the pixels.
    """
    stay, pixels = folds(rig), values.shape[1]
    few = np.full(values.shape, np.nan)
    for part, lights in enumerate(stay):
        few[lights, part :: len(stay)] = values[lights, part :: len(stay)]
    try:
        for lights in stay:
            rig.select(lights).require_spanning()
        started = time.perf_counter()
        if solver.learns_from:
            solver, _ = solver.taught(rig, Samples(values), whole)
        found = solver.solve(solver.prepare(rig, whole), Samples(np.concatenate([values, few], axis=1)))
        seconds = time.perf_counter() - started
    except PsstereoError:  # it does not serve such lights, or not without some of them
        return None
    if np.mean((found.flags[:pixels] & np.uint16(Flag.NOT_CONVERGED)) != 0) > _UNSETTLED:
        return None
    angle = angular_error(found.scaled[pixels:], found.scaled[:pixels])
    return Attempt(
        solver=solver.name,
        scaled=found.scaled[:pixels],
        moved=np.where(np.isfinite(angle), angle, _LOST),
        seconds=seconds,
        ambient=None if found.ambient is None else found.ambient[:pixels],
    )


def judged(
    attempts: list[Attempt], rig: Rig, values: FloatArray, weights: FloatArray | None = None
) -> tuple[Trial, ...]:
    """Compare solvers with each other on the same pixels.

    Parameters
    ----------
    attempts : list of Attempt
        What each found.
    rig : Rig
        Distant lights.
    values : float64 array (m, n)
        The samples that they were given.
    weights : float64 array (n,), optional
        For how many pixels each stands, 1 on average; the same for all if absent [1].

    Returns
    -------
    tuple of Trial
        One a solver, in the same order.
    """
    if not attempts:
        return ()
    with np.errstate(invalid="ignore", divide="ignore"):
        units = np.stack([one.scaled / np.linalg.norm(one.scaled, axis=1)[:, None] for one in attempts])
    stands = np.ones(values.shape[1]) if weights is None else weights
    best = best_explained(units, rig.directions, values)
    trials = []
    for one, normals in zip(attempts, units, strict=True):
        apart, beside = _between(normals, best), _between(normals, units[-1])
        trials.append(
            Trial(
                solver=one.solver,
                change_deg=_mean(one.moved * stands),
                pixels=len(one.moved),
                seconds=one.seconds,
                error_deg=float(np.degrees(np.std(one.moved * stands) / np.sqrt(len(one.moved)))),
                apart_deg=_mean(apart * stands),
                # Rare pixels, such as those in cast shadows, may be all that two solvers differ by.
                beside_deg=None if one is attempts[-1] else float(np.degrees(np.mean(beside * stands))),
            )
        )
    return tuple(trials)


def _between(normals: FloatArray, others: FloatArray) -> FloatArray:
    """Return the angles between normals, no more than counts, and what counts where one is missing [rad]."""
    angle = angular_error(normals, others)
    return np.where(np.isfinite(angle), np.minimum(angle, _FURTHEST), _LOST)


def _mean(angles: FloatArray) -> float:
    """Return the mean, the largest fiftieth taken for the next smaller one [deg]."""
    return float(np.degrees(np.minimum(angles, np.quantile(angles, _USUAL)).mean()))
