"""Fit, integrate, move, and again, until the surface stays where it is."""

from dataclasses import dataclass, replace

import numpy as np

from psstereo.depth import Integrator, Poisson
from psstereo.kernels.near import NearFit
from psstereo.near.fit import fit_level
from psstereo.near.level import Level
from psstereo.near.options import Round
from psstereo.near.surface import Moved, move
from psstereo.types import FloatArray, Map

__all__ = ["Alternation", "Settled", "mean_energy"]

_FIRST, _LATER = 8, 3
"""Rounds of reweighting in the first fit and in those that begin from the one before."""

_SHARE = 0.95
"""Share of the pixels whose change counts. The rest, where shadows and highlights leave several fits equally good, may
hop between them for ever without moving the others."""

_SHORTEST = 1 / 16
"""Least part of a step that is taken."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Settled:
    """Where an alternation ended.

    Attributes
    ----------
    q : float64 array (p,)
        The surface, see :class:`psstereo.near.view.View`.
    fit : NearFit
        Fits at the last surface but one, which differs by less than the tolerance if it converged.
    moved : Moved
        How the surface was found.
    energy : float
        Mean loss of the usable observations [1].
    converged : bool
        Whether the change met the tolerance.
    rounds : tuple of Round
        What it went through.
    """

    q: FloatArray
    fit: NearFit
    moved: Moved
    energy: float
    converged: bool
    rounds: tuple[Round, ...]


def mean_energy(fit: NearFit) -> float:
    """Return the mean loss of the usable observations, between 0 and 1 [1]."""
    return float(fit.energy.sum()) / max(float(fit.usable.sum()), 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Alternation:
    """What all sizes of the image share.

    Attributes
    ----------
    lamps : float64 array (m, 7)
        Position, axis, exponent.
    integrator : Integrator
        Method for the depth.
    hold : float or None
        Median of q to hold, if the distance is known.
    work : float
        Samples times rounds of the whole run.
    over : map-like
        Executes blocks.
    last_stands : bool
        Whether rounds that did not converge end at the last surface rather than at that of least energy: for fits that
        minimise something else.
    """

    lamps: FloatArray
    integrator: Integrator
    hold: float | None
    work: float
    over: Map
    last_stands: bool = False

    def fit(self, level: Level, q: FloatArray, start: FloatArray | None = None) -> NearFit:
        """Fit all pixels of a level at a surface."""
        rounds = _FIRST if start is None else _LATER
        return fit_level(level, self.lamps, q, start=start, rounds=rounds, work=self.work, over=self.over)

    def length(self, level: Level, q: FloatArray) -> float:
        """Return the unit of steps of q: 1 for logarithms, the median distance to the lamps for heights [length]."""
        if level.view.central:
            return 1.0
        away = self.lamps[:, None, :3] - level.view.points(q)[None, :: max(1, len(level) // 1000)]
        return float(np.median(np.sqrt((away * away).sum(axis=2))))

    def run(self, level: Level, q: FloatArray, *, tolerance: float, limit: int) -> Settled:
        """Alternate at one size of the image.

        Parameters
        ----------
        level : Level
            Samples and lines of sight.
        q : float64 array (p,)
            Surface to begin with.
        tolerance : float
            Change at which it ends [1].
        limit : int
            Rounds at most.

        Returns
        -------
        Settled
            The last surface if it converged or `last_stands`, that of least energy otherwise.
        """
        quick = self.integrator
        if isinstance(quick, Poisson):  # a depth that will be replaced need not be solved to rounding
            quick = replace(quick, tolerance=max(quick.tolerance, 1e-2 * tolerance))
        length = self.length(level, q)
        fit: NearFit | None = None
        settled: list[Settled] = []
        rounds: list[Round] = []
        share = 1.0
        before: FloatArray | None = None
        for _ in range(limit):
            fit = self.fit(level, q, None if fit is None else fit.scaled)
            energy = mean_energy(fit)
            moved = move(level.view, fit, q, integrator=quick, length=length, hold=self.hold)
            step = moved.q - q
            turned = before is not None and float(step @ before) < 0.0  # back and forth: half as far gets nearer
            share = max(share / 2, _SHORTEST) if turned else min(1.0, 1.2 * share)
            before = step
            change = float(np.quantile(np.abs(step), _SHARE)) / length
            distance = float(np.median(level.view.depth(q)))
            rounds.append(Round(factor=level.factor, energy=energy, distance=distance, change=change))
            here = Settled(
                q=q + share * step, fit=fit, moved=moved, energy=energy, converged=change <= tolerance, rounds=()
            )
            if here.converged or self.last_stands or not settled or energy < settled[0].energy:
                settled = [here]  # the others are not kept: they are large
            if here.converged:
                break
            q = here.q
        return replace(settled[0], rounds=tuple(rounds))
