from itertools import pairwise

import numpy as np
import pytest

from psstereo.kernels import shading_step as reference
from psstereo.kernels import shading_step_compiled as compiled

SHAPE = (11, 14)


class Problem:
    """A random surface over a ragged mask, under light of every term, seen through a slightly central projection."""

    def __init__(self, seed, *, kappa=0.8, area=0.3):
        rng = np.random.default_rng(seed)
        self.inside = rng.random(SHAPE) < 0.85
        self.inside[3:8, 3:9] = True
        self.east, self.south = np.zeros(SHAPE, bool), np.zeros(SHAPE, bool)
        self.east[:, :-1] = self.inside[:, 1:] & self.inside[:, :-1]
        self.south[:-1] = self.inside[1:] & self.inside[:-1]
        self.free = self.inside & (rng.random(SHAPE) < 0.9)
        self.target, self.weight = rng.uniform(0, 1, SHAPE), rng.uniform(0.2, 1, SHAPE) * self.inside
        self.dark = rng.random(SHAPE) < 0.2
        self.frame = np.zeros((3, 3, 3))
        self.frame[:, 0] = [[-1, 0, 0], [0, 1, 0], [0, 0, 1]]
        self.frame[:2, 1:] = rng.normal(0, 0.01, (2, 2, 3))
        self.light = np.concatenate([[0.1], rng.normal(0, 0.5, 3), rng.normal(0, 0.1, 6)])
        self.prior, self.prior_weight = rng.normal(0, 1, SHAPE), rng.uniform(0, 0.1, SHAPE) * self.inside
        self.options = (0.05, kappa, area)
        self.s = rng.normal(0, 0.7, SHAPE) * self.inside
        self.diagonal = rng.uniform(0.01, 0.1, SHAPE) * self.inside
        self.v = rng.normal(0, 1, SHAPE) * self.free

    def linearise(self, kernels, s, parts=(0, SHAPE[0])):
        pull, sums = np.zeros((2, *SHAPE)), np.zeros((SHAPE[0], 3))
        along, down, stiff, tension = (np.zeros(SHAPE) for _ in range(4))
        look = (s, self.east, self.south, self.target, self.weight, self.dark, self.frame, self.light, *self.options)
        for first, last in pairwise(parts):
            kernels.linearise(*look, pull, along, down, stiff, tension, sums, first, last)
        return pull, along, down, stiff, tension, sums

    def gradient(self, kernels, s, parts=(0, SHAPE[0])):
        pull, _, _, stiff, tension, _ = self.linearise(kernels, s)
        out, sums = np.zeros(SHAPE), np.zeros(SHAPE[0])
        edges = (s, self.east, self.south, self.free, pull, stiff, tension, self.prior, self.prior_weight)
        for first, last in pairwise(parts):
            kernels.gradient(*edges, out, sums, first, last)
        return out, sums

    def energy(self, s):
        return self.linearise(reference, s)[-1].sum() + self.gradient(reference, s)[1].sum()

    def multiply(self, kernels, v, parts=(0, SHAPE[0])):
        _, *operator, _ = self.linearise(kernels, self.s)
        direction = np.zeros((SHAPE[0] + 3, SHAPE[1] + 3), np.float32)
        direction[1:-2, 1:-2] = v
        out, sums = np.zeros(SHAPE), np.zeros(SHAPE[0])
        operator = [part.astype(np.float32) for part in operator] if kernels is compiled else operator
        for first, last in pairwise(parts):
            kernels.multiply(
                self.east, self.south, self.free, *operator, self.diagonal, direction, out, sums, first, last
            )
        return out, sums


def test_gradient_is_that_of_differences():
    problem = Problem(1)
    out, _ = problem.gradient(reference, problem.s)
    rng = np.random.default_rng(2)
    for _ in range(5):
        along = rng.normal(size=SHAPE) * problem.free
        h = 1e-6
        change = (problem.energy(problem.s + h * along) - problem.energy(problem.s - h * along)) / (2 * h)
        assert -2.0 * (out * along).sum() == pytest.approx(change, rel=1e-6)


def test_operator_is_the_curvature_of_a_problem_that_is_quadratic():
    # Without brightness, lag and area the energy is quadratic: its second difference is the operator's.
    problem = Problem(3, kappa=0.0, area=0.0)
    problem.weight[:] = 0.0
    problem.diagonal = problem.prior_weight
    _, sums = problem.multiply(reference, problem.v)
    v = np.float32(problem.v).astype(float)
    second = problem.energy(problem.s + v) - 2.0 * problem.energy(problem.s) + problem.energy(problem.s - v)
    assert 2.0 * sums.sum() == pytest.approx(second, rel=1e-9)


def test_operator_is_symmetric_and_not_negative():
    problem, rng = Problem(4), np.random.default_rng(5)
    u = np.float32(rng.normal(size=SHAPE) * problem.free).astype(float)
    v = np.float32(problem.v).astype(float)
    image_u, energy = problem.multiply(reference, u)
    image_v, _ = problem.multiply(reference, v)
    assert (image_u * v).sum() == pytest.approx((image_v * u).sum(), rel=1e-12)
    assert energy.sum() > 0


def test_gauss_newton_is_the_square_of_the_brightness_slope():
    problem = Problem(6, area=0.0)
    problem.options = (0.0, 1.0, 0.0)
    problem.dark[:] = False
    problem.diagonal[:] = 0.0
    _, sums = problem.multiply(reference, problem.v)
    v, h = np.float32(problem.v).astype(float), 1e-6

    def misfit(s):
        # The root of each pixel's energy, from the energies of one pixel at a time.
        out = np.zeros(SHAPE)
        weight = problem.weight
        for where in np.argwhere(weight > 0):
            problem.weight = np.zeros(SHAPE)
            problem.weight[tuple(where)] = weight[tuple(where)]
            out[tuple(where)] = problem.linearise(reference, s)[-1][where[0], 0]
        problem.weight = weight
        return np.sqrt(out)

    change = (misfit(problem.s + h * v) - misfit(problem.s - h * v)) / (2 * h)
    assert sums.sum() == pytest.approx((change**2).sum(), rel=1e-5)


@pytest.mark.parametrize("kappa", [0.0, 0.5, 1.0])
def test_compiled_twin_agrees_whatever_the_rows(kappa):
    problem = Problem(7, kappa=kappa)
    for parts in ((0, SHAPE[0]), (0, 1, 4, 6, SHAPE[0])):
        for ours, theirs in zip(
            problem.linearise(reference, problem.s), problem.linearise(compiled, problem.s, parts), strict=True
        ):
            np.testing.assert_allclose(theirs, ours, rtol=1e-12, atol=1e-13)
        for ours, theirs in zip(
            problem.gradient(reference, problem.s), problem.gradient(compiled, problem.s, parts), strict=True
        ):
            np.testing.assert_allclose(theirs, ours, rtol=1e-11, atol=1e-12)
        for ours, theirs in zip(
            problem.multiply(reference, problem.v), problem.multiply(compiled, problem.v, parts), strict=True
        ):
            np.testing.assert_allclose(theirs, ours, rtol=0, atol=3e-6 * np.abs(ours).max())


def test_light_of_a_turned_away_surface_is_below_zero():
    light = np.array([0, 0, 0, 1.0, 0, 0, 0, 0, 0, 0])
    assert reference.shade(np.array([0.0, 3.0, -4.0]), light) == pytest.approx(-0.8)
