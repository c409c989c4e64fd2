from itertools import pairwise

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from psstereo.camera import Orthographic
from psstereo.depth.domain import make_domain
from psstereo.depth.edges import edge_steps
from psstereo.depth.laplacian import edge_laplacian
from psstereo.depth.multigrid import make_hierarchy, v_cycle


@pytest.fixture
def problem():
    rng = np.random.default_rng(4)
    mask = rng.random((40, 37)) < 0.65
    normals = np.broadcast_to([0.0, 0.0, 1.0], (40, 37, 3))
    domain = make_domain(normals, Orthographic(), mask, 10.0 ** rng.uniform(-3, 0, mask.shape))
    matrix, _ = edge_laplacian(edge_steps(domain, slant_exponent=0.0), domain.inside)
    components = connected_components(matrix, directed=False)[1]
    levels = make_hierarchy(matrix, np.argwhere(domain.inside).astype(np.int32), components)
    return matrix, components, levels


def test_rows_of_every_level_sum_to_zero_and_levels_shrink(problem):
    _, _, levels = problem
    assert len(levels) > 2
    for level in levels:
        scale = abs(level.matrix).max()
        assert np.abs(level.matrix.sum(axis=1)).max() < 1e-12 * scale
        assert abs(level.matrix - level.matrix.T).max() < 1e-12 * scale
    sizes = [level.matrix.shape[0] for level in levels]
    assert all(coarse <= fine / 2 for fine, coarse in pairwise(sizes))


def test_the_cycle_is_symmetric_and_positive(problem):
    _, components, levels = problem
    rng = np.random.default_rng(0)

    def residual():
        values = rng.normal(size=components.size)
        return values - (np.bincount(components, values) / np.bincount(components))[components]

    for _ in range(5):
        a, b = residual(), residual()
        assert a @ v_cycle(levels, b) == pytest.approx(b @ v_cycle(levels, a), rel=1e-9, abs=1e-6)
        assert a @ v_cycle(levels, a) > 0


def test_the_cycle_keeps_components_apart(problem):
    _, components, levels = problem
    largest = np.bincount(components).argmax()
    residual = np.where(components == largest, np.random.default_rng(1).normal(size=components.size), 0.0)
    residual[components == largest] -= residual[components == largest].mean()
    assert (v_cycle(levels, residual)[components != largest] == 0).all()
