"""Least squares with weights over many decades: what holds firmly is solved first, then how the parts lie.

Where edges have given way, parts of the surface hang together by next to nothing. Solved in one go, such weights cost
many iterations, since a multigrid in single precision does not see them, and they bend what they should only place.
So edges far weaker than the firmest of their component are left out of the large solve; the parts that this leaves are
rigid, and the weak edges, few in number, place them to each other by a small system of one unknown a part. The result
differs from that of solving all at once by about the ratio of weak to firm.
"""

from dataclasses import dataclass, replace

import numpy as np

from psstereo.depth.edges import EdgeSteps, components_of
from psstereo.depth.weighted import Weighted, solve_weighted
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Task", "solve_apart"]

_LOOSE = 1e-4
"""Weight in terms of its component's largest below which an edge only places parts [1]."""
_LEAST = 1e-9
"""Smallest share of its weight that an edge keeps: what keeps a part within reach [1]."""
_MANY = 20_000
"""Parts beyond which placing them is no small system any more, and all is solved at once."""

Two = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """What is solved again and again with other weights.

    Attributes
    ----------
    inside : bool array (h, w)
        Pixels of the domain.
    plain : EdgeSteps
        Steps and weights before anything gives way.
    components : int array (h, w)
        What the edges hold together, from 1; 0 outside.
    prior : float64 array (h, w) or None
        Values wanted [unit of the steps].
    prior_weight : float64 array (h, w) or None
        Their weights on the scale of the edges'; 0 where there is none [1].
    max_iterations : int
        Iterations of a solve at most.
    threads : int
        Threads at most.
    solves : int
        Solves that are to come.
    """

    inside: BoolArray
    plain: EdgeSteps
    components: IntArray
    prior: FloatArray | None
    prior_weight: FloatArray | None
    max_iterations: int
    threads: int
    solves: int


def solve_apart(task: Task, factor: Two, *, start: FloatArray | None, tolerance: float) -> Weighted:
    """Minimise Σ f w (s_b − s_a − c)² + Σ λ (s − t)².

    Parameters
    ----------
    task : Task
        Edges and prior.
    factor : float64 arrays (h, w − 1) and (h − 1, w)
        Share f of its weight that each edge has kept [1].
    start : float64 array (h, w), optional
        Values to start from [unit of the steps].
    tolerance : float
        Relative residual wanted for every part [1].

    Returns
    -------
    Weighted
        Values and how they were found; its components are the parts.
    """
    labels = task.components[:, 1:], task.components[1:]
    weights = task.plain.right_weight, task.plain.down_weight
    products = [weight * part for weight, part in zip(weights, factor, strict=True)]
    largest = np.zeros(int(task.components.max(initial=0)) + 1)
    if largest.size == 2:
        largest[1] = max(float(product.max(initial=0.0)) for product in products)
    else:
        for product, label in zip(products, labels, strict=True):
            np.maximum.at(largest, label.ravel(), product.ravel())
    # Among edges that all gave way, those that weighed more before still do.
    kept = [np.maximum(product, _LEAST * weight) for weight, product in zip(weights, products, strict=True)]
    firm = [np.where(part < _LOOSE * largest[label], 0.0, part) for part, label in zip(kept, labels, strict=True)]
    steps = replace(task.plain, right_weight=firm[0], down_weight=firm[1])
    whole = all(np.array_equal(a, b) for a, b in zip(firm, kept, strict=True))
    parts = task.components if whole else components_of(steps, task.inside)
    if int(parts.max(initial=0)) - largest.size > _MANY:
        kept = [
            np.where(part > 0, np.maximum(part, _LEAST * largest[label]), 0.0)
            for part, label in zip(kept, labels, strict=True)
        ]
        steps, parts = replace(task.plain, right_weight=kept[0], down_weight=kept[1]), task.components
    found = solve_weighted(
        steps,
        task.inside,
        prior=task.prior,
        prior_weight=task.prior_weight,
        start=start,
        components=parts,
        tolerance=tolerance,
        max_iterations=task.max_iterations,
        threads=task.threads,
        solves=task.solves,
    )
    if int(parts.max(initial=0)) == int(task.components.max(initial=0)):
        return found
    shift = _placed(task, (kept[0], kept[1]), parts, found.values)
    return replace(found, values=found.values + shift[parts])


def _placed(task: Task, kept: Two, parts: IntArray, values: FloatArray) -> FloatArray:
    """Return by how much each part is to be moved; entry 0 for outside."""
    from scipy.sparse import coo_array, diags_array
    from scipy.sparse.linalg import spsolve

    count = int(parts.max()) + 1
    first, second, weight, gap = [], [], [], []
    for a, b, part, step in (
        (np.s_[:, :-1], np.s_[:, 1:], kept[0], task.plain.right),
        (np.s_[:-1], np.s_[1:], kept[1], task.plain.down),
    ):
        apart = (part > 0) & (parts[a] != parts[b])
        first.append(parts[a][apart])
        second.append(parts[b][apart])
        weight.append(part[apart])
        gap.append((step - (values[b] - values[a]))[apart])
    one, two, w, g = (np.concatenate(pair) for pair in (first, second, weight, gap))
    diagonal = np.bincount(one, w, count) + np.bincount(two, w, count)
    side = np.bincount(two, w * g, count) - np.bincount(one, w * g, count)
    if task.prior_weight is not None:
        diagonal += np.bincount(parts.ravel(), task.prior_weight.ravel(), count)
    # One part of each component stays where it is unless the prior moves it: all moves may have a constant in common.
    component = np.zeros(count, np.intp)
    component[parts.ravel()] = task.components.ravel()
    free = np.ones(count, np.bool_)
    if task.prior_weight is None:
        free[np.unique(component, return_index=True)[1]] = False
    free &= diagonal > 0
    matrix = (diags_array(diagonal) - coo_array((w, (one, two)), shape=(count, count))).tocsr()
    matrix = (matrix - coo_array((w, (two, one)), shape=(count, count)).tocsr())[free][:, free]
    shift = np.zeros(count)
    if free.any():
        shift[free] = spsolve(matrix.tocsc(), side[free])
    return shift
