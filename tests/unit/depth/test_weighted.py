"""The shared solve: weights of any span, priors, starts, components, threads."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from psstereo.depth.edges import EdgeSteps
from psstereo.depth.grid import COMPILED
from psstereo.depth.laplacian import edge_laplacian
from psstereo.depth.weighted import solve_weighted


def problem(size, *, seed=0, decades=0.0, share=1.0, crack=None):
    """Return random steps on a random mask; no surface has them."""
    rng = np.random.default_rng(seed)
    inside = rng.random(size) < share
    parts = {}
    for name, a, b in (("right", inside[:, :-1], inside[:, 1:]), ("down", inside[:-1], inside[1:])):
        edges = a & b
        parts[name] = np.where(edges, rng.normal(size=edges.shape), 0.0)
        parts[f"{name}_weight"] = np.where(edges, 10.0 ** rng.uniform(-decades, 0, edges.shape), 0.0)
    if crack is not None:
        rows, columns = np.indices(size)
        piece = (rows - size[0] / 2) ** 2 + (columns - size[1] / 2) ** 2 < (0.3 * min(size)) ** 2
        parts["right_weight"] *= np.where(piece[:, :-1] != piece[:, 1:], crack, 1.0)
        parts["down_weight"] *= np.where(piece[:-1] != piece[1:], crack, 1.0)
    return EdgeSteps(**parts, left_out=0), inside


def direct(steps, inside, components, prior=None, prior_weight=None):
    matrix, right_side = edge_laplacian(steps, inside)
    labels = components[inside]
    if prior is None:  # one pixel of each component pinned
        pins = np.zeros(labels.size)
        pins[np.unique(labels, return_index=True)[1]] = 1.0
    else:
        pins = prior_weight[inside]
        right_side = right_side + pins * prior[inside]
    return splu((matrix + sp.diags_array(pins)).tocsc()).solve(right_side)


def centred(values, labels):
    return values - (np.bincount(labels, values) / np.maximum(np.bincount(labels), 1))[labels]


@pytest.mark.parametrize("size", [(1, 1), (1, 30), (23, 1), (40, 51)])
@pytest.mark.parametrize("share", [0.6, 1.0])
def test_equals_a_direct_solve(size, share):
    steps, inside = problem(size, share=share, decades=2.0)
    inside[0, 0] = True
    found = solve_weighted(steps, inside)
    assert found.converged
    labels = found.components[inside]
    expected = centred(direct(steps, inside, found.components), labels)
    np.testing.assert_allclose(centred(found.values[inside], labels), expected, rtol=0, atol=1e-7)
    assert (found.values[~inside] == 0).all()


@pytest.mark.parametrize("solves", [1, COMPILED])
@pytest.mark.parametrize("crack", [1e-3, 1e-8, 1e-12])
def test_a_piece_held_by_weak_edges_only(crack, solves):
    """What the weak edges want is fulfilled although they weigh next to nothing."""
    steps, inside = problem((64, 60), crack=crack)
    rows, columns = np.indices(inside.shape)
    surface = np.sin(rows / 7) * columns + 100.0 * (columns > 30)
    exact = EdgeSteps(
        right=np.diff(surface, axis=1),
        down=np.diff(surface, axis=0),
        right_weight=steps.right_weight,
        down_weight=steps.down_weight,
        left_out=0,
    )
    found = solve_weighted(exact, inside, tolerance=1e-12, solves=solves)
    assert found.residual <= 1e-12
    error = centred((found.values - surface).ravel(), np.zeros(inside.size, int))
    # Rounding of the stiff edges pulls as well: at 1e-12 it moves the piece by some ten-thousandths of the jump.
    assert np.abs(error).max() < (1e-3 if crack > 1e-12 else 3e-2)


def test_weights_that_jump_over_twelve_decades_from_pixel_to_pixel():
    steps, inside = problem((90, 80), decades=12.0)
    found = solve_weighted(steps, inside)
    assert found.converged
    assert found.path == "algebraic multigrid"
    assert found.iterations < 300
    matrix, right_side = edge_laplacian(steps, inside)
    assert np.abs(right_side - matrix @ found.values[inside]).max() < 1e-8


@pytest.mark.parametrize("kind", ["one pixel", "sparse", "dense", "stiff"])
def test_a_prior_equals_a_direct_solve(kind):
    steps, inside = problem((45, 52), share=0.95, seed=3, decades=1.0)
    rng = np.random.default_rng(4)
    weight = {
        "one pixel": np.where(np.arange(inside.size).reshape(inside.shape) == np.flatnonzero(inside)[900], 0.5, 0.0),
        "sparse": np.where(rng.random(inside.shape) < 0.01, 3.0, 0.0),
        "dense": np.full(inside.shape, 1e-4),
        "stiff": np.full(inside.shape, 1e4),
    }[kind] * inside
    prior = np.where(weight > 0, rng.normal(size=inside.shape), np.nan)
    found = solve_weighted(steps, inside, prior=prior, prior_weight=weight)
    assert found.converged
    tied = np.bincount(found.components.ravel(), weight.ravel()) > 0
    used = inside & tied[found.components]
    part = EdgeSteps(
        right=steps.right,
        down=steps.down,
        right_weight=steps.right_weight * (used[:, 1:] & used[:, :-1]),
        down_weight=steps.down_weight * (used[1:] & used[:-1]),
        left_out=0,
    )
    expected = direct(part, used, found.components, np.where(weight > 0, prior, 0.0), weight)
    np.testing.assert_allclose(found.values[used], expected, rtol=0, atol=1e-7)


def test_a_start_near_the_answer_saves_iterations():
    steps, inside = problem((70, 75), share=0.9)
    cold = solve_weighted(steps, inside)
    warm = solve_weighted(steps, inside, start=cold.values + 7.0)
    assert warm.iterations <= 1
    near = np.random.default_rng(0).normal(size=inside.shape) * 1e-6
    warm = solve_weighted(steps, inside, start=cold.values + near)
    assert warm.converged
    assert 0 < warm.iterations < 0.8 * cold.iterations


def test_an_island_is_solved_as_well_as_a_continent_a_million_times_as_steep():
    steps, inside = problem((60, 60))
    gap = np.ones((60, 60), bool)
    gap[:, 20] = False
    scale = np.where(np.arange(60) < 20, 1e-6, 1.0)
    split = EdgeSteps(
        right=steps.right * scale[:-1],
        down=steps.down * scale,
        right_weight=steps.right_weight * (gap[:, 1:] & gap[:, :-1]),
        down_weight=steps.down_weight * (gap[1:] & gap[:-1]),
        left_out=0,
    )
    found = solve_weighted(split, inside & gap)
    labels = found.components[gap]
    expected = centred(direct(split, inside & gap, found.components), labels)
    error = np.abs(centred(found.values[gap], labels) - expected)
    for label in (1, 2):
        assert error[labels == label].max() < 1e-8 * np.abs(expected[labels == label]).max()


def test_the_limit_is_kept_and_told():
    steps, inside = problem((50, 50))
    seen = []
    found = solve_weighted(steps, inside, max_iterations=3, report=seen.append)
    assert found.iterations == 3 == len(seen)
    assert not found.converged
    assert 1e-10 < found.residual < 1.0


def test_iterations_do_not_grow_with_size():
    """The condition grows with the square of the side; the iterations must not."""
    counts = []
    for side in (40, 80, 160, 320):
        rows, columns = np.indices((side, side))
        disc = (rows - side / 2) ** 2 + (columns - side / 2) ** 2 < (0.45 * side) ** 2
        steps, _ = problem((side, side))
        part = EdgeSteps(
            right=steps.right,
            down=steps.down,
            right_weight=1.0 * (disc[:, 1:] & disc[:, :-1]),
            down_weight=1.0 * (disc[1:] & disc[:-1]),
            left_out=0,
        )
        found = solve_weighted(part, disc)
        assert found.converged
        counts.append(found.iterations)
    assert max(counts) <= 10


def test_the_compiled_path_and_its_threads():
    steps, inside = problem((331, 317), share=0.98, decades=1.0)
    assert inside.size > COMPILED
    found = [solve_weighted(steps, inside, threads=threads) for threads in (1, 2, 3)]
    assert found[0].converged
    assert len({one.values.tobytes() for one in found}) == 1
    matrix, right_side = edge_laplacian(steps, inside)
    assert np.abs(right_side - matrix @ found[0].values[inside]).max() < 1e-8
