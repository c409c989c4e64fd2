"""What a trial says of a solver, and which pixels it is tried on."""

from dataclasses import replace

import numpy as np
import pytest

from psstereo.lights import Rig
from psstereo.metrics import angular_error
from psstereo.normals import LeastSquares, Robust, Samples
from psstereo.normals.exemplar import Exemplar
from psstereo.normals.response_bend import ResponseBend
from psstereo.plan import contestants
from psstereo.plan.contestants import CONTESTANTS
from psstereo.plan.costs import COSTS
from psstereo.plan.evidence import evidence, trouble
from psstereo.plan.sample import Sample, sample_pixels
from psstereo.plan.trials import attempt, folds, judged
from psstereo.stack import MemoryStack
from psstereo_synth import ring, spiral

SIDE = 40


def surface(count=24, *, noise=0.0, tilt=np.pi / 3):
    """Return a rig, normals in rows and what a matte surface shows under it, (m, SIDE²)."""
    rig = Rig.distant(spiral(count, max_tilt=tilt))
    y, x = np.mgrid[:SIDE, :SIDE] / SIDE - 0.5
    normals = np.stack([0.8 * x, -0.6 * y, np.ones_like(x)], axis=-1).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    values = np.maximum(rig.directions @ normals.T, 0.0)
    return rig, normals, values + noise * np.random.default_rng(1).standard_normal(values.shape)


def sampled(rig, values):
    where = sample_pixels(np.ones((SIDE, SIDE), np.bool_))
    flat = where.pixels[:, 0] * SIDE + where.pixels[:, 1]
    stack = MemoryStack(np.zeros((len(rig), SIDE, SIDE), np.uint16))
    return Sample.fitted(values[:, flat], where, stack, rig), flat


def test_highlights_make_least_squares_doubtful_and_leave_the_robust_solver_alone():
    rig, normals, values = surface(noise=1e-4)
    half = rig.directions + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half, axis=1)[:, None]
    values = values + 2.0 * np.maximum(half @ normals.T, 0.0) ** 200
    few = np.ascontiguousarray(values[:, ::13])
    found = [attempt(solver, rig, few) for solver in (LeastSquares(), Robust())]
    plain, robust = judged(found, rig, few)
    assert plain.change_deg > 1.0
    assert plain.apart_deg > 5.0
    assert robust.doubt_deg < 0.02 * plain.doubt_deg


def test_noise_moves_a_normal_by_the_difference_of_both_covariances():
    rig, normals, values = surface(noise=0.002, tilt=0.5)
    few = np.ascontiguousarray(values[:, ::2])
    (trial,) = judged([attempt(LeastSquares(), rig, few)], rig, few)
    whole = np.linalg.inv(rig.directions.T @ rig.directions)
    square = []
    for pixel, normal in enumerate(normals[::2]):
        lights = rig.directions[folds(rig)[pixel % 8]]
        across = np.eye(3) - np.outer(normal, normal)
        square.append(np.trace(across @ (np.linalg.inv(lights.T @ lights) - whole) @ across))
    assert len(folds(rig)) == 8
    # The mean size of a Gaussian vector is √(2/π) of its root mean square on a line, √(π/4) where both axes are alike.
    rms = float(np.degrees(0.002 * np.sqrt(square).mean()))
    assert 0.97 * np.sqrt(2 / np.pi) < trial.change_deg / rms < 1.02 * np.sqrt(np.pi / 4)
    assert 0 < trial.error_deg < 0.1 * trial.change_deg
    assert trial.apart_deg == 0


def test_weights_say_for_how_many_pixels_each_stands():
    rig, _, values = surface(noise=0.01)
    found = attempt(LeastSquares(), rig, np.ascontiguousarray(values[:, ::9]))
    once = judged([found], rig, values[:, ::9])[0]
    half = judged([found], rig, values[:, ::9], np.full(values[:, ::9].shape[1], 0.5))[0]
    assert half.change_deg == pytest.approx(0.5 * once.change_deg, rel=1e-12)


def test_pixels_in_trouble_are_drawn_more_often_and_stand_for_fewer():
    rig, _, values = surface()
    rows, columns = np.divmod(np.arange(SIDE * SIDE), SIDE)
    odd = (rows < 8) & (columns < 8)
    values[:6, odd] = 0.0  # a cast shadow over a twenty-fifth of the pixels
    sample, flat = sampled(rig, values)
    left = trouble(sample)
    assert left[odd[flat]].min() > 10 * left[~odd[flat]].max()
    few, weights = contestants._few(sample)
    shaded = (few[:6] == 0).all(axis=0)
    assert few.shape[1] == len(weights) == contestants._TRIED
    assert shaded.mean() == pytest.approx(0.5 + 0.5 * odd.mean(), abs=0.02)
    assert np.sum(weights[shaded]) / np.sum(weights) == pytest.approx(odd.mean(), abs=0.01)
    assert weights.mean() == pytest.approx(1.0, abs=0.05)


def test_a_perfect_sample_is_drawn_evenly():
    rig, _, values = surface()
    sample, _ = sampled(rig, np.round(values))  # no residual at all is hard to make; even trouble is enough
    few, weights = contestants._few(sample)
    assert 0.5 < weights.min() <= weights.max() <= 2.0
    assert few.shape == (24, len(weights))


def test_a_solver_that_does_not_settle_is_no_choice():
    rig, normals, values = surface()
    half = rig.directions + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half, axis=1)[:, None]
    sharp, broad = (
        np.ascontiguousarray((values + np.maximum(half @ normals.T, 0.0) ** power)[:, ::31]) for power in (200, 30)
    )
    assert attempt(ResponseBend(), rig, sharp) is not None
    assert attempt(ResponseBend(), rig, broad) is None  # a curve of brightness alone cannot follow it


def test_the_contestants_come_from_quick_to_slow():
    cost = [COSTS[kind.name].compiled for kind in CONTESTANTS if kind.name != "ambient"]
    assert sorted(cost) == cost
    assert Exemplar in CONTESTANTS
    assert len({kind.name for kind in CONTESTANTS}) == len(CONTESTANTS)


def test_a_solver_that_learns_is_tried_as_it_will_solve():
    rig, normals, values = surface()
    half = rig.directions + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half, axis=1)[:, None]
    few = np.ascontiguousarray((values + 0.5 * np.maximum(half @ normals.T, 0.0) ** 20)[:, ::13])
    taught, _ = Exemplar().taught(rig, Samples(few))
    assert taught.materials
    expected = taught.solve(taught.prepare(rig), Samples(few)).scaled
    found = attempt(Exemplar(), rig, few)
    np.testing.assert_allclose(found.scaled, expected, rtol=1e-9)
    alone = attempt(Exemplar(shared=0), rig, few)
    assert np.degrees(angular_error(alone.scaled, expected)).max() > 0.1


def test_normals_are_compared_with_those_of_the_last():
    rig, _, values = surface(noise=1e-3)
    few = np.ascontiguousarray(values[:, ::20])
    first = attempt(LeastSquares(), rig, few)
    turned = np.array([[np.cos(0.02), -np.sin(0.02), 0.0], [np.sin(0.02), np.cos(0.02), 0.0], [0.0, 0.0, 1.0]])
    last = replace(first, solver="turned", scaled=first.scaled @ turned.T)
    one, two = judged([first, last], rig, few)
    assert two.beside_deg is None
    assert one.beside_deg == pytest.approx(np.degrees(angular_error(first.scaled, last.scaled)).mean(), rel=1e-12)
    odd = last.scaled.copy()
    odd[1:] = first.scaled[1:]
    (rare, _) = judged([first, replace(last, scaled=odd)], rig, few)
    assert rare.beside_deg > 0.001  # a single pixel counts


def lit_sample(level, shine=0.0):
    """Return what is needed for trials on matte or shiny samples with a level of light from all around."""
    rig, normals, values = surface(noise=1e-3)
    half = rig.directions + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half, axis=1)[:, None]
    sample, _ = sampled(rig, values + level + shine * np.maximum(half @ normals.T, 0.0) ** 40)
    return sample, rig


def test_a_level_that_leaves_noise_alone_needs_no_rival():
    sample, rig = lit_sample(0.05)
    trials, level = contestants.run_trials(sample, rig, evidence(sample), SIDE * SIDE, None)
    assert [one.solver for one in trials] == ["ambient"]
    assert level[0] == pytest.approx(0.05, rel=0.05)


def test_lights_that_tell_no_level_leave_the_others():
    _, normals, _ = surface()
    rig = Rig.distant(ring(24, tilt=0.7))
    sample, _ = sampled(rig, np.maximum(rig.directions @ normals.T, 0.0) ** 1.5)
    said = evidence(sample)
    assert said.misfit > 0.1
    trials, level = contestants.run_trials(sample, rig, said, SIDE * SIDE, None)
    assert {"least-squares", "robust"} <= {one.solver for one in trials}
    assert "ambient" not in {one.solver for one in trials}
    assert level == (None, None)


def test_a_level_beside_highlights_has_rivals():
    sample, rig = lit_sample(0.05, shine=0.5)
    trials, _ = contestants.run_trials(sample, rig, evidence(sample), SIDE * SIDE, None)
    assert [one.solver for one in trials][-1] == "exemplar"
    assert len(trials) > 3
    assert trials[-1].beside_deg is None
    assert all(one.beside_deg > 0 for one in trials[:-1])
