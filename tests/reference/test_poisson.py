"""Plain integration against independent answers: a direct sparse solve, a naive loop, closed surfaces."""

import os
import subprocess
import sys

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.linalg import splu

from psstereo.camera import Orthographic, Pinhole
from psstereo.depth import Poisson
from psstereo.results import DepthKind, Outcome

ORTHOGRAPHIC = Orthographic(pixel_size=0.5)
PINHOLE = Pinhole(fx=200.0, fy=190.0, cx=14.0, cy=11.0)


def naive_equations(normals, camera, mask, *, weights, exponent, turn):
    """Return edges (a, b, step, weight) one pair at a time, written from the definition."""
    normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    rays, places = camera.rays(mask.shape), camera.points(np.zeros(mask.shape))
    index = np.cumsum(mask).reshape(mask.shape) - 1
    edges = []
    for v, u in np.argwhere(mask):
        for b in ((v, u + 1), (v + 1, u)):
            if b[0] >= mask.shape[0] or b[1] >= mask.shape[1] or not mask[b]:
                continue
            a = (v, u)
            n = (normals[a] + normals[b]) / np.linalg.norm(normals[a] + normals[b])
            if camera.depth_kind is DepthKind.HEIGHT:
                step = -(n[:2] @ (places[b] - places[a])[:2]) / n[2]
                cosine = n[2]
            else:
                step = np.log((n @ rays[a]) / (n @ rays[b]))
                cosine = min(-n @ rays[at] / np.linalg.norm(rays[at]) for at in (a, b))
            weight = cosine**exponent
            if turn is not None:
                weight /= (1.0 + np.sum((normals[a] - normals[b]) ** 2) / turn**2) ** 2
            if weights is not None:
                weight *= 2.0 / (1.0 / weights[a] + 1.0 / weights[b])
            edges.append((index[a], index[b], step, weight))
    return edges


def direct_solution(edges, count, components):
    """Solve the normal equations by factorisation, one pixel of each component pinned; component means are zero."""
    if not edges:
        return np.zeros(count)
    a, b, step, weight = (np.array(column) for column in zip(*edges, strict=True))
    rows = np.arange(a.size)
    gradient = sp.coo_array(
        (np.r_[-np.ones(a.size), np.ones(a.size)], (np.r_[rows, rows], np.r_[a, b])), (a.size, count)
    )
    gradient = gradient.tocsr()
    pins = np.zeros(count)
    pins[np.unique(components, return_index=True)[1]] = weight.mean()
    system = gradient.T @ sp.diags_array(weight) @ gradient + sp.diags_array(pins)
    values = splu(system.tocsc()).solve(gradient.T @ (weight * step))
    return values - (np.bincount(components, values) / np.maximum(np.bincount(components), 1))[components]


@settings(max_examples=40, deadline=None)
@given(
    shape=st.tuples(st.integers(1, 26), st.integers(1, 26)),
    seed=st.integers(0, 2**32),
    share=st.floats(0.1, 1.0),
    decades=st.integers(0, 4),
    form=st.tuples(
        st.sampled_from([ORTHOGRAPHIC, PINHOLE]), st.sampled_from([0.0, 2.0]), st.sampled_from([None, 0.14])
    ),
)
def test_equals_a_direct_solve_of_the_normal_equations(shape, seed, share, decades, form):
    camera, exponent, turn = form
    rng = np.random.default_rng(seed)
    mask = rng.random(shape) < share
    mask[0, 0] = True
    normals = rng.normal(size=(*shape, 3))
    normals[..., 2] = np.abs(normals[..., 2]) + 0.3
    weights = 10.0 ** rng.uniform(-decades, 0, shape) if decades else None
    result = Poisson(slant_exponent=exponent, turn=turn).integrate(normals, camera, mask=mask, weights=weights)
    mask &= np.isfinite(result.depth)
    edges = naive_equations(normals, camera, mask, weights=weights, exponent=exponent, turn=turn)
    assert len(edges) == result.facts["edges"]
    expected = direct_solution(edges, int(mask.sum()), result.components[mask])
    found = np.log(result.depth[mask]) if camera is PINHOLE else result.depth[mask]
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-8 * max(np.abs(expected).max(), 1e-3))


def test_the_cosine_transform_equals_the_multigrid():
    rng = np.random.default_rng(5)
    normals = rng.normal(size=(33, 47, 3)) * [0.3, 0.3, 0.0] + [0, 0, 1.0]
    mask = np.ones((33, 47), bool)
    by_transform = Poisson(slant_exponent=0.0, turn=None).integrate(normals, ORTHOGRAPHIC, mask=mask)
    assert by_transform.facts["path"] == "cosine transform"
    assert by_transform.iterations == 0
    assert by_transform.residual < 1e-13
    # The same equations with one pixel more, joined by a single edge, which costs nothing to fulfil.
    more = np.pad(normals, ((0, 1), (0, 0), (0, 0)), constant_values=1.0)
    mask = np.pad(mask, ((0, 1), (0, 0)))
    mask[33, 5] = True
    by_multigrid = Poisson(slant_exponent=0.0, turn=None).integrate(more, ORTHOGRAPHIC, mask=mask)
    assert by_multigrid.facts["path"] == "grid multigrid"
    inner = by_multigrid.depth[:33] - by_multigrid.depth[:33].mean()
    np.testing.assert_allclose(inner, by_transform.depth, rtol=0, atol=1e-9)


def hills(size):
    """Height, normals and mask of a smooth surface over the unit square, sampled at ``size`` pixels a side."""
    camera = Orthographic(pixel_size=1.0 / size)
    x, y = np.moveaxis(camera.points(np.zeros((size, size)))[..., :2], -1, 0)
    height = 0.1 * np.sin(5 * x) * np.cos(4 * y) + 0.2 * x * y
    dx = 0.5 * np.cos(5 * x) * np.cos(4 * y) + 0.2 * y
    dy = -0.4 * np.sin(5 * x) * np.sin(4 * y) + 0.2 * x
    mask = (x - 0.5) ** 2 + (y + 0.5) ** 2 < 0.2
    return camera, height, np.dstack([-dx, -dy, np.ones_like(dx)]), mask


def test_the_error_on_a_smooth_surface_falls_with_the_square_of_the_pixel():
    errors = []
    for size in (40, 80, 160):
        camera, height, normals, mask = hills(size)
        difference = (Poisson().integrate(normals, camera, mask=mask).depth - height)[mask]
        errors.append(float(np.std(difference)))
    assert errors[-1] < 1e-5
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 1.8).all()


def test_half_a_million_pixels_of_a_disc_stay_accurate_to_a_thousandth_of_a_pixel():
    size = 700
    camera, height, normals, mask = hills(size)
    result = Poisson().integrate(normals, camera, mask=mask)
    assert result.outcome is Outcome.SOLVED
    assert result.iterations < 40
    assert np.std((result.depth - height)[mask]) * size < 1e-3


@pytest.mark.parametrize("case", ["bridges", "spiral", "porous", "weak lines", "wild weights"])
def test_awkward_domains_converge(case):
    rng = np.random.default_rng(2)
    size = 161
    mask, weights = np.ones((size, size), bool), None
    if case == "bridges":
        mask[::20] = mask[:, ::20] = False
        mask[::20, 10::20] = mask[10::20, ::20] = True
    elif case == "spiral":
        mask[:] = False
        for k in range(0, size // 2, 2):
            mask[k : size - k, k : size - k] = True
            mask[k + 1 : size - k - 1, k + 1 : size - k - 1] = False
            mask[k + 1, k] = False
            mask[k + 2, k + 1] = True
    elif case == "porous":
        mask = rng.random(mask.shape) < 0.6
    elif case == "weak lines":
        weights = np.ones(mask.shape)
        weights[:, 50] = 1e-8
        weights[90] = 1e-6
    else:
        weights = 10.0 ** rng.uniform(-6, 0, mask.shape)
    normals = np.dstack([rng.normal(size=mask.shape), rng.normal(size=mask.shape), np.full(mask.shape, 1.0)])
    result = Poisson().integrate(normals, ORTHOGRAPHIC, mask=mask, weights=weights)
    assert result.outcome is Outcome.SOLVED
    assert result.residual <= 1e-10
    assert result.iterations < 200
    plane = np.broadcast_to([-0.3, 0.2, 1.0], (*mask.shape, 3))
    depth = Poisson().integrate(plane, ORTHOGRAPHIC, mask=mask, weights=weights).depth
    x, y = np.moveaxis(ORTHOGRAPHIC.points(np.zeros(mask.shape))[..., :2], -1, 0)
    components = result.components[mask]
    error = (depth - (0.3 * x - 0.2 * y))[mask]
    error -= (np.bincount(components, error) / np.maximum(np.bincount(components), 1))[components]
    assert np.abs(error).max() < 1e-5


def test_an_iteration_that_stops_early_says_so_with_the_true_residual():
    camera, _, normals, mask = hills(80)
    result = Poisson(max_iterations=2).integrate(normals, camera, mask=mask)
    assert result.outcome is Outcome.NOT_CONVERGED
    assert result.iterations == 2
    assert 1e-10 < result.residual < 1.0
    assert np.isfinite(result.depth[mask]).all()


@pytest.mark.slow
def test_the_number_of_threads_changes_no_byte():
    script = (
        "import hashlib, numpy as np\n"
        "from psstereo.camera import Orthographic\n"
        "from psstereo.depth import Poisson\n"
        "rng = np.random.default_rng(0)\n"
        "n = rng.normal(size=(203, 157, 3)) * [.5, .5, 0] + [0, 0, 1.]\n"
        "for exponent in (0., 2.):\n"
        "    d = [Poisson(threads=t, slant_exponent=exponent).integrate(n, Orthographic()).depth for t in (1, 2, 3)]\n"
        "    print(*(hashlib.sha256(x.tobytes()).hexdigest() for x in d))\n"
    )
    outputs = set()
    for threads in ("1", "2"):
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": threads, "OMP_NUM_THREADS": threads}
        run = subprocess.run(
            [sys.executable, "-c", script], capture_output=True, text=True, env=environment, check=True
        )
        outputs.add(run.stdout)
        for line in run.stdout.splitlines():
            assert len(set(line.split())) == 1
    assert len(outputs) == 1
