"""Nearly calibrated lights: exact where images tell, left alone where they do not, refused where they cannot."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError, RigError, UnsupportedError
from psstereo.lights import Led, Rig
from psstereo.metrics import summarise_angles
from psstereo.normals import LeastSquares, estimate_normals
from psstereo.normals.refine_lights import RefineOptions, refine_lights
from psstereo.results import Outcome
from psstereo.stack import MemoryStack
from psstereo_synth import checker, hills, lambertian_capture, ring, spiral
from psstereo_synth.hills import normals_of_slopes
from psstereo_synth.surface import Surface

DIRECTIONS = spiral(16)


def scene(size=64, directions=DIRECTIONS, strengths=None, **how):
    return lambertian_capture(
        hills(size, size, steepness=1.5), checker((size, size)), directions, strengths, **{"bits": None, **how}
    )


def doubtful(capture, degrees, seed=0, factor=1.0):
    """Return a capture whose lights are off by random angles, and their strengths by random factors up to one."""
    rng = np.random.default_rng(seed)
    true = capture.rig.directions
    off = true + np.radians(degrees) * rng.normal(size=true.shape)
    factors = np.exp(np.log(factor) * rng.uniform(-1, 1, len(true)))
    return replace(capture, rig=Rig.distant(off, capture.rig.strengths(1)[:, 0] * factors))


def angle(one, other):
    cross = np.cross(one, other)
    return np.degrees(np.arctan2(np.linalg.norm(cross, axis=1), (one * other).sum(axis=1)))


def normals_error(capture, truth):
    return summarise_angles(estimate_normals(capture, LeastSquares()).normals, truth.normals, capture.mask).mean_deg


@pytest.mark.parametrize("seed", range(3))
def test_random_errors_of_single_lights_are_found_exactly(seed):
    """What is left is what all lights share, and strengths and the surface tell that too."""
    capture, truth = scene()
    wrong = doubtful(capture, 3.0, seed)
    found = refine_lights(wrong, RefineOptions(strength_doubt=0.0))
    before, after = angle(wrong.rig.directions, DIRECTIONS), angle(found.rig.directions, DIRECTIONS)
    assert found.changed
    assert after.mean() < 0.3 * before.mean()
    assert normals_error(found.capture, truth) < 0.5 * normals_error(wrong, truth)
    np.testing.assert_allclose(np.degrees(found.moved), angle(found.rig.directions, wrong.rig.directions), atol=1e-9)
    np.testing.assert_array_equal(found.rig.strengths(1), wrong.rig.strengths(1))
    assert found.health.spread_after < 0.2 * found.health.spread_before
    assert found.outcome is Outcome.SOLVED


def test_one_wrong_light_among_good_ones_moves_alone():
    capture, _ = scene()
    directions = DIRECTIONS.copy()
    directions[5] += [0.3, -0.2, 0.0]
    found = refine_lights(replace(capture, rig=Rig.distant(directions)))
    assert np.degrees(found.moved[5]) > 8
    assert angle(found.rig.directions, DIRECTIONS).max() < 1.0
    assert np.degrees(np.delete(found.moved, 5)).max() < 1.0
    assert "(light 6)" in found.step.reason


def test_strengths_are_refined_if_wanted():
    capture, truth = scene()
    wrong = doubtful(capture, 2.0, factor=1.3)
    found = refine_lights(wrong, RefineOptions(strengths=True, strength_doubt=0.2))
    ratio = found.rig.strengths(1)[:, 0] / capture.rig.strengths(1)[:, 0]
    nominal = wrong.rig.strengths(1)[:, 0] / capture.rig.strengths(1)[:, 0]
    assert np.log(ratio).std() < 0.2 * np.log(nominal).std()
    np.testing.assert_allclose(ratio / ratio.mean(), found.factors * nominal / (found.factors * nominal).mean())
    assert normals_error(found.capture, truth) < 0.5 * normals_error(wrong, truth)


def test_unknown_strengths_are_found_with_the_directions():
    strengths = np.geomspace(0.3, 3.0, 16)
    capture, truth = scene(strengths=strengths)
    wrong = replace(doubtful(capture, 1.0), rig=Rig.distant(doubtful(capture, 1.0).rig.directions))
    found = refine_lights(wrong, RefineOptions(strengths=True, strength_doubt=np.inf))
    np.testing.assert_allclose(found.rig.strengths(1)[:, 0], strengths / strengths.mean(), rtol=0.05)
    assert normals_error(found.capture, truth) < 1.0


def test_lights_that_agree_are_left_as_they_are():
    capture, _ = scene(noise=0.002)
    found = refine_lights(capture)
    assert not found.changed
    assert not found.step.done
    assert "they stay" in found.step.reason
    assert found.capture is capture
    np.testing.assert_array_equal(found.moved, 0)


def test_the_less_the_nominal_lights_are_doubted_the_less_they_move():
    capture, _ = scene(noise=0.003)
    wrong = doubtful(capture, 3.0)
    moved = [refine_lights(wrong, RefineOptions(doubt=np.radians(d))).moved.mean() for d in (0.1, 1.0, 5.0)]
    assert moved[0] < 0.5 * moved[1] < 0.5 * moved[2] * 1.01


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_flat_object_is_refused(noise):
    y, x = np.indices((40, 40)) - 20.0
    flat = Surface(height=0.2 * x, normals=normals_of_slopes(0 * x + 0.2, 0 * y), mask=np.ones((40, 40), bool))
    capture, _ = lambertian_capture(flat, np.full((40, 40), 0.5), spiral(16, max_tilt=0.7), bits=None, noise=noise)
    with pytest.raises(InputError, match=r"hree dimensions.*flat"):
        refine_lights(capture)


def test_too_few_or_coplanar_or_near_lights_are_refused():
    capture, _ = scene(directions=ring(4))
    with pytest.raises(InputError, match="4 lights"):
        refine_lights(capture)
    capture, _ = scene()
    coplanar = DIRECTIONS * [1, 0, 1]
    with pytest.raises(RigError, match="one plane"):
        refine_lights(replace(capture, rig=Rig.distant(coplanar)))
    lamp = Led(position=np.array([0.0, 0.0, 100.0]), axis=np.array([0.0, 0.0, -1.0]), mu=1.0, flux=np.ones(1))
    with pytest.raises(UnsupportedError, match="not a distant light"):
        refine_lights(replace(capture, rig=Rig((lamp,) * 16)))


@pytest.mark.parametrize(
    "options", [{"doubt": 0.0}, {"doubt": np.nan}, {"strength_doubt": -1.0}, {"gray": "per-channel"}]
)
def test_options_are_checked(options):
    with pytest.raises(OptionError, match="doubt in directions"):
        RefineOptions(**options)


def test_the_answer_is_the_same_on_any_threads():
    capture, _ = scene(noise=0.003)
    wrong = doubtful(capture, 3.0)
    found = refine_lights(wrong)
    with ThreadPoolExecutor(3) as pool:
        threaded = refine_lights(wrong, over=pool.map)
    assert threaded.rig.directions.tobytes() == found.rig.directions.tobytes()
    assert threaded.health == found.health


def test_order_of_the_lights_does_not_matter():
    capture, _ = scene()
    wrong = doubtful(capture, 3.0)
    order = np.random.default_rng(6).permutation(16)
    turned = Capture(stack=MemoryStack(wrong.stack.read()[order]), rig=wrong.rig.select(order), mask=wrong.mask)
    np.testing.assert_allclose(
        refine_lights(turned).rig.directions, refine_lights(wrong).rig.directions[order], atol=1e-3
    )
