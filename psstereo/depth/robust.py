"""Integration by least absolute deviations: outliers among the normals count for little."""

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from psstereo.depth.discontinuity_evidence import centred_prior, pixel_pitch
from psstereo.depth.domain import Domain
from psstereo.depth.edges import EdgeSteps, components_of, edge_steps
from psstereo.depth.integrator import Integrator, Solution
from psstereo.depth.weighted import solve_weighted
from psstereo.errors import OptionError
from psstereo.types import FloatArray, Progress

__all__ = ["LeastAbsolute"]

_SMALL = 1 << 14
"""Pixels up to which all rounds are solved far beyond the tolerance, as reweighting amplifies what is left [px]."""
_START = 100.0
"""The first round's softening in terms of the last one's [1]."""


@dataclass(frozen=True, kw_only=True)
class LeastAbsolute(Integrator):
    """The sum of absolute instead of squared residuals: minimise Σ √(w r² + ε²) over the edges, with r = s_b − s_a − c.

    This is the total variation of the difference between the solution and the given slopes, softened below ε. Some
    normals that are entirely wrong (highlights, cast shadows, dust) leave no trace beyond their own place, where least
    squares would spread them. The problem is convex, so that the answer does not depend on where one starts. It is
    solved by least squares again and again, each edge weighing 1 / √(w r² + ε²), with ε falling by a common factor.
    A prior counts by absolute deviations as well, in units of the edges': a few wrong points of it do no harm.

    Exact on planes and spheres. Under noise that is the same everywhere its error is about a quarter above that of
    least squares. Do not use it for cliffs: where the jump is large all along, the least sum is a compromise, not the
    truth; :class:`~psstereo.depth.discontinuity.Discontinuity` looks at the evidence.

    Attributes
    ----------
    slant_exponent : float
        An edge weighs the cosine of its slant to this power (:mod:`psstereo.depth.edges`) [1].
    softening : float
        ε in the last round; below it residuals count by their squares [px].
    rounds : int
        Times that the weights follow the solution.
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
    .. [1] J.-D. Durou, J.-F. Aujol, F. Courteille, "Integrating the normal field of a surface in the presence of
       discontinuities", EMMCVPR 2009.
    """

    name: ClassVar[str] = "l1"
    takes_prior: ClassVar[bool] = True
    summary: ClassVar[str] = "Least absolute deviations; shrugs off single wrong normals."
    round_off: ClassVar[float] = 1e-8
    slant_exponent: float = 2.0
    softening: float = 0.01
    rounds: int = 10
    round_tolerance: float = 1e-4
    tolerance: float = 1e-10
    max_iterations: int = 2000

    def __post_init__(self) -> None:
        fine = 0 <= self.slant_exponent <= 4 and 0 < self.softening < math.inf
        fine &= 0 < self.tolerance < 1 and 0 < self.round_tolerance < 1
        if not (fine and self.rounds >= 0 and self.max_iterations >= 1 and self.threads >= 1):
            raise OptionError(
                given=(
                    f"The slant exponent is {self.slant_exponent}, the softening {self.softening}, the tolerances "
                    f"{self.round_tolerance} and {self.tolerance}, the rounds {self.rounds}, the iteration limit "
                    f"{self.max_iterations}, the number of threads {self.threads}."
                ),
                needed="They must be 0 to 4, above 0, above 0 and below 1, at least 0, at least 1 and at least 1.",
                remedy="Leave them out to use 2, 0.01, 1e-4, 1e-10, 10, 2000 and 1.",
            )

    def solve(self, domain: Domain, progress: Progress) -> Solution:
        """Solve and reweigh in turns; see :meth:`Integrator.solve`."""
        plain = edge_steps(domain, slant_exponent=self.slant_exponent)
        components = components_of(plain, domain.inside)
        early = 0.01 * self.tolerance if domain.inside.size <= _SMALL else max(self.tolerance, self.round_tolerance)
        prior, mean = centred_prior(domain, components)
        held = domain.prior_weight
        softening, weighted, values, iterations = self.softening * pixel_pitch(domain), plain, None, 0
        for done in range(self.rounds + 1):
            if values is not None:
                soft = softening * _START ** ((self.rounds - done) / max(self.rounds - 1, 1))
                weighted = _reweighed(plain, values, soft)
                if prior is not None and domain.prior_weight is not None:
                    pull = domain.prior_weight * (values - prior) ** 2
                    held = domain.prior_weight * soft / np.sqrt(pull + soft**2)
            found = solve_weighted(
                weighted,
                domain.inside,
                prior=prior,
                prior_weight=held,
                start=values,
                components=components,
                tolerance=self.tolerance if done == self.rounds else early,
                max_iterations=self.max_iterations,
                threads=self.threads,
                solves=self.rounds + 1,
            )
            values, iterations = found.values, iterations + found.iterations
            progress("integrate", round(100 * (done + 1) / (self.rounds + 1)), 100)
        facts: dict[str, Any] = {
            "path": found.path,
            "edges": plain.count,
            "edges_left_out": plain.left_out,
            "mean_deviation_px": _mean_deviation(plain, found.values) / pixel_pitch(domain),
        }
        return Solution(
            values=found.values + mean,
            components=components,
            iterations=iterations,
            residual=found.residual,
            converged=found.converged,
            facts=facts,
        )


def _reweighed(plain: EdgeSteps, values: FloatArray, soft: float) -> EdgeSteps:
    """Return the edges with the weights whose squares have the slope of the absolute values."""
    right = plain.right_weight * (np.diff(values, axis=1) - plain.right) ** 2
    down = plain.down_weight * (np.diff(values, axis=0) - plain.down) ** 2
    return replace(
        plain,
        right_weight=plain.right_weight * soft / np.sqrt(right + soft**2),
        down_weight=plain.down_weight * soft / np.sqrt(down + soft**2),
    )


def _mean_deviation(plain: EdgeSteps, values: FloatArray) -> float:
    """Return the mean absolute residual across the line of sight over the edges."""
    right = np.sqrt(plain.right_weight) * np.abs(np.diff(values, axis=1) - plain.right)
    down = np.sqrt(plain.down_weight) * np.abs(np.diff(values, axis=0) - plain.down)
    return float(right.sum() + down.sum()) / max(plain.count, 1)
