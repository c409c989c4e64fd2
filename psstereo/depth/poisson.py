"""Plain integration: weighted least squares over the edges, the discrete Poisson equation on any domain."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.depth.domain import COMPILED, Domain
from psstereo.depth.edges import components_of, edge_steps
from psstereo.depth.integrator import Integrator, Solution
from psstereo.depth.rows import Rows
from psstereo.depth.weighted import solve_weighted
from psstereo.errors import OptionError
from psstereo.kernels.dispatch import kernel
from psstereo.results import DepthKind
from psstereo.types import FloatArray, IntArray, Progress

__all__ = ["Poisson"]

_PASSES = ("divergence", "divide", "mismatch")


@dataclass(frozen=True, kw_only=True)
class Poisson(Integrator):
    r"""Least squares over the steps between neighbours: minimise Σ w_ab (s_b − s_a − c_ab)².

    s is the height or the logarithm of the distance, c_ab the step that two normals demand
    (:mod:`psstereo.depth.edges`), and the border is free (natural boundary). A full rectangle with equal weights is
    solved exactly by a cosine transform [1]_; any other domain by conjugate gradients with a multigrid preconditioner
    (:mod:`psstereo.depth.weighted`): some 8 iterations for most masks of any size, 20 to 50 where normals turn
    abruptly, some 150 for mazes and for weights that range over six decades from pixel to pixel.

    Exact, to the tolerance, on planes and spheres; on other smooth surfaces the error falls with the square of the
    pixel's size. Equal input gives equal bytes, whatever the number of threads.

    Do not use it where the depth jumps inside the mask: least squares spreads the jump over its surroundings. Cut the
    mask along the jump, or use a discontinuity-preserving method.

    Attributes
    ----------
    slant_exponent : float
        An edge weighs the cosine of its slant to this power (:mod:`psstereo.depth.edges` says why 2); 0 lets grazing
        pixels outvote the others [1].
    turn : float or None
        Angle between neighbouring normals at which their edge loses three quarters of its weight: a crease, or the
        border of another surface; None for no matter (:mod:`psstereo.depth.edges` says why 8 degrees). With that and
        `slant_exponent` 0 all edges weigh the same, and full rectangles are left to the cosine transform [rad].
    tolerance : float
        Relative residual at which the iteration stops, for each component. The default leaves errors of about 10⁻⁸
        pixels, far below those of the discretisation, so that planes are exact for every purpose [1].
    max_iterations : int
        Iterations at most.
    threads : int
        Threads of the cosine transform; multigrid uses one.

    References
    ----------
    .. [1] T. Simchony, R. Chellappa, M. Shao, "Direct analytical methods for solving Poisson equations in computer
       vision problems", IEEE PAMI 12(5), 1990. doi:10.1109/34.55103

    Examples
    --------
    >>> import numpy as np
    >>> from psstereo.camera import Orthographic
    >>> slope = np.broadcast_to([-0.6, 0.0, 0.8], (2, 3, 3))
    >>> Poisson().integrate(slope, Orthographic()).depth.round(6).tolist()
    [[-0.75, 0.0, 0.75], [-0.75, 0.0, 0.75]]
    """

    name: ClassVar[str] = "poisson"
    takes_prior: ClassVar[bool] = True
    summary: ClassVar[str] = "Weighted least squares over neighbouring pixels; smooth surfaces without depth jumps."
    slant_exponent: float = 2.0
    turn: float | None = math.radians(8.0)
    tolerance: float = 1e-10
    max_iterations: int = 2000

    def __post_init__(self) -> None:
        limits = self.max_iterations >= 1 and self.threads >= 1 and 0 <= self.slant_exponent <= 4
        if not (limits and (self.turn is None or self.turn > 0) and 0 < self.tolerance < 1):
            raise OptionError(
                given=(
                    f"The slant exponent is {self.slant_exponent}, the turn {self.turn}, the tolerance "
                    f"{self.tolerance}, the iteration limit {self.max_iterations}, the threads {self.threads}."
                ),
                needed="They must be 0 to 4, above 0, above 0 and below 1, at least 1, and at least 1.",
                remedy="Leave them out to use 2, 0.14, 1e-10, 2000 and 1.",
            )

    def solve(self, domain: Domain, progress: Progress) -> Solution:
        """Solve the normal equations; see :meth:`Integrator.solve`."""
        even = self.slant_exponent == 0 and self.turn is None and domain.weights is None and domain.prior is None
        if even and domain.inside.all():
            found = _by_cosine_transform(domain, self.threads, self.tolerance)
            if found is not None:
                progress("integrate", 100, 100)
                return found
        steps = edge_steps(domain, slant_exponent=self.slant_exponent, turn=self.turn, threads=self.threads)
        components = components_of(steps, domain.inside)

        def report(residual: float) -> None:
            share = 1.0 if residual <= self.tolerance else math.log(min(residual, 1.0)) / math.log(self.tolerance)
            progress("integrate", round(100 * share), 100)

        # The prior without its mean: the tolerance is then relative to the relief, not to the distance.
        prior, mean = _centred(domain, components)
        solved = solve_weighted(
            steps,
            domain.inside,
            prior=prior,
            prior_weight=domain.prior_weight,
            components=components,
            tolerance=self.tolerance,
            max_iterations=self.max_iterations,
            threads=self.threads,
            report=report,
        )
        progress("integrate", 100, 100)
        return Solution(
            values=solved.values if mean is None else solved.values + mean,
            components=components,
            iterations=solved.iterations,
            residual=solved.residual,
            converged=solved.converged,
            facts={
                "path": solved.path,
                "levels": solved.levels,
                "edges": steps.count,
                "edges_left_out": steps.left_out,
            },
        )


def _centred(domain: Domain, components: IntArray) -> tuple[FloatArray | None, FloatArray | None]:
    """Return the prior less its weighted mean over each component, and that mean at each pixel; None without prior."""
    if domain.prior is None or domain.prior_weight is None:
        return None, None
    labels, weight = components.ravel(), domain.prior_weight.ravel()
    total = np.bincount(labels, weight)
    mean = np.bincount(labels, weight * domain.prior.ravel()) / np.where(total > 0, total, 1.0)
    return np.where(domain.prior_weight > 0, domain.prior - mean[components], 0.0), mean[components]


def _by_cosine_transform(domain: Domain, threads: int, tolerance: float) -> Solution | None:
    """Solve a full rectangle with equal weights, or return None if a step is missing.

    The cosine transform of type II diagonalises its Laplacian: the eigenvalues are 4 sin²(πj/2h) + 4 sin²(πk/2w). The
    residual is that of the equations, in length.
    """
    from scipy.fft import dctn, idctn

    height, width = domain.inside.shape
    passes = {name: kernel("poisson_transform", name, domain.inside.size, COMPILED) for name in _PASSES}
    right_side, lost, sums = np.zeros((height, width)), np.zeros(height, np.int64), np.zeros((height, 2))
    corner = (domain.window[0].start, domain.window[1].start)
    look = (domain.inside, domain.matrix, domain.array, domain.kind is DepthKind.DISTANCE)
    with Rows(threads) as rows:
        rows(passes["divergence"], (domain.given, *corner, *look, right_side, lost), 0, height, width)
        if lost.any():
            return None
        down = 4.0 * np.sin(np.pi * np.arange(height) / (2.0 * height)) ** 2
        across = 4.0 * np.sin(np.pi * np.arange(width) / (2.0 * width)) ** 2
        values = dctn(right_side, norm="ortho", workers=threads)
        rows(passes["divide"], (values, down, across), 0, height, width)
        values = np.asarray(idctn(values, norm="ortho", workers=threads, overwrite_x=True))
        rows(passes["mismatch"], (values, right_side, sums), 0, height, width)
    error, size = (float(total) for total in sums.sum(axis=0))
    residual = math.sqrt(error / size) if size > 0 else 0.0
    edges = height * (width - 1) + (height - 1) * width
    return Solution(
        values=values,
        components=np.ones(domain.inside.shape, np.int32),
        residual=residual,
        converged=residual <= tolerance,
        centred=True,
        facts={"path": "cosine transform", "edges": edges, "edges_left_out": 0},
    )
