"""Weighted least squares over edges of any weights: the one linear solve that all integrators share.

:func:`solve_weighted` minimises, over the values s on a set of pixels,

    Σ_edges w_ab (s_b − s_a − c_ab)²  +  Σ_pixels λ_p (s_p − t_p)²

with edge weights w ≥ 0 that may span twelve decades and more, an optional prior t of weight λ ≥ 0, and an optional
start. Two equations on the same edge, (w, c) and (w', c'), are one of weight w + w' and step (w c + w' c') / (w + w').

    steps = EdgeSteps(right=…, down=…, right_weight=…, down_weight=…, left_out=0)
    found = solve_weighted(steps, inside, start=last_values, tolerance=1e-4, solves=20)
    found.values, found.iterations, found.residual, found.converged

Pieces of the domain that no edge and no prior ties down are solved up to a constant, which may be anything. The
tolerance is met by each connected component for itself, relative to its own right side. Who solves many times over
says so with `solves`, so that the compiled loops are loaded when they pay; the components, which do not change unless
an edge appears or vanishes, may be handed over.

Conjugate gradients is preconditioned by a multigrid on the pixel grid (:mod:`psstereo.depth.grid`), and by the
algebraic one (:mod:`psstereo.depth.multigrid`) where that turns out too slow: in mazes, or with weights that jump over
decades from pixel to pixel. The components' right sides are brought to the same size first, so that a flat island next
to a steep one is solved as well.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from psstereo.depth.edges import EdgeSteps, components_of
from psstereo.depth.grid import COMPILED, GridCycle
from psstereo.depth.multigrid import conjugate_gradients, make_hierarchy, v_cycle
from psstereo.depth.rows import Rows
from psstereo.kernels.dispatch import kernel
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Weighted", "solve_weighted"]

_WEAK, _PIECES = 1e-7, 1000
"""Weight beside the largest below which an edge is too weak for the iteration to see, and pieces up to which they are
put in their places one by one."""
_PATIENCE = 30
"""Iterations after which the pace is looked at."""
_LONG = 250
"""Iterations beyond which building the algebraic hierarchy is cheaper, at the pace of the last `_PATIENCE`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Weighted:
    """What a weighted solve found.

    Attributes
    ----------
    values : float64 array (h, w)
        The minimiser; 0 outside [unit of the steps].
    components : int32 array (h, w)
        Pieces that edges hold together, from 1; 0 outside.
    iterations : int
        Iterations of conjugate gradients.
    residual : float
        Worst component's residual, recomputed from the values, relative to its right side, in the norm of the
        preconditioner (close to the relative error in the energy norm) [1].
    converged : bool
        Whether the residual met the tolerance.
    path : str
        How it was solved.
    levels : int
        Levels of the hierarchy.
    """

    values: FloatArray
    components: IntArray
    iterations: int
    residual: float
    converged: bool
    path: str
    levels: int


def solve_weighted(
    steps: EdgeSteps,
    inside: BoolArray,
    *,
    prior: FloatArray | None = None,
    prior_weight: FloatArray | None = None,
    start: FloatArray | None = None,
    components: IntArray | None = None,
    tolerance: float = 1e-10,
    max_iterations: int = 2000,
    threads: int = 1,
    solves: int = 1,
    report: Callable[[float], None] = lambda _residual: None,
) -> Weighted:
    """Minimise Σ w (s_b − s_a − c)² + Σ λ (s − t)².

    Parameters
    ----------
    steps : EdgeSteps
        Steps c and weights w of the edges; 0 where there is no edge, above all where an end lies outside.
    inside : bool array (h, w)
        Pixels of the domain.
    prior : float64 array (h, w), optional
        Values t wanted; read only where `prior_weight` is above 0 [unit of the steps].
    prior_weight : float64 array (h, w), optional
        Weights λ of the prior, on the scale of the edge weights; 0 where there is none [1].
    start : float64 array (h, w), optional
        Values to start from; a good start saves iterations [unit of the steps].
    components : int array (h, w), optional
        What :func:`~psstereo.depth.edges.components_of` returned for these edges, to save its time.
    tolerance : float
        Relative residual wanted, for every component [1].
    max_iterations : int
        Iterations at most.
    threads : int
        Threads at most; the result does not depend on it.
    solves : int
        Solves of this size that the caller expects to ask for.
    report : callable, optional
        Told the relative residual after each iteration.

    Returns
    -------
    Weighted
        Values and how they were found.
    """
    if components is None:
        components = components_of(steps, inside)
    held = np.zeros((0, 0)), np.zeros((0, 0))
    if prior is not None and prior_weight is not None:
        weight = np.where(inside, prior_weight, 0.0)
        held = weight, np.where(weight > 0, prior, 0.0)
    with Rows(threads) as rows:
        grid = _OnGrid(
            steps=steps,
            prior_weight=held[0],
            prior=held[1],
            components=components,
            rows=rows,
            compiled=inside.size * solves >= COMPILED,
            tolerance=tolerance,
            report=report,
        )
        begin = np.zeros(inside.shape) if start is None else np.where(inside, start, 0.0)
        values, done, residual, slow = grid.solve(begin, max_iterations)
    # A coarse node whose own pixel lies outside leaves its value there.
    np.multiply(values, inside, out=values)
    path, levels = "grid multigrid", grid.cycle.levels
    if slow:
        values, more, residual, levels = _by_algebra(
            steps,
            inside,
            components,
            held=held,
            start=values,
            tolerance=tolerance,
            limit=max_iterations - done,
            report=report,
        )
        done, path = done + more, "algebraic multigrid"
    values = _settled(steps, inside, components, held, values)
    return Weighted(
        values=values,
        components=components,
        iterations=done,
        residual=residual,
        converged=residual <= tolerance,
        path=path,
        levels=levels,
    )


def _settled(
    steps: EdgeSteps,
    inside: BoolArray,
    components: IntArray,
    held: tuple[FloatArray, FloatArray],
    values: FloatArray,
) -> FloatArray:
    """Return values with the pieces that nearly weightless edges alone tie together put in their places.

    No residual of the whole sees such ties beside the others; on their own they are a small well-scaled system.
    """
    weights = (steps.right_weight, steps.down_weight)
    weak = _WEAK * max(float(part.max(initial=0.0)) for part in weights)
    if not any(((part > 0) & (part <= weak)).any() for part in weights):
        return values
    right, down = (np.where(part > weak, part, 0.0) for part in weights)
    pieces = components_of(replace(steps, right_weight=right, down_weight=down), inside)
    count = int(pieces.max(initial=0)) + 1
    if count > _PIECES or count == int(components.max(initial=0)) + 1:
        return values
    matrix, side = np.zeros((count, count)), np.zeros(count)
    across = (weights[0], steps.right, np.diff(values, axis=1), pieces[:, :-1], pieces[:, 1:])
    along = (weights[1], steps.down, np.diff(values, axis=0), pieces[:-1], pieces[1:])
    for weight, step, found, first, last in (across, along):
        tie = (weight > 0) & (first != last)
        w, off = weight[tie], (weight * (step - found))[tie]
        for i, j, sign in ((first[tie], last[tie], -1.0), (last[tie], first[tie], 1.0)):
            np.add.at(matrix, (i, i), w)
            np.add.at(matrix, (i, j), -w)
            np.add.at(side, i, sign * off)
    tied = np.zeros(int(components.max()) + 1)
    if held[0].size:
        matrix[np.diag_indices(count)] += np.bincount(pieces.ravel(), held[0].ravel(), count)
        side += np.bincount(pieces.ravel(), (held[0] * (held[1] - values)).ravel(), count)
        tied = np.asarray(np.bincount(components.ravel(), held[0].ravel(), len(tied)), np.float64)
    which, place = np.unique(components, return_index=True)
    pinned = np.append(pieces.ravel()[place[tied[which] <= 0]], 0)  # one piece of each component that nothing holds
    matrix[pinned], side[pinned] = np.eye(count)[pinned], 0.0
    scale = 1.0 / np.abs(matrix.diagonal())
    shift = np.linalg.solve(matrix * scale[:, None], side * scale)
    return np.asarray(np.where(inside, values + shift[pieces], values))


@dataclass(kw_only=True, eq=False)
class _OnGrid:
    """Conjugate gradients with the grid's multigrid."""

    steps: EdgeSteps
    prior_weight: FloatArray
    prior: FloatArray
    components: IntArray
    rows: Rows
    compiled: bool
    tolerance: float
    report: Callable[[float], None]
    cycle: GridCycle = field(init=False)

    def __post_init__(self) -> None:
        work = float(COMPILED) if self.compiled else None
        self._residual = kernel("multigrid_krylov", "residual", work, COMPILED)
        self._multiply = kernel("multigrid_krylov", "multiply", work, COMPILED)
        self._advance = kernel("multigrid_krylov", "advance", work, COMPILED)
        self._turn = kernel("multigrid_krylov", "turn", work, COMPILED)
        largest = max(
            (
                float(part.max(initial=0.0))
                for part in (self.steps.right_weight, self.steps.down_weight, self.prior_weight)
            ),
            default=0.0,
        )
        self.cycle = GridCycle(
            self.steps.right_weight,
            self.steps.down_weight,
            self.prior_weight,
            scale=1.0 / largest if largest > 0 else 1.0,
            rows=self.rows,
            compiled=self.compiled,
        )
        self.height, self.width = self.components.shape
        self.count = int(self.components.max(initial=0))
        self.one = self.count <= 1

    def solve(self, start: FloatArray, limit: int) -> tuple[FloatArray, int, float, bool]:
        """Return values, iterations, residual, and whether another preconditioner should take over."""
        left = self._left(np.zeros_like(start))
        size = self._size(left)
        if start.any():
            left = self._left(start)
            size = np.where(size > 0, size, self._size(left))
        own = np.where(size > 0, 1.0 / np.where(size > 0, size, 1.0), 1.0)
        factor: FloatArray | float = float(own[-1]) if self.one else own[self.components]
        reference = self._energies(self._left(np.zeros_like(start)) * factor) if start.any() else None
        values, done, before, slow = start, 0, math.inf, False
        while True:
            left *= factor
            energies = self._energies(left)
            if reference is None:
                reference = energies
            elif math.isinf(before):  # a component whose right side is zero is judged by what its start leaves
                reference = np.where(reference > 0, reference, energies)
            reached = _worst(energies, reference)
            # Rounding makes the recurrence drift from the true residual: begin again from that until they agree.
            if reached <= self.tolerance or done >= limit or slow or not reached < 0.5 * before:
                return values, done, reached, slow
            before = reached
            change, more, slow = self._iterate(left, reference, limit - done)
            done += more
            values = values + change / factor
            left = self._left(values)

    def _left(self, values: FloatArray) -> FloatArray:
        """Return b − A values."""
        steps, out = self.steps, np.zeros_like(values)
        edges = (steps.right_weight, steps.down_weight, steps.right, steps.down, self.prior_weight, self.prior)
        self.rows(self._residual, (*edges, values, out), 0, self.height, self.width)
        return out

    def _size(self, left: FloatArray) -> FloatArray:
        """Return the length of each component's residual, entry 0 for outside; only the last for a single one."""
        if self.one:
            return np.array([0.0, float(np.sqrt(np.sum(left * left)))])
        return np.sqrt(np.bincount(self.components.ravel(), (left * left).ravel(), self.count + 1))

    def _energies(self, left: FloatArray) -> FloatArray:
        """Return the product of residual and correction of each component, of those that :meth:`_size` counts."""
        self.shrink = float(np.abs(left).max(initial=0.0)) or 1.0
        np.multiply(left, 1.0 / self.shrink, out=self.cycle.right_side[1:-2, 1:-2], casting="same_kind")
        total = self.cycle.run() * self.shrink**2
        if self.one:
            return np.array([0.0, max(total, 0.0)])
        product = left * self.cycle.value[1:-2, 1:-2] * self.shrink
        return np.maximum(np.bincount(self.components.ravel(), product.ravel(), self.count + 1), 0.0)

    def _iterate(self, left: FloatArray, reference: FloatArray, limit: int) -> tuple[FloatArray, int, bool]:
        """Run conjugate gradients from the residual and the correction at hand; return change, iterations, slowness."""
        cycle, steps = self.cycle, self.steps
        change, image, sums = np.zeros_like(left), np.zeros_like(left), np.zeros(self.height)
        direction = np.zeros_like(cycle.value)
        size = (self.height, self.width)
        positive = reference[reference > 0]
        # In units of the residual's largest entry, as the cycle sees it.
        target = self.tolerance**2 * float(positive.min(initial=math.inf)) / self.shrink**2
        whole = float(positive.sum()) / self.shrink**2
        energy, ratio, done = float(cycle.sums.sum()) if cycle.levels > 1 else cycle.run(), 0.0, 0
        history = [energy]
        while done < limit and energy > target:
            self.rows(self._turn, (cycle.value, ratio, direction), 0, *size)
            operator = (steps.right_weight, steps.down_weight, self.prior_weight)
            self.rows(self._multiply, (*operator, direction, image, sums), 0, *size)
            curvature = float(sums.sum())
            if not curvature > 0:
                break
            length = energy / curvature
            there = (length * self.shrink, direction, image, 1.0 / self.shrink, change, left, cycle.right_side)
            self.rows(self._advance, there, 0, *size)
            following = cycle.run()
            ratio, energy, done = following / energy, following, done + 1
            history.append(energy)
            self.report(math.sqrt(max(energy, 0.0) / whole))
            if done % _PATIENCE == 0 and _remaining(history, target) > _LONG:
                return change, done, True
        return change, done, False


def _remaining(history: list[float], target: float) -> float:
    """Return the iterations still to go at the pace of the last ones."""
    now, then = max(history[-1], 1e-300), history[-1 - _PATIENCE]
    pace = math.log(then / now) / _PATIENCE if then > now else 0.0
    return math.log(now / target) / pace if pace > 0 else math.inf


def _worst(energies: FloatArray, reference: FloatArray) -> float:
    """Return the largest relative residual; components that had nothing to solve count as 0."""
    ratio = np.where(reference > 0, energies / np.where(reference > 0, reference, 1.0), 0.0)
    return float(np.sqrt(ratio.max(initial=0.0)))


def _by_algebra(
    steps: EdgeSteps,
    inside: BoolArray,
    components: IntArray,
    *,
    held: tuple[FloatArray, FloatArray],
    start: FloatArray,
    tolerance: float,
    limit: int,
    report: Callable[[float], None],
) -> tuple[FloatArray, int, float, int]:
    """Return values, iterations, residual and levels of the algebraic multigrid."""
    from scipy.sparse import diags_array

    from psstereo.depth.laplacian import edge_laplacian

    labels = components[inside] - 1
    matrix, right_side = edge_laplacian(steps, inside)
    if held[0].size:
        weight = held[0][inside]
        matrix = (matrix + diags_array(weight)).tocsr()
        right_side = right_side + weight * held[1][inside]
    levels = make_hierarchy(matrix, np.argwhere(inside).astype(np.int32), labels)
    solution, convergence = conjugate_gradients(
        matrix,
        right_side,
        lambda residual: v_cycle(levels, residual),
        labels,
        start=start[inside],
        tolerance=tolerance,
        max_iterations=limit,
        report=report,
    )
    values = np.zeros(inside.shape)
    values[inside] = solution
    return values, convergence.iterations, convergence.residual, len(levels)
