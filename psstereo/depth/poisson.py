"""Plain integration: weighted least squares over the edges, the discrete Poisson equation on any domain."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from psstereo.depth.domain import Domain
from psstereo.depth.edges import EdgeSteps, components_of, edge_steps
from psstereo.depth.integrator import Integrator, Solution
from psstereo.depth.multigrid import conjugate_gradients, make_hierarchy, v_cycle
from psstereo.errors import OptionError
from psstereo.types import BoolArray, FloatArray, IntArray, Progress

__all__ = ["Poisson", "edge_laplacian"]


@dataclass(frozen=True, kw_only=True)
class Poisson(Integrator):
    r"""Least squares over the steps between neighbours: minimise Σ w_ab (s_b − s_a − c_ab)².

    s is the height or the logarithm of the distance, c_ab the step that two normals demand
    (:mod:`psstereo.depth.edges`), and the border is free (natural boundary). A full rectangle with equal weights is
    solved exactly by a cosine transform [1]_; any other domain by conjugate gradients with an aggregation multigrid
    preconditioner (:mod:`psstereo.depth.multigrid`): some 20 iterations for most masks, some 100 for mazes and for
    weights that range over six decades from pixel to pixel.

    Exact, to the tolerance, on planes and spheres; on other smooth surfaces the error falls with the square of the
    pixel's size. Equal input gives equal bytes, whatever the number of threads.

    Do not use it where the depth jumps inside the mask: least squares spreads the jump over its surroundings. Cut the
    mask along the jump, or use a discontinuity-preserving method.

    Attributes
    ----------
    slant_exponent : float
        An edge weighs the cosine of its slant to this power (:mod:`psstereo.depth.edges` says why 2). With 0 all weigh
        the same, which makes full rectangles some five times faster, but lets grazing pixels outvote the others [1].
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
    summary: ClassVar[str] = "Weighted least squares over neighbouring pixels; smooth surfaces without depth jumps."
    slant_exponent: float = 2.0
    tolerance: float = 1e-10
    max_iterations: int = 2000

    def __post_init__(self) -> None:
        limits = self.max_iterations >= 1 and self.threads >= 1 and 0 <= self.slant_exponent <= 4
        if not (limits and 0 < self.tolerance < 1):
            raise OptionError(
                given=(
                    f"The slant exponent is {self.slant_exponent}, the tolerance {self.tolerance}, the iteration limit "
                    f"{self.max_iterations}, the number of threads {self.threads}."
                ),
                needed="They must be 0 to 4, above 0 and below 1, at least 1, and at least 1.",
                remedy="Leave them out to use 2, 1e-10, 2000 and 1.",
            )

    def solve(self, domain: Domain, progress: Progress) -> Solution:
        """Solve the normal equations; see :meth:`Integrator.solve`."""
        steps = edge_steps(domain, slant_exponent=self.slant_exponent)
        components = components_of(steps, domain.inside)
        facts = {
            "edges": steps.count,
            "edges_left_out": steps.left_out,
        }
        if domain.inside.all() and steps.uniform:
            values, residual = _by_cosine_transform(steps, domain.inside.shape, self.threads)
            progress("integrate", 100, 100)
            return Solution(
                values=values,
                components=components,
                residual=residual,
                converged=residual <= self.tolerance,
                facts={"path": "cosine transform", **facts},
            )
        return self._by_multigrid(steps, domain.inside, components, facts, progress)

    def _by_multigrid(
        self, steps: EdgeSteps, inside: BoolArray, components: IntArray, facts: dict[str, Any], progress: Progress
    ) -> Solution:
        matrix, right_side = edge_laplacian(steps, inside)
        labels = components[inside] - 1
        levels = make_hierarchy(matrix, np.argwhere(inside).astype(np.int32), labels)

        def report(residual: float) -> None:
            share = 1.0 if residual <= self.tolerance else math.log(min(residual, 1.0)) / math.log(self.tolerance)
            progress("integrate", round(100 * share), 100)

        solution, convergence = conjugate_gradients(
            matrix,
            right_side,
            lambda residual: v_cycle(levels, residual),
            labels,
            tolerance=self.tolerance,
            max_iterations=self.max_iterations,
            report=report,
        )
        progress("integrate", 100, 100)
        values = np.zeros(inside.shape)
        values[inside] = solution
        return Solution(
            values=values,
            components=components,
            iterations=convergence.iterations,
            residual=convergence.residual,
            converged=convergence.residual <= self.tolerance,
            facts={"path": "multigrid conjugate gradients", "levels": len(levels), **facts},
        )


def edge_laplacian(steps: EdgeSteps, inside: BoolArray) -> tuple[Any, FloatArray]:
    """Return the normal equations of the edges, L s = b.

    Parameters
    ----------
    steps : EdgeSteps
        The edges.
    inside : bool array (h, w)
        Pixels of the domain; the unknowns are these in row-major order.

    Returns
    -------
    matrix : sparse float64 array (p, p)
        L = Gᵀ W G with the differences G along the edges and their weights W; rows sum to zero.
    right_side : float64 array (p,)
        b = Gᵀ W c with the steps c.
    """
    from scipy.sparse import coo_array

    count = int(np.count_nonzero(inside))
    index = np.cumsum(inside, dtype=np.int32).reshape(inside.shape) - np.int32(1)
    right, down = steps.right_weight > 0, steps.down_weight > 0
    start = np.concatenate([index[:, :-1][right], index[:-1][down]])
    stop = np.concatenate([index[:, 1:][right], index[1:][down]])
    weight = np.concatenate([steps.right_weight[right], steps.down_weight[down]])
    every = np.arange(count, dtype=np.int32)
    diagonal = np.bincount(start, weight, count) + np.bincount(stop, weight, count)
    matrix = coo_array(
        (
            np.concatenate([-weight, -weight, diagonal]),
            (np.concatenate([start, stop, every]), np.concatenate([stop, start, every])),
        ),
        shape=(count, count),
    ).tocsr()
    return matrix, _divergence(steps, inside.shape)[inside]


def _divergence(steps: EdgeSteps, shape: tuple[int, ...]) -> FloatArray:
    """Return the weighted steps that arrive at each pixel minus those that leave it, (h, w)."""
    total = np.zeros(shape)
    flow = steps.right_weight * steps.right
    total[:, 1:] += flow
    total[:, :-1] -= flow
    flow = steps.down_weight * steps.down
    total[1:] += flow
    total[:-1] -= flow
    return total


def _by_cosine_transform(steps: EdgeSteps, shape: tuple[int, int], threads: int) -> tuple[FloatArray, float]:
    """Solve the Laplacian of a full rectangle with equal weights; return values and relative residual.

    The cosine transform of type II diagonalises it: the eigenvalues are 4 sin²(πj/2h) + 4 sin²(πk/2w).
    """
    from scipy.fft import dctn, idctn

    rows = 4.0 * np.sin(np.pi * np.arange(shape[0]) / (2.0 * shape[0])) ** 2
    columns = 4.0 * np.sin(np.pi * np.arange(shape[1]) / (2.0 * shape[1])) ** 2
    eigenvalues = rows[:, None] + columns[None, :]
    eigenvalues[0, 0] = np.inf  # the free constant: divided by infinity it becomes zero
    sides = (steps.right_weight, steps.down_weight)
    weight = max((float(side.flat[0]) for side in sides if side.size), default=1.0)
    right_side = _divergence(steps, shape) / weight
    spectrum = dctn(right_side, norm="ortho", workers=threads)
    values = np.asarray(idctn(spectrum / eigenvalues, norm="ortho", workers=threads))
    found = EdgeSteps(
        right=np.diff(values, axis=1),
        down=np.diff(values, axis=0),
        right_weight=np.ones((shape[0], shape[1] - 1)),
        down_weight=np.ones((shape[0] - 1, shape[1])),
        left_out=0,
    )
    error = dctn(right_side - _divergence(found, shape), norm="ortho", workers=threads)
    energy = float(np.sum(spectrum**2 / eigenvalues))
    return values, math.sqrt(float(np.sum(error**2 / eigenvalues)) / energy) if energy > 0 else 0.0
