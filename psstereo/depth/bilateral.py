"""Bilateral integration: each pixel follows the neighbour on the side where the surface goes on."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from psstereo.depth.discontinuity_evidence import centred_prior, cosines, edge_ends, pixel_pitch, plane_steps
from psstereo.depth.domain import Domain
from psstereo.depth.edges import EdgeSteps, components_of, edge_steps
from psstereo.depth.integrator import Integrator, Solution
from psstereo.depth.weighted import solve_weighted
from psstereo.errors import OptionError
from psstereo.types import FloatArray, IntArray, Progress

__all__ = ["Bilateral"]

_LARGEST_EXPONENT = 50.0
"""Exponents of the logistic function are cut off here; it is 0 or 1 to double precision long before [1]."""
_LEAST = 1e-9
"""Smallest share of a side: ties down what would otherwise come loose [1]."""
_SMALL = 1 << 14
"""Pixels up to which all rounds are solved to the last: it costs nothing there [px]."""


@dataclass(frozen=True, kw_only=True)
class Bilateral(Integrator):
    """Bilateral normal integration [1]_, the usual remedy for depth jumps, here as a baseline.

    Each pixel's plane predicts the step to its left and to its right neighbour. Of the two, the smaller step (times
    the cosine of the slant, in pixels) gets the share σ(k (larger² − smaller²)) of the pixel's weight and the other the
    rest, likewise up and down; then the weighted least squares are solved, and so on until the energy settles.

    Exact on planes. On other surfaces the one-sided steps agree with each other to first order only, so that spheres
    are not exact. The problem is not convex: gentle cliffs, whose first solution already looks smooth, are not found,
    and hinges may be cut. Do not use it for anything but comparison:
    :class:`~psstereo.depth.discontinuity.Discontinuity` is more accurate and an order of magnitude faster.

    Attributes
    ----------
    steepness : float
        k: how decidedly the smaller step wins; 0 gives both sides the same weight [px⁻²].
    settled : float
        Relative change of the energy at which the rounds end [1].
    rounds : int
        Solutions at most.
    round_tolerance : float
        Relative residual of the linear solver in all rounds but the last, on images of more than 16 384 pixels [1].
    tolerance : float
        Relative residual of the linear solver in the last round [1].
    max_iterations : int
        Iterations of the linear solver at most, in each round.
    threads : int
        Threads of the linear solver; the result does not depend on it.

    References
    ----------
    .. [1] X. Cao, H. Santo, B. Shi, F. Okura, Y. Matsushita, "Bilateral normal integration", ECCV 2022.
    """

    name: ClassVar[str] = "bilateral"
    takes_prior: ClassVar[bool] = True
    summary: ClassVar[str] = "Bilateral normal integration (Cao 2022), a baseline for depth jumps."
    exact_on_spheres: ClassVar[bool] = False
    steepness: float = 2.0
    settled: float = 1e-4
    rounds: int = 100
    round_tolerance: float = 1e-5
    tolerance: float = 1e-10
    max_iterations: int = 2000

    def __post_init__(self) -> None:
        fine = 0 <= self.steepness < math.inf and 0 <= self.settled < 1
        fine &= 0 < self.tolerance < 1 and 0 < self.round_tolerance < 1
        if not (fine and self.rounds >= 1 and self.max_iterations >= 1 and self.threads >= 1):
            raise OptionError(
                given=(
                    f"The steepness is {self.steepness}, the settled change {self.settled}, the tolerances "
                    f"{self.round_tolerance} and {self.tolerance}, the rounds {self.rounds}, the iteration limit "
                    f"{self.max_iterations}, the number of threads {self.threads}."
                ),
                needed=(
                    "They must be at least 0, at least 0 and below 1, above 0 and below 1, at least 1, at least 1 and "
                    "at least 1."
                ),
                remedy="Leave them out to use 2, 1e-4, 1e-5, 1e-10, 100, 2000 and 1.",
            )

    def solve(self, domain: Domain, progress: Progress) -> Solution:
        """Solve and share out anew in turns; see :meth:`Integrator.solve`."""
        sides = _Sides(domain)
        components = components_of(sides.plain, domain.inside)
        prior, mean = centred_prior(domain, components)
        early = self.tolerance if domain.inside.size <= _SMALL else max(self.tolerance, self.round_tolerance)
        share = np.full(domain.inside.shape, 0.5)
        shares, values = (share, share), None
        energy = np.full(int(components.max(initial=0)) + 1, math.inf)
        iterations, done, active = 0, 0, np.arange(energy.size) > 0
        while True:
            last = not active.any() or done == self.rounds - 1
            found = solve_weighted(
                sides.steps(shares),
                domain.inside,
                prior=prior,
                prior_weight=domain.prior_weight,
                start=values,
                components=components,
                tolerance=self.tolerance if last else early,
                max_iterations=self.max_iterations,
                threads=self.threads,
                solves=self.rounds,
            )
            values, iterations, done = found.values, iterations + found.iterations, done + 1
            progress("integrate", 100 if last else round(99 * done / self.rounds), 100)
            if last:
                break
            # Each component comes to rest by itself, whatever the others do.
            moving = active[components]
            new = sides.shares(values, self.steepness)
            shares = np.where(moving, new[0], shares[0]), np.where(moving, new[1], shares[1])
            before, energy = energy, sides.energy(values, shares, components)
            active &= np.abs(before - energy) > self.settled * energy
        facts: dict[str, Any] = {
            "path": found.path,
            "edges": sides.plain.count,
            "edges_left_out": sides.plain.left_out,
            "rounds": done,
            "components_unsettled": int(np.count_nonzero(active)),
        }
        return Solution(
            values=found.values + mean,
            components=components,
            iterations=iterations,
            residual=found.residual,
            converged=found.converged,
            facts=facts,
        )


class _Sides:
    """The two equations of each edge, one from the plane at either end."""

    def __init__(self, domain: Domain) -> None:
        self.plain: EdgeSteps = edge_steps(domain)
        self.cosine = cosines(domain)
        self.pitch = pixel_pitch(domain)
        self.weight = self.cosine**2 if domain.weights is None else self.cosine**2 * domain.weights
        self.ends = edge_ends()
        self.there = self.plain.right_weight > 0, self.plain.down_weight > 0
        self.predicted = [plane_steps(domain, ends) for ends in self.ends]

    def _weights(self, shares: tuple[FloatArray, FloatArray]) -> list[tuple[FloatArray, FloatArray]]:
        """Return the weights of both equations of each edge; the shares are those of the right and lower side."""
        parts = []
        for (a, b), there, share in zip(self.ends, self.there, shares, strict=True):
            ahead, back = np.maximum(share, _LEAST) * self.weight, np.maximum(1.0 - share, _LEAST) * self.weight
            parts.append((np.where(there, ahead[a], 0.0), np.where(there, back[b], 0.0)))
        return parts

    def steps(self, shares: tuple[FloatArray, FloatArray]) -> EdgeSteps:
        """Return one equation an edge, of the sum of both weights and their weighted mean."""
        weights, steps = [], []
        for (one, two), (first, second) in zip(self._weights(shares), self.predicted, strict=True):
            total = one + two
            weights.append(total)
            steps.append((one * first + two * second) / np.where(total > 0, total, 1.0))
        return EdgeSteps(
            right=steps[0], down=steps[1], right_weight=weights[0], down_weight=weights[1], left_out=self.plain.left_out
        )

    def shares(self, values: FloatArray, steepness: float) -> tuple[FloatArray, FloatArray]:
        """Return the share of the right and of the lower side of each pixel; a missing side counts as level."""
        found = []
        for (a, b), there in zip(self.ends, self.there, strict=True):
            ahead, back = np.zeros_like(values), np.zeros_like(values)
            square = np.where(there, (values[b] - values[a]) / self.pitch, 0.0) ** 2
            ahead[a], back[b] = square, square
            exponent = np.clip(steepness * self.cosine**2 * (ahead - back), -_LARGEST_EXPONENT, _LARGEST_EXPONENT)
            found.append(1.0 / (1.0 + np.exp(exponent)))
        return found[0], found[1]

    def energy(self, values: FloatArray, shares: tuple[FloatArray, FloatArray], components: IntArray) -> FloatArray:
        """Return the weighted sum of squares over both equations of all edges of each component."""
        total = np.zeros(int(components.max(initial=0)) + 1)
        for (a, b), weights, predicted in zip(self.ends, self._weights(shares), self.predicted, strict=True):
            for weight, step in zip(weights, predicted, strict=True):
                square = weight * (values[b] - values[a] - step) ** 2
                total += np.bincount(components[a].ravel(), square.ravel(), total.size)
        return total
