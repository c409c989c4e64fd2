"""Conjugate gradients for weighted graph Laplacians on a pixel grid, preconditioned by smoothed aggregation.

The grid's own multigrid (:mod:`psstereo.depth.grid`) is ten times as fast where it works; this one sees the graph, not
the grid, and takes over in mazes and where weights jump over decades from pixel to pixel: 10 to 40 iterations, or 100.

The hierarchy. Pixels in the same 3 × 3 block that strong edges hold together form one aggregate; a pixel without a
strong edge in its block joins its strongest neighbour. Aggregates never cross a component or a gap of the mask.
The prolongation is the aggregates' indicator, smoothed by one Jacobi step; coarse matrices are Galerkin products. A
component that has shrunk to one node is dropped from the coarser levels: nothing is left to solve there, since its
residuals sum to zero (with a prior, one iteration more). So no direct solver, no pinned pixel and no BLAS is needed.

Every coefficient is local (the Jacobi steps are scaled by the sum of magnitudes of a row, which bounds the spectrum by
1), and conjugate gradients runs with one pair of scalars for each component. Thus components are solved independently
of each other, to the last bit, and sums have a fixed order: the same bytes whatever the number of threads.

References
----------
.. [1] P. Vaněk, J. Mandel, M. Brezina, "Algebraic multigrid by smoothed aggregation for second and fourth order
   elliptic problems", Computing 56, 1996. doi:10.1007/BF02238511
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from psstereo.types import FloatArray, IntArray

__all__ = ["Convergence", "Level", "conjugate_gradients", "make_hierarchy", "v_cycle"]

_BLOCK = 3
_STRONG = 0.1
"""Share of the geometric mean of both ends' strongest edges from which an edge is strong [1]."""
_SMOOTHING = 4.0 / 3.0
"""Jacobi step that flattens the spectrum best when its upper end is 1 [1]."""
_SPECTRUM = (1.0 / 6.0, 1.0)
"""Part of the spectrum that the Chebyshev smoother takes care of; the coarse grid does the rest [1]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Level:
    """One level of the hierarchy.

    Attributes
    ----------
    matrix : sparse array (p, p)
        The Laplacian, or its Galerkin product.
    scale : float64 array (p,)
        Inverse sum of magnitudes of each row; 0 for a node without edges.
    prolong, restrict : sparse arrays (p, q) and (q, p), or None
        From the next coarser level and to it; None on the coarsest level.
    """

    matrix: Any
    scale: FloatArray
    prolong: Any = None
    restrict: Any = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Convergence:
    """How conjugate gradients ended.

    Attributes
    ----------
    iterations : int
        Iterations done.
    residual : float
        Worst component's residual, recomputed from the solution, relative to its right side, in the norm of the
        preconditioner (close to the relative error in the energy norm) [1].
    """

    iterations: int
    residual: float


def make_hierarchy(matrix: Any, places: IntArray, components: IntArray) -> list[Level]:
    """Build the levels, finest first.

    Parameters
    ----------
    matrix : sparse array (p, p)
        Weighted graph Laplacian: symmetric, non-positive off the diagonal; rows sum to zero, or to a prior's weight.
    places : int array (p, 2)
        Row and column of each node [px].
    components : int array (p,)
        Connected component of each node, from 0.

    Returns
    -------
    list of Level
        At least one level; each is a half to a tenth of the one before.
    """
    from scipy.sparse import csr_array, diags_array

    levels: list[Level] = []
    while True:
        magnitudes = np.asarray(abs(matrix).sum(axis=1))
        scale = np.where(magnitudes > 0, 1.0 / np.where(magnitudes > 0, magnitudes, 1.0), 0.0)
        aggregate, places, node_components = _aggregate(matrix, places, components)
        alive = np.bincount(node_components)[node_components] > 1
        if not alive.any() or aggregate.size == node_components.size:
            levels.append(Level(matrix=matrix, scale=scale))
            return levels
        kept = alive[aggregate]
        renumbered = np.cumsum(alive) - 1
        indicator = csr_array(
            (np.ones(np.count_nonzero(kept)), renumbered[aggregate[kept]], np.concatenate([[0], np.cumsum(kept)])),
            shape=(matrix.shape[0], int(np.count_nonzero(alive))),
        )
        prolong = (indicator - _SMOOTHING * (diags_array(scale) @ (matrix @ indicator))).tocsr()
        restrict = prolong.T.tocsr()
        levels.append(Level(matrix=matrix, scale=scale, prolong=prolong, restrict=restrict))
        matrix = (restrict @ (matrix @ prolong)).tocsr()
        places, components = places[alive], node_components[alive]


def _aggregate(matrix: Any, places: IntArray, components: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return each node's aggregate, and the aggregates' places (in blocks) and components."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    entries = matrix.tocoo()
    start, stop = entries.coords
    weight = -entries.data
    edges = (start != stop) & (weight > 0)
    start, stop, weight = start[edges], stop[edges], weight[edges]
    strongest = np.zeros(matrix.shape[0])
    np.maximum.at(strongest, start, weight)
    blocks = places // _BLOCK
    linked = (blocks[start] == blocks[stop]).all(axis=1)
    linked &= weight >= _STRONG * np.sqrt(strongest[start]) * np.sqrt(strongest[stop])
    # Whoever is alone in its block joins one neighbour, and only one, lest it should bridge what weak edges part.
    joined = np.zeros(matrix.shape[0], np.bool_)
    joined[start[linked]] = True
    alone = np.flatnonzero(~joined[start] & (weight >= strongest[start]))
    alone = alone[np.unique(start[alone], return_index=True)[1]]
    rows, columns = np.concatenate([start[linked], start[alone]]), np.concatenate([stop[linked], stop[alone]])
    graph = coo_array((np.ones(rows.size, np.int8), (rows, columns)), shape=matrix.shape)
    count, aggregate = connected_components(graph, directed=False)
    aggregate = np.asarray(aggregate, np.int32)
    member = np.zeros(count, np.int32)
    member[aggregate] = np.arange(aggregate.size, dtype=np.int32)
    return aggregate, blocks[member], components[member]


def v_cycle(levels: Sequence[Level], residual: FloatArray, *, depth: int = 0) -> FloatArray:
    """Apply the preconditioner: a symmetric V-cycle with Chebyshev smoothing of degree 2.

    Parameters
    ----------
    levels : sequence of Level
        The hierarchy.
    residual : float64 array (p,)
        Right side on level `depth`.
    depth : int
        Level to start on.

    Returns
    -------
    float64 array (p,)
        Approximate solution, up to a constant on each component.
    """
    level = levels[depth]
    if level.prolong is None:
        return _chebyshev(level, residual, 4)
    value = _chebyshev(level, residual, 2)
    value += level.prolong @ v_cycle(levels, level.restrict @ (residual - level.matrix @ value), depth=depth + 1)
    value += _chebyshev(level, residual - level.matrix @ value, 2)
    return value


def _chebyshev(level: Level, residual: FloatArray, degree: int) -> FloatArray:
    """Smooth from zero by a Chebyshev polynomial of the scaled matrix; symmetric, as its coefficients are fixed."""
    low, high = _SPECTRUM
    centre, half = (high + low) / 2, (high - low) / 2
    ratio = half / centre
    step = (level.scale / centre) * residual
    value = step.copy()
    for _ in range(degree - 1):
        residual = residual - level.matrix @ step
        following = 1.0 / (2.0 * centre / half - ratio)
        step = (following * ratio) * step + (2.0 * following / half) * (level.scale * residual)
        ratio = following
        value += step
    return np.asarray(value)


def conjugate_gradients(
    matrix: Any,
    right_side: FloatArray,
    precondition: Callable[[FloatArray], FloatArray],
    components: IntArray,
    *,
    start: FloatArray | None = None,
    tolerance: float,
    max_iterations: int,
    report: Callable[[float], None],
) -> tuple[FloatArray, Convergence]:
    """Solve the Laplacian, each connected component with scalars and a stopping rule of its own.

    Parameters
    ----------
    matrix : sparse array (p, p)
        Symmetric positive semi-definite; its null space is at most the constants of each component.
    right_side : float64 array (p,)
        Sums to zero over each component.
    precondition : callable
        Symmetric approximate inverse that keeps components apart.
    components : int array (p,)
        Connected component of each node, from 0.
    start : float64 array (p,), optional
        First guess; zero without one.
    tolerance : float
        Relative residual wanted, in the norm of the preconditioner, for every component [1].
    max_iterations : int
        Iterations at most, restarts included.
    report : callable
        Told the worst relative residual after each iteration.

    Returns
    -------
    solution : float64 array (p,)
        Values, up to a constant on each component.
    convergence : Convergence
        Iterations, and the residual recomputed from the solution.
    """
    size = int(components.max()) + 1

    def dot(a: FloatArray, b: FloatArray) -> FloatArray:
        return np.bincount(components, weights=a * b, minlength=size).astype(np.float64, copy=False)

    solution = np.zeros_like(right_side) if start is None else start.copy()
    scale = np.maximum(dot(right_side, precondition(right_side)), 0.0)
    residual = right_side - matrix @ solution
    done, before = 0, np.inf
    reached = _worst(dot(residual, precondition(residual)), scale)
    # The recurrence's residual drifts from the true one by rounding: restart from the true one until it agrees.
    while reached > tolerance and done < max_iterations and reached < 0.5 * before:
        residual = right_side - matrix @ solution
        value = precondition(residual)
        energy, direction = dot(residual, value), value
        while done < max_iterations and (active := energy > tolerance**2 * scale).any():
            image = matrix @ direction
            curvature = dot(direction, image)
            active &= curvature > 0
            length = np.where(active, energy / np.where(active, curvature, 1.0), 0.0)[components]
            solution += length * direction
            residual -= length * image
            value = precondition(residual)
            following = dot(residual, value)
            direction = value + np.where(active, following / np.where(active, energy, 1.0), 0.0)[components] * direction
            energy = np.where(active, following, 0.0)
            done += 1
            report(_worst(energy, scale))
        residual = right_side - matrix @ solution
        before, reached = reached, _worst(dot(residual, precondition(residual)), scale)
    return solution, Convergence(iterations=done, residual=reached)


def _worst(energy: FloatArray, start: FloatArray) -> float:
    """Return the largest relative residual; components that had nothing to solve count as 0."""
    ratio = np.where(start > 0, energy / np.where(start > 0, start, 1.0), 0.0)
    return float(np.sqrt(max(ratio.max(initial=0.0), 0.0)))
