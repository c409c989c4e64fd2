"""Least absolute deviations: against linear programming, and with normals that are wrong here and there."""

import numpy as np
import pytest

from psstereo.camera import Orthographic
from psstereo.depth import Poisson
from psstereo.depth.domain import make_domain
from psstereo.depth.edges import edge_steps
from psstereo.depth.prior import Prior
from psstereo.depth.robust import LeastAbsolute
from psstereo.errors import OptionError


def bumps(shape):
    rows, columns = np.indices(shape) / 9.0
    height = 6 * np.sin(rows) * np.cos(1.3 * columns)
    along_x = -6 * 1.3 / 9 * np.sin(rows) * np.sin(1.3 * columns)
    along_y = -6 / 9 * np.cos(rows) * np.cos(1.3 * columns)  # y runs up
    return np.dstack([-along_x, -along_y, np.ones(shape)]), height


def wrong_here_and_there(normals, share=0.03, seed=5):
    rng = np.random.default_rng(seed)
    bad = rng.random(normals.shape[:2]) < share
    strange = rng.normal(size=normals.shape)
    strange[..., 2] = np.abs(strange[..., 2]) + 0.3
    return np.where(bad[..., None], strange, normals)


def test_the_sum_is_the_least_that_linear_programming_finds():
    from scipy.optimize import linprog
    from scipy.sparse import block_array, coo_array, eye_array

    shape = (9, 10)
    normals = wrong_here_and_there(bumps(shape)[0], 0.1)
    steps = edge_steps(make_domain(normals, Orthographic(), None, None))
    index = np.arange(90).reshape(shape)
    start = np.concatenate([index[:, :-1].ravel(), index[:-1].ravel()])
    stop = np.concatenate([index[:, 1:].ravel(), index[1:].ravel()])
    weight = np.sqrt(np.concatenate([steps.right_weight.ravel(), steps.down_weight.ravel()]))
    wanted = weight * np.concatenate([steps.right.ravel(), steps.down.ravel()])
    edges = np.arange(start.size)
    entries = np.concatenate([weight, -weight]), (np.concatenate([edges, edges]), np.concatenate([stop, start]))
    matrix = coo_array(entries, shape=(start.size, 90))
    one = eye_array(start.size)
    best = linprog(
        np.concatenate([np.zeros(90), np.ones(start.size)]),
        A_ub=block_array([[matrix, -one], [-matrix, -one]]).tocsr(),
        b_ub=np.concatenate([wanted, -wanted]),
        bounds=[(None, None)] * 90 + [(0, None)] * start.size,
    ).fun
    found = LeastAbsolute(softening=1e-4, rounds=40).integrate(normals, Orthographic())
    total = np.abs(matrix @ found.depth.ravel() - wanted).sum()
    assert total == pytest.approx(best, rel=1e-3)
    assert found.facts["mean_deviation_px"] == pytest.approx(total / start.size, rel=1e-9)
    plain = Poisson().integrate(normals, Orthographic())
    assert total < 0.95 * np.abs(matrix @ plain.depth.ravel() - wanted).sum()


def test_wrong_normals_here_and_there_leave_little_trace():
    normals, truth = bumps((70, 80))
    spoiled = wrong_here_and_there(normals)
    error = [np.std(m.integrate(spoiled, Orthographic()).depth - truth) for m in (LeastAbsolute(), Poisson(turn=None))]
    assert error[1] > 0.1
    assert error[0] < 0.2 * error[1]


def test_nothing_is_lost_where_all_normals_are_right():
    normals, truth = bumps((70, 80))
    error = [np.std(m.integrate(normals, Orthographic()).depth - truth) for m in (LeastAbsolute(), Poisson())]
    assert error[0] < 1.5 * error[1] + 1e-6


def test_even_noise_costs_about_a_quarter():
    normals, truth = bumps((50, 60))
    rng = np.random.default_rng(2)
    ratios = []
    for _ in range(2):
        noisy = normals + rng.normal(0, 0.05, normals.shape)
        error = [np.std(m.integrate(noisy, Orthographic()).depth - truth) for m in (LeastAbsolute(), Poisson())]
        ratios.append(error[0] / error[1])
    assert 0.9 < np.mean(ratios) < 1.45


def test_without_rounds_it_is_plain_integration():
    normals, _ = bumps((20, 22))
    one = LeastAbsolute(rounds=0).integrate(normals, Orthographic())
    two = Poisson(turn=None).integrate(normals, Orthographic())
    np.testing.assert_allclose(one.depth, two.depth, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    "options", [{"softening": 0.0}, {"softening": np.nan}, {"rounds": -1}, {"slant_exponent": -1.0}, {"tolerance": 1.0}]
)
def test_options_that_mean_nothing_are_refused(options):
    with pytest.raises(OptionError) as caught:
        LeastAbsolute(**options)
    assert caught.value.remedy


def test_wrong_points_of_a_prior_leave_little_trace():
    normals, truth = bumps((40, 44))
    tilted = normals + np.array([0.02, 0.0, 0.0])
    rng = np.random.default_rng(3)
    known = np.where(rng.random(truth.shape) < 0.2, 50.0 + truth + rng.normal(0, 0.3, truth.shape), np.nan)
    known[rng.random(truth.shape) < 0.02] = 90.0
    prior = Prior(depth=known, sigma=0.3, unit="px", angle=0.02)
    error = [
        np.sqrt(np.mean((m.integrate(tilted, Orthographic(), prior=prior).depth - 50.0 - truth) ** 2))
        for m in (LeastAbsolute(), Poisson())
    ]
    assert error[0] < 0.25
    assert error[1] > 10 * error[0]
