"""Finding how far away the object is: the distance at which a near-light model explains the images best."""

from contextlib import suppress

import numpy as np

from psstereo.errors import InputError, RigError
from psstereo.near.alternate import Alternation, Settled, mean_energy
from psstereo.near.lamps import LEAST_LAMPS, lamps_behind
from psstereo.near.level import Level
from psstereo.near.view import View
from psstereo.types import FloatArray, Progress

__all__ = ["find_distance", "require_distance", "require_lamps_outside"]

_RATIO = 1.15
"""Between neighbouring distances of the first look; the energy's basin is several times as wide."""

_NEAREST, _FARTHEST = 0.05, 30.0
"""Distances looked at, in sizes of the lamps' arrangement; beyond, light is parallel to a few per cent."""

_VAGUE = 0.1
"""Relative standard deviation of the distance beyond which it is refused."""

_CANDIDATES = 4
_ROUNDS = 12
_TOLERANCE = 1e-3


def find_distance(alternation: Alternation, level: Level, start: float | None, progress: Progress) -> Settled:
    """Return the surface of least energy on a coarse image.

    First a flat object at each of many distances is fitted; then the best few distances, one for each valley of the
    energy, are followed to their own surfaces, and the least energy wins.

    Parameters
    ----------
    alternation : Alternation
        Lamps and method.
    level : Level
        A coarse image.
    start : float or None
        Value of q to begin with; searched if absent.
    progress : callable
        Told how many distances are done.

    Returns
    -------
    Settled
        A surface to begin with on finer images.

    Raises
    ------
    InputError
        If no distance explains any pixel.
    RigError
        If a given distance puts lamps behind or inside the object.
    """
    if start is not None:
        flat = np.full(len(level), start)
        require_lamps_outside(alternation.lamps, level.view, flat)
        return alternation.run(level, flat, tolerance=_TOLERANCE, limit=_ROUNDS)
    places = _places(alternation.lamps, level.view)
    energies = np.full(len(places), np.inf)
    for i, q in enumerate(places):
        flat = np.full(len(level), q)
        if _possible(alternation.lamps, level.view, flat):
            fit = alternation.fit(level, flat)
            solved = np.count_nonzero(np.isfinite(fit.scaled).all(axis=1))
            if 2 * solved > len(level):
                energies[i] = mean_energy(fit)
        progress("looking for the distance", i + 1, len(places) + _CANDIDATES)
    settled = []
    for done, i in enumerate(_valleys(energies), 1):
        with suppress(InputError):  # normals that face away at one distance do not at another
            start_here = np.full(len(level), places[i])
            settled.append(alternation.run(level, start_here, tolerance=_TOLERANCE, limit=_ROUNDS))
        progress("looking for the distance", len(places) + done, len(places) + _CANDIDATES)
    if not settled:
        raise InputError(
            given="At no distance do the lamps explain the images.",
            needed="Most pixels must be lit by three lamps or more, in front of the object.",
            remedy="Check positions, axes and frame of the lamps, the order of the images, and the mask.",
        )
    return min(settled, key=lambda one: one.energy)


def _places(lamps: FloatArray, view: View) -> FloatArray:
    """Return the values of q to look at."""
    position = lamps[:, :3]
    middle = position.mean(axis=0)
    radius = float(np.sqrt(((position - middle) ** 2).sum(axis=1).max()))
    steps = np.arange(0.0, np.log(_FARTHEST / _NEAREST), np.log(_RATIO))
    if view.central:
        size = max(radius, float(np.sqrt(middle @ middle)))
        return np.asarray(steps + np.log(_NEAREST * size))
    return np.asarray(float(np.sort(position[:, 2])[-LEAST_LAMPS]) - radius * _NEAREST * np.exp(steps))


def _possible(lamps: FloatArray, view: View, q: FloatArray) -> bool:
    ahead = np.count_nonzero(lamps[:, 2] > np.median(view.points(q)[:, 2]))
    return bool(ahead >= LEAST_LAMPS and not (lamps_behind(lamps, view, q) >= 0).any())


def _valleys(energies: FloatArray) -> list[int]:
    """Return the deepest local minima, deepest first."""
    padded = np.concatenate([[np.inf], energies, [np.inf]])
    low = np.flatnonzero((energies <= padded[:-2]) & (energies <= padded[2:]) & np.isfinite(energies))
    return [int(i) for i in low[np.argsort(energies[low], kind="stable")][:_CANDIDATES]]


def require_lamps_outside(lamps: FloatArray, view: View, q: FloatArray) -> None:
    """Refuse lamps that the camera would see inside or behind the object.

    Raises
    ------
    RigError
        If a lamp is hidden by the surface, or fewer than four lamps are in front of it.
    """
    behind = lamps_behind(lamps, view, q)
    depth = view.depth(q)
    low, high = float(depth.min()), float(depth.max())
    kind = "distances" if view.central else "heights"
    if (behind >= 0).any():
        worst = int(np.argmax(behind))
        raise RigError(
            given=f"Lamp {worst + 1} lies inside or behind the object, whose {kind} are {low:.4g} to {high:.4g}.",
            needed="Lamps are between the camera and the object, or beside it.",
            remedy="Check the lamps' unit and frame, the order of the coordinates, and the distance if it was given.",
        )
    ahead = int(np.count_nonzero(lamps[:, 2] > np.median(view.points(q)[:, 2])))
    if ahead < LEAST_LAMPS:
        raise RigError(
            given=f"Only {ahead} of {len(lamps)} lamps are in front of the object, whose {kind} are {low:.4g} to "
            f"{high:.4g}.",
            needed=f"At least {LEAST_LAMPS} lamps must shine on what the camera sees.",
            remedy="Check the lamps' unit and frame, and the distance if it was given.",
        )


def require_distance(alternation: Alternation, level: Level, settled: Settled) -> None:
    """Refuse a distance that the fall-off of the light does not tell.

    Raises
    ------
    InputError
        If its standard deviation is more than a tenth of it (for heights, of the distance to the lamps).
    """
    share = settled.moved.spread / alternation.length(level, settled.q)
    if alternation.hold is None and share > _VAGUE:
        raise InputError(
            given=f"The fall-off of the lamps' light tells the distance with a standard deviation of {share:.0%} only.",
            needed="Lamps about as near as the object is large, or less noise.",
            remedy="Give a known distance and have it held, or take the lights as distant (--lights).",
        )
