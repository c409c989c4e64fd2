"""What every normal solver does not depend on: order, brightness, turns, what is left out, how pixels are split."""

import pickle
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.capture import Capture
from psstereo.flags import Flag
from psstereo.lights import Rig
from psstereo.normals import GATES, NORMAL_SOLVERS, Samples, estimate_normals
from psstereo.stack import MemoryStack
from psstereo_synth import spiral
from tests.contract.normal_trials import (
    EXACT,
    SIZE,
    angle,
    arrange,
    assert_explained,
    flexible,
    frames,
    hilly,
    random_normals,
    trial,
    with_images,
)


@pytest.fixture(scope="module", params=sorted(NORMAL_SOLVERS))
def method(request):
    return NORMAL_SOLVERS[request.param]


def test_outside_the_mask_there_is_nothing(method):
    capture = trial(method, 12)
    result = estimate_normals(capture, method())
    outside = ~capture.mask
    assert outside.any()
    for image in (result.normals, result.albedo, result.uncertainty):
        assert np.isnan(image[outside]).all()
    assert (result.flags[outside] == Flag.OUTSIDE_MASK).all()
    assert not (result.flags[~outside] & Flag.OUTSIDE_MASK).any()
    assert_explained(result)


def test_what_lies_outside_the_mask_does_not_matter(method):
    capture = trial(method, 12, noise=0.01)
    images = frames(capture).copy()
    images[:, ~capture.mask] = np.random.default_rng(1).uniform(-5, 5, images[:, ~capture.mask].shape)
    first = estimate_normals(capture, method())
    second = estimate_normals(with_images(capture, images), method())
    assert first.normals.tobytes() == second.normals.tobytes()


@cache
def settled(method):
    """Return a capture and what the method finds in it, for all tests that change the one and look at the other."""
    capture = trial(method, 12, max_tilt=1.2, noise=0.01, steepness=1.5)
    capture = with_images(capture, frames(capture))  # without absolute radiances: albedos follow the images
    return capture, estimate_normals(capture, method())


def test_the_order_of_lights_is_irrelevant(method):
    capture, first = settled(method)
    order = np.random.default_rng(2).permutation(len(capture.rig))
    swapped = with_images(capture, frames(capture)[order], rig=capture.rig.select(order))
    second = estimate_normals(swapped, method())
    # Exemplars look so alike that amounts, and by them the last round, hang on the order in which sums are taken.
    rounding, relative = (1e-7, 1e-5) if method().learns_from else (1e-11, 1e-9)
    np.testing.assert_allclose(second.normals, first.normals, rtol=0, atol=rounding)
    np.testing.assert_allclose(second.uncertainty, first.uncertainty, rtol=relative)
    np.testing.assert_array_equal(second.flags, first.flags)


@pytest.mark.parametrize("factor", [2.0**-40, 2.0**30])
def test_brightness_scales_the_albedo_only(method, factor):
    capture, first = settled(method)
    second = estimate_normals(with_images(capture, frames(capture) * factor), method())
    assert second.normals.tobytes() == first.normals.tobytes()  # powers of two are exact
    assert second.uncertainty.tobytes() == first.uncertainty.tobytes()
    np.testing.assert_array_equal(second.albedo, first.albedo * factor)


def test_a_quarter_turn_of_the_picture_turns_the_normals(method):
    capture, first = settled(method)
    images = np.rot90(frames(capture), axes=(1, 2)).copy()
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rig = Rig.distant(capture.rig.directions @ quarter.T, capture.rig.strengths(1))
    second = estimate_normals(with_images(capture, images, rig=rig, mask=np.rot90(capture.mask).copy()), method())
    # What is learnt of an object is a sum over pixels, in another order here.
    rounding = 1e-9 if method().learns_from else 1e-11
    np.testing.assert_allclose(second.normals, np.rot90(first.normals) @ quarter.T, rtol=0, atol=rounding)


@settings(max_examples=10)
@given(seed=st.integers(0, 2**32 - 1), turn=st.floats(-np.pi, np.pi), tip=st.floats(-0.5, 0.5))
def test_turning_rig_and_surface_turns_the_normals(method, seed, turn, tip):
    rng = np.random.default_rng(seed)
    tip = 0.0 if method.sees_the_eye else tip
    c, s, ct, st_ = np.cos(turn), np.sin(turn), np.cos(tip), np.sin(tip)
    rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, ct, -st_], [0, st_, ct]])
    directions, normals = arrange(method, spiral, 8), random_normals(rng, 30, tilt=30.0)
    noisy = np.maximum(directions @ normals.T + rng.normal(0, 0.01, (len(directions), 30)), 0.05)
    if flexible(method):
        noisy **= 1.4
    first, second = (
        estimate_normals(Capture(stack=MemoryStack(noisy[:, None]), rig=Rig.distant(turned)), method())
        for turned in (directions, directions @ rotation.T)
    )
    # Reflectance that depends on the eye is fitted by steps, which end where one is shorter than 1e-5. If each is half
    # of the one before or less, as here, what is left is no longer than the last, in either of the two answers.
    ends, rounding = (2e-5, 1e-9) if method.sees_the_eye else (1e-11, 1e-14)
    np.testing.assert_allclose(second.normals, first.normals @ rotation.T, rtol=0, atol=ends)
    relative = 1e-3 if method.sees_the_eye else 1e-8
    np.testing.assert_allclose(second.uncertainty, first.uncertainty, rtol=relative, atol=rounding)


def test_any_split_of_the_pixels_gives_the_same_numbers(method):
    capture = trial(method, 12, max_tilt=1.2, noise=0.01, steepness=2.0)
    values = frames(capture)[..., 0][:, capture.mask]
    solver = method()
    state = solver.prepare(capture.rig)
    whole = solver.solve(state, Samples(values))
    for cut in (1, 7, 300):
        parts = [solver.solve(state, Samples(part)) for part in (values[:, :cut], values[:, cut:])]
        split = np.concatenate([p.scaled for p in parts])
        rounding = 1e-9 if method().learns_from else 1e-12  # blocks are of a fixed size; these here are not
        np.testing.assert_allclose(split, whole.scaled, rtol=0, atol=rounding)
        np.testing.assert_array_equal(np.concatenate([p.flags for p in parts]), whole.flags)


def test_solving_leaves_its_input_alone(method):
    capture = trial(method, 12, max_tilt=1.2, noise=0.01)
    values = frames(capture)[..., 0][:, capture.mask].copy()
    values[2, 5] = np.nan
    weights = np.ones_like(values)
    for array in (values, weights):
        array.setflags(write=False)
    solver = method()
    solver.solve(solver.prepare(capture.rig), Samples(values, weights))


def test_solver_and_state_pickle(method):
    capture = trial(method, 12, noise=0.01)
    solver = method(gate=GATES["shadow"])
    state = solver.prepare(capture.rig)
    samples = Samples(frames(capture)[..., 0][:, capture.mask])
    expected = solver.solve(state, samples)
    assert pickle.loads(pickle.dumps(solver)) == solver
    again = pickle.loads(pickle.dumps(solver)).solve(pickle.loads(pickle.dumps(state)), samples)
    assert again.scaled.tobytes() == expected.scaled.tobytes()
    result = estimate_normals(capture, solver)
    assert pickle.loads(pickle.dumps(result)).normals.tobytes() == result.normals.tobytes()


def test_a_weight_of_zero_leaves_an_observation_out(method):
    directions = arrange(method, spiral, 12, max_tilt=0.5)
    capture, truth = hilly(directions, steepness=0.6)
    images, weights = frames(capture).copy(), np.full((len(directions), SIZE, SIZE), 2.0)
    bad = np.random.default_rng(5).random(weights.shape) < 0.3
    images[bad] = 7.0
    weights[bad] = 0.0
    weights[:, 15, 15] = 0.0
    result = estimate_normals(with_images(capture, images), method(), weights=weights)
    enough = capture.mask & ((~bad).sum(axis=0) >= method.unknowns)
    enough[15, 15] = False
    assert angle(result.normals, truth.normals)[enough].max() < EXACT
    assert result.flags[15, 15] & Flag.TOO_FEW_LIGHTS
    assert not result.flags[15, 15] & Flag.NO_SIGNAL  # nobody looked
    assert_explained(result)


def test_equal_weights_are_no_weights(method):
    capture, plain = settled(method)
    weighted = estimate_normals(capture, method(), weights=np.full((len(capture.rig), SIZE, SIZE), 0.125))
    np.testing.assert_allclose(weighted.normals, plain.normals, rtol=0, atol=1e-11)
    np.testing.assert_array_equal(weighted.flags, plain.flags)


def test_progress_rises_to_the_end(method):
    seen = {}
    capture = trial(method, 12, many=24)
    estimate_normals(
        capture, method(), progress=lambda stage, done, total: seen.setdefault(stage, []).append(done / total)
    )
    assert list(seen) == ["reading images", "solving pixels"]
    for steps in seen.values():
        assert steps == sorted(steps)
        assert steps[-1] == 1.0
