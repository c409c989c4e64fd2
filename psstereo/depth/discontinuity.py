"""Integration across cliffs: edges that contradict their surroundings are let go, the others hold."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from psstereo.depth.discontinuity_evidence import (
    bridged,
    centred_prior,
    cosines,
    edge_ends,
    medians,
    pixel_pitch,
    plane_steps,
    turning,
)
from psstereo.depth.discontinuity_pieces import seat_pieces
from psstereo.depth.discontinuity_solve import Task, Two, solve_apart
from psstereo.depth.domain import Domain
from psstereo.depth.edges import EdgeSteps, components_of, edge_steps
from psstereo.depth.integrator import Integrator, Solution
from psstereo.errors import OptionError
from psstereo.types import FloatArray, IntArray, Progress

__all__ = ["Discontinuity"]

_USUAL_TURN = 1.5
"""Ratio of turning up to which an edge is as good as any [1]."""
_OUTLIER = 4.0
"""Ratio of turning from which an edge may be part of a line that is bridged [1]."""
_BRIDGE = 6.0
"""Ratio of turning that a bridged gap is given [1]."""
_LEAST_EVIDENCE = 1e-4
"""Smallest factor for turning alone: normals cannot tell a hinge from a cliff, so that hinges must still hold [1]."""
_SMALL = 1 << 14
"""Pixels up to which all rounds are solved to the last: it costs nothing there [px]."""
_FOLD = 0.02
"""Error of a chord at which its edge weighs half, unless noise makes all errors larger [px]."""
_FOLDS = 20.0
"""That error at least in terms of the median one, which only noise makes large [1]."""
_GRAZING = 0.03
"""Cosine of the slant at which an edge weighs half: beyond, normals are no better than their rounding [1]."""
_SMALLEST_COSINE = 1e-8
"""Cosines are cut off here, lest something is divided by 0 [1]."""
_START = 5.0
"""The first round's scale in terms of the last one's [1]."""
_NOISE = 4.5
"""Three standard deviations in terms of the median magnitude of normally distributed residuals [1]."""


@dataclass(frozen=True, kw_only=True)
class Discontinuity(Integrator):
    r"""Least squares in which every edge weighs by what its normals and its neighbourhood say about it.

    Three kinds of evidence multiply the weight of :class:`~psstereo.depth.poisson.Poisson`:

    * **Turning**: where the normal turns much more than nearby, an edge keeps 10⁻⁴ to 1 of its weight. That is not a
      cut: a hinge still holds its plate if nothing else does, and both sides of a cliff move freely.
    * **Folds**: an edge whose two ends predict different steps weighs less, and so does one that is seen
      edge-on, within 2 degrees: its normals say nothing of how long the step is.
    * **Residual**: after each solution, ``1 / (1 + r²/σ²)²`` with the residual r across the line of sight, so that
      edges under tension break, most at the tip of a crack, which lets it grow. σ falls from five times to once
      `scale`, or stays above the noise, three standard deviations of the residuals.

    What has given way entirely is not part of the large solve (:mod:`psstereo.depth.discontinuity_solve`). The last
    step finds the pieces that came loose (:mod:`psstereo.depth.discontinuity_parts`) and seats them on what they touch
    (:mod:`psstereo.depth.discontinuity_pieces`): normals fix them up to one constant each, and the constant follows
    from the prior, if it knows anything of the piece, else from the seam along which it touches, else from what
    surfaces do: one of both sides is in front all along the edge, as near as it may be.

    A cliff that tapers off, at both ends or at the rim of the mask, comes out right, however gently; so do hinges.
    Exact on planes and spheres, and equal to plain integration, but for rounding, where nothing is broken and
    nothing folds. For central projection it works on logarithms of the distance.

    Do not use it if the surface is smooth and speed matters, or if the normals are wrong by 5 degrees and more from
    pixel to pixel: on smooth surfaces it takes three to seven times as long, and such noise looks like cliffs, which
    doubles the error. What floats, tied to its surroundings by outlines alone, is placed by plausibility and can be
    wrong by as much as plain integration is (a handle in front of a pot, the foot of a goblet below its bowl); the fact
    ``pieces_seated`` counts such pieces. Where their depth matters, give a prior: one point on each piece is enough.

    Attributes
    ----------
    slant_exponent : float
        An edge weighs the cosine of its slant to this power (:mod:`psstereo.depth.edges`) [1].
    scale : float
        Residual across the line of sight at which an edge gives way [px].
    rounds : int
        Times that the weights follow the solution.
    behind : float
        Where something hidden in part touches nothing else: how far it lies behind the outline of what hides it, as
        a share of the outline's radius of curvature along the line of sight, or of the smaller piece's diameter if
        that is less. 0 is touching the outline, 1 a wall that a ball leans on [1].
    round_tolerance : float
        Relative residual of the linear solver in all rounds but the last, on images of more than 16 384 pixels [1].
    broken_tolerance : float
        Relative residual in the last round on such images where edges have given way; what is left is far less than
        what the breaks leave open [1].
    tolerance : float
        Relative residual of the linear solver in the last round elsewhere [1].
    max_iterations : int
        Iterations of the linear solver at most, in each round.
    threads : int
        Threads of the linear solver; the result does not depend on it.

    References
    ----------
    .. [1] A. Blake, A. Zisserman, "Visual Reconstruction", MIT Press, 1987, on weak continuity and graduated
       non-convexity.
    """

    name: ClassVar[str] = "discontinuity"
    takes_prior: ClassVar[bool] = True
    summary: ClassVar[str] = "Least squares that lets cliffs go and keeps hinges; for objects with depth jumps."
    slant_exponent: float = 2.0
    scale: float = 0.1
    rounds: int = 3
    behind: float = 0.5
    round_tolerance: float = 1e-4
    broken_tolerance: float = 1e-6
    tolerance: float = 1e-10
    max_iterations: int = 2000

    def __post_init__(self) -> None:
        fine = 0 <= self.slant_exponent <= 4 and 0 < self.scale < math.inf and 0 <= self.behind < math.inf
        fine &= 0 < self.tolerance < 1 and 0 < self.round_tolerance < 1 and 0 < self.broken_tolerance < 1
        if not (fine and self.rounds >= 0 and self.max_iterations >= 1 and self.threads >= 1):
            raise OptionError(
                given=(
                    f"The slant exponent is {self.slant_exponent}, the scale {self.scale}, the share behind "
                    f"{self.behind}, the tolerances {self.round_tolerance}, {self.broken_tolerance} and "
                    f"{self.tolerance}, the rounds {self.rounds}, the iteration limit {self.max_iterations}, the "
                    f"number of threads {self.threads}."
                ),
                needed=(
                    "They must be 0 to 4, above 0, at least 0, above 0 and below 1, at least 0, at least 1 and at "
                    "least 1."
                ),
                remedy="Leave them out to use 2, 0.1, 0.5, 1e-4, 1e-6, 1e-10, 3, 2000 and 1.",
            )

    def solve(self, domain: Domain, progress: Progress) -> Solution:
        """Solve and reweigh in turns; see :meth:`Integrator.solve`."""
        pitch = pixel_pitch(domain)
        plain = edge_steps(domain, slant_exponent=self.slant_exponent)
        components = components_of(plain, domain.inside)
        trust, outliers = _trust(domain, plain, components, pitch)
        prior, mean = centred_prior(domain, components)
        task = Task(
            inside=domain.inside,
            plain=plain,
            components=components,
            prior=prior,
            prior_weight=domain.prior_weight,
            max_iterations=self.max_iterations,
            threads=self.threads,
            solves=self.rounds + 1,
        )
        factor, found, iterations = trust, None, 0
        for done in range(self.rounds + 1):
            if found is not None:
                sigma = self.scale * _START ** ((self.rounds - done) / max(self.rounds - 1, 1))
                factor = _strained(plain, trust, found.values, components, sigma * pitch)
            tolerance = self.tolerance
            if domain.inside.size > _SMALL and done < self.rounds:
                tolerance = max(tolerance, self.round_tolerance)
            elif domain.inside.size > _SMALL and _released(plain, factor, 0.5):
                tolerance = max(tolerance, self.broken_tolerance)
            found = solve_apart(task, factor, start=None if found is None else found.values, tolerance=tolerance)
            iterations += found.iterations
            progress("integrate", round(90 * (done + 1) / (self.rounds + 1)), 100)
        assert found is not None
        values, seated = seat_pieces(domain, plain, factor, found.values, pitch=pitch, behind=self.behind, prior=prior)
        progress("integrate", 100, 100)
        facts: dict[str, Any] = {
            "path": found.path,
            "edges": plain.count,
            "edges_left_out": plain.left_out,
            "edges_turning": outliers,
            "edges_released": _released(plain, factor, 0.1),
            "pieces_seated": seated,
        }
        return Solution(
            values=values + mean,
            components=components,
            iterations=iterations,
            residual=found.residual,
            converged=found.converged,
            facts=facts,
        )


def _released(plain: EdgeSteps, factor: Two, share: float) -> int:
    """Return how many edges have kept less than a share of their weight."""
    weights = plain.right_weight, plain.down_weight
    return sum(
        int(np.count_nonzero((weight > 0) & (part < share))) for weight, part in zip(weights, factor, strict=True)
    )


def _trust(domain: Domain, plain: EdgeSteps, components: IntArray, pitch: float) -> tuple[Two, int]:
    """Return the factors in 0 to 1 that normals alone give each edge, and how many edges turn too much."""
    there = plain.right_weight > 0, plain.down_weight > 0
    folds, labels = [], []
    for ends, chord, edges in zip(edge_ends(), (plain.right, plain.down), there, strict=True):
        first, second = plane_steps(domain, ends)
        folds.append(np.where(edges, np.abs((first + second) / 2.0 - chord) / pitch, 0.0))
        labels.append(np.where(edges, components[ends[0]], 0))
    limit = np.maximum(_FOLD, _FOLDS * _medians(folds, labels, components))
    factors, outliers = [], 0
    turns, cosine = turning(domain, components), cosines(domain)
    for turn, fold, label, (a, b), is_down in zip(turns, folds, labels, edge_ends(), (False, True), strict=True):
        outlier = turn > _OUTLIER
        outliers += int(np.count_nonzero(outlier))
        gaps = bridged(outlier.T).T if is_down else bridged(outlier)
        ratio = np.where(gaps, np.maximum(turn, _BRIDGE), turn)
        evidence = 1.0 / (1.0 + np.maximum(ratio - _USUAL_TURN, 0.0) ** 2) ** 2
        slant = _GRAZING / np.maximum((cosine[a] + cosine[b]) / 2.0, _SMALLEST_COSINE)
        factors.append(np.maximum(evidence, _LEAST_EVIDENCE) / (1.0 + (fold / limit[label]) ** 2) / (1.0 + slant**4))
    return (factors[0], factors[1]), outliers


def _strained(plain: EdgeSteps, trust: Two, values: FloatArray, components: IntArray, sigma: float) -> Two:
    """Return the factors after a solution: edges give way where their residual exceeds sigma and the noise."""
    right = plain.right_weight * (np.diff(values, axis=1) - plain.right) ** 2
    down = plain.down_weight * (np.diff(values, axis=0) - plain.down) ** 2
    labels = [
        np.where(plain.right_weight > 0, components[:, 1:], 0),
        np.where(plain.down_weight > 0, components[1:], 0),
    ]
    noise = _NOISE**2 * _medians([right, down], labels, components)
    limit = np.maximum(sigma**2, noise)
    return trust[0] / (1.0 + right / limit[labels[0]]) ** 2, trust[1] / (1.0 + down / limit[labels[1]]) ** 2


def _medians(values: list[FloatArray], labels: list[IntArray], components: IntArray) -> FloatArray:
    """Return the median over each component's edges, entry 0 for no edge."""
    every, owner = np.concatenate([part.ravel() for part in values]), np.concatenate([part.ravel() for part in labels])
    known = owner > 0
    return medians(every[known], owner[known], int(components.max(initial=0)))
