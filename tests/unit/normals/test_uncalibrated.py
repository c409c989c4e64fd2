"""Lights from the images alone: exact where maxima are known, refusals where nothing can be told, one answer always."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from psstereo.camera import Pinhole
from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError
from psstereo.lights import Rig
from psstereo.metrics import summarise_angles
from psstereo.normals import LeastSquares, estimate_normals
from psstereo.normals.albedo_criteria import albedo_of
from psstereo.normals.bas_relief import BasRelief
from psstereo.normals.bas_relief_search import by_entropy, by_maxima, by_strengths
from psstereo.normals.diffuse_maxima import Maxima, find_maxima
from psstereo.normals.light_colour import light_colours
from psstereo.normals.uncalibrated import UncalibratedOptions, find_lights
from psstereo.results import Outcome
from psstereo.stack import MemoryStack
from psstereo_synth import checker, hills, lambertian_capture, ring, spiral
from psstereo_synth.hills import normals_of_slopes
from psstereo_synth.surface import Surface

DIRECTIONS = spiral(14, max_tilt=0.7)
STRENGTHS = np.linspace(0.5, 1.5, 14)


def relief_of(height, slopes, mask=None):
    full = np.ones(height.shape, bool) if mask is None else mask
    return Surface(height=height, normals=normals_of_slopes(*slopes), mask=full)


def grid(size=72):
    rows, columns = np.indices((size, size), dtype=float)
    return columns - (size - 1) / 2, (size - 1) / 2 - rows


def cap(size=72, sign=1.0):
    """Return a part of a ball, whose maxima of brightness are known: one under each light."""
    x, y = grid(size)
    radius = 0.65 * size
    inside = x * x + y * y < (0.48 * size) ** 2
    z = np.sqrt(radius**2 - np.where(inside, x * x + y * y, 0.0))
    return relief_of(sign * z, (-sign * x / z, -sign * y / z), inside)


def photograph(surface, albedo=0.6, directions=DIRECTIONS, strengths=STRENGTHS, **how):
    paint = np.full(surface.mask.shape, albedo) if np.isscalar(albedo) else albedo
    return lambertian_capture(surface, paint, directions, strengths, **{"bits": None, **how})


def angle(one, other):
    cross = np.cross(one, other)
    return np.degrees(np.arctan2(np.linalg.norm(cross, axis=1), (one * other).sum(axis=1)))


def normals_error(found, truth):
    normals = estimate_normals(found.capture, LeastSquares()).normals
    return summarise_angles(normals, truth.normals, found.capture.mask).mean_deg


def forget(capture):
    """Return a capture whose rig says nothing."""
    blank = Rig.distant(np.tile([0.0, 0.0, 1.0], (len(capture.rig), 1)))
    return replace(capture, rig=blank)


@pytest.mark.parametrize("ambiguity", ["maxima", "entropy"])
def test_a_ball_gives_lights_and_normals_exactly(ambiguity):
    capture, truth = photograph(cap())
    found = find_lights(forget(capture), UncalibratedOptions(ambiguity=ambiguity))
    limit = {"maxima": 0.1, "entropy": 1.0}[ambiguity]
    assert angle(found.rig.directions, DIRECTIONS).max() < limit
    assert normals_error(found, truth) < limit
    np.testing.assert_allclose(found.rig.strengths(1)[:, 0], STRENGTHS / STRENGTHS.mean(), rtol=0.02)
    assert found.outcome is Outcome.SOLVED
    assert found.health.outwardness > 0.9
    assert found.health.relief_ratio > 1e3
    assert found.capture.stack is capture.stack


@pytest.mark.parametrize(("paint", "seed"), [("plain", 0), ("checker", 0), ("checker", 1), ("checker", 2)])
def test_hills_are_found_within_a_degree(paint, seed):
    surface = hills(128, 128, steepness=1.5, seed=seed)
    albedo = 0.6 if paint == "plain" else checker((128, 128))
    strengths = np.exp(np.random.default_rng(seed).uniform(-1, 1, 24))
    directions = spiral(24)
    capture, truth = photograph(surface, albedo, directions, strengths, bits=16)
    found = find_lights(forget(capture))
    other = replace(found, capture=replace(capture, rig=found.alternative))
    # hills have no middle from which normals lean outward: either choice may be the true one
    best = min((found, other), key=lambda one: angle(one.rig.directions, directions).mean())
    assert angle(best.rig.directions, directions).mean() < 1.0
    assert normals_error(best, truth) < 1.0


def test_relief_chooses_between_a_hill_and_a_hollow():
    capture, truth = photograph(cap(sign=-1.0))
    convex, concave = (find_lights(capture, UncalibratedOptions(relief=name)) for name in ("convex", "concave"))
    assert normals_error(concave, truth) < 0.1
    assert normals_error(convex, truth) > 30
    np.testing.assert_allclose(convex.rig.directions, concave.alternative.directions, atol=1e-12)
    np.testing.assert_allclose(convex.rig.directions, concave.rig.directions * [-1, -1, 1], atol=1e-12)
    assert concave.health.outwardness < -0.9
    assert "concave was chosen" in concave.step.reason


def test_both_choices_show_the_same_images():
    capture, _ = photograph(cap(), noise=0.001)
    found = find_lights(capture)
    one = estimate_normals(found.capture, LeastSquares())
    two = estimate_normals(replace(capture, rig=found.alternative), LeastSquares())
    np.testing.assert_allclose(one.normals * [-1, -1, 1], two.normals, atol=1e-9)
    np.testing.assert_allclose(one.uncertainty, two.uncertainty, atol=1e-9)


def test_given_strengths_resolve_where_the_albedo_does_not():
    """Blotches everywhere: no maximum is where the surface faces its light, and no colour is common."""
    rng = np.random.default_rng(0)
    blotches = 0.2 + 0.6 * rng.random((72, 72))
    capture, truth = photograph(cap(), blotches)
    found = find_lights(capture, UncalibratedOptions(ambiguity="strengths"))
    assert normals_error(found, truth) < 0.1
    np.testing.assert_allclose(found.rig.strengths(1)[:, 0], STRENGTHS)
    assert "strengths of 14 lights are met" in found.step.reason


def test_a_ring_of_lights_of_given_strength_is_refused():
    capture, _ = photograph(cap(), directions=ring(12), strengths=np.ones(12))
    with pytest.raises(InputError, match="depth of the relief uncertain"):
        find_lights(capture, UncalibratedOptions(ambiguity="strengths"))


def test_noise_is_borne():
    capture, truth = photograph(cap(), noise=0.005, directions=spiral(24, max_tilt=0.7), strengths=np.ones(24))
    assert normals_error(find_lights(capture), truth) < 2.0


def test_colours_of_lights_are_found():
    surface, rng = cap(), np.random.default_rng(1)
    paint = 0.3 + 0.3 * np.stack([surface.mask * (np.arange(72) % 9 > k) for k in (2, 4, 6)], axis=-1)
    colours = STRENGTHS[:, None] * np.exp(0.3 * rng.normal(size=(14, 3)))
    capture, truth = photograph(surface, paint, strengths=colours)
    found = find_lights(forget(capture))
    assert normals_error(found, truth) < 1.0
    ratio = found.rig.strengths(3) / colours
    np.testing.assert_allclose(ratio / ratio.mean(axis=0), 1.0, atol=0.05)


def test_light_colours_are_exact_whatever_is_painted_and_shaded():
    rng = np.random.default_rng(2)
    colours = np.exp(rng.normal(size=(7, 3)))
    values = colours.T[:, :, None] * rng.random((3, 1, 500)) * np.maximum(rng.normal(size=(7, 500)) + 1, 0)
    values[1, 3, 5] = np.nan
    found = light_colours(values)
    expected = np.log(colours) - np.log(colours).mean(axis=1, keepdims=True)
    np.testing.assert_allclose(np.log(found), expected - expected.mean(axis=0), atol=1e-9)
    np.testing.assert_array_equal(light_colours(values[:1]), np.ones((7, 1)))


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("shape", ["plane", "cylinder", "roof"])
def test_a_flat_or_singly_bent_object_is_refused(shape, noise):
    x, y = grid(48)
    round_ = np.sqrt(60.0**2 - x * x)
    surface = {
        "plane": relief_of(0.2 * x - 0.1 * y, (0 * x + 0.2, 0 * x - 0.1)),
        "cylinder": relief_of(round_, (-x / round_, 0 * x)),
        "roof": relief_of(-0.5 * abs(x), (-0.5 * np.sign(x), 0 * x)),
    }[shape]
    capture, _ = photograph(surface, noise=noise)
    with pytest.raises(InputError, match=r"hree dimensions.*flat"):
        find_lights(capture)


@pytest.mark.parametrize("second", [1.0, -1.0])
def test_a_surface_of_second_degree_is_refused(second):
    x, y = grid(48)
    capture, _ = photograph(relief_of((x * x + second * y * y) / 100, (x / 50, second * y / 50)))
    with pytest.raises(InputError, match="second degree"):
        find_lights(capture)


def test_pixels_of_no_surface_are_refused():
    surface = cap()
    order = np.random.default_rng(3).permutation(surface.mask.sum())
    normals = surface.normals.copy()
    normals[surface.mask] = surface.normals[surface.mask][order]
    capture, _ = photograph(replace(surface, normals=normals))
    with pytest.raises(InputError, match=r"pixels have a normal|those of a surface"):
        find_lights(capture)


def test_three_images_are_refused():
    capture, _ = photograph(cap(), directions=ring(3), strengths=np.ones(3))
    with pytest.raises(InputError, match=r"3 images.*At least 4"):
        find_lights(capture)


def test_options_are_checked():
    with pytest.raises(OptionError, match="Did you mean maxima"):
        UncalibratedOptions(ambiguity="maxim")
    with pytest.raises(OptionError, match="Did you mean convex"):
        UncalibratedOptions(relief="convx")
    with pytest.raises(OptionError, match="each channel on its own"):
        UncalibratedOptions(gray="per-channel")


def test_the_answer_is_the_same_on_any_threads_and_for_any_brightness():
    capture, _ = photograph(hills(64, 64, steepness=1.5), checker((64, 64)), noise=0.002)
    found = find_lights(capture)
    with ThreadPoolExecutor(3) as pool:
        threaded = find_lights(capture, over=pool.map)
    assert threaded.rig.directions.tobytes() == found.rig.directions.tobytes()
    assert threaded.rig.strengths(1).tobytes() == found.rig.strengths(1).tobytes()
    half = replace(capture, stack=MemoryStack(capture.stack.read() / 2))
    assert find_lights(half).rig.directions.tobytes() == found.rig.directions.tobytes()


def test_order_of_the_images_does_not_matter():
    capture, _ = photograph(cap())
    order = np.random.default_rng(4).permutation(14)
    turned = Capture(stack=MemoryStack(capture.stack.read()[order]), rig=capture.rig.select(order), mask=capture.mask)
    np.testing.assert_allclose(
        find_lights(turned).rig.directions, find_lights(capture).rig.directions[order], atol=1e-3
    )


def test_a_pinhole_is_said_to_be_taken_for_parallel():
    capture, _ = photograph(cap())
    pinhole = replace(capture, camera=Pinhole(fx=2000.0, fy=2000.0, cx=35.5, cy=35.5))
    assert "taken for parallel" in find_lights(pinhole).step.reason
    assert "taken for parallel" not in find_lights(capture).step.reason


def synthetic_maxima(relief, count=30, wrong=0):
    """Return maxima of a surface that a known transformation has changed, some of them wrong."""
    rng = np.random.default_rng(5)
    lights = rng.normal(size=(count, 3)) * 0.4 + [0, 0, 1]
    normals = lights.copy()
    normals[:wrong] = rng.normal(size=(wrong, 3)) * 0.4 + [0, 0, 1]
    b, lamps = relief.normals(normals.T), relief.lights(lights).T
    return Maxima(b / np.linalg.norm(b, axis=0), lamps / np.linalg.norm(lamps, axis=0))


@pytest.mark.parametrize("wrong", [0, 12])
def test_maxima_give_a_known_transformation_back(wrong):
    relief = BasRelief(mu=0.3, nu=-0.5, depth=1.7)
    maxima = synthetic_maxima(relief, wrong=wrong)
    back = np.linalg.inv(relief.matrix)
    expected = np.array([back[2, 0], back[2, 1], np.log(back[2, 2])])
    tried = maxima.candidates()
    best = tried[np.argmax(maxima.votes(tried))]
    np.testing.assert_allclose(best, expected, atol=1e-6)
    assert np.count_nonzero(maxima.angles(expected) < 1e-6) >= 30 - wrong
    assert maxima.votes(expected[None])[0] == pytest.approx(1 - wrong / 30, abs=0.12)


def test_a_maximum_is_found_between_pixels():
    x, y = grid(21)
    top = np.array([0.3, -0.4])
    normals = np.stack([-(x - top[0]) / 40, -(y - top[1]) / 40, np.ones_like(x)])
    normals /= np.linalg.norm(normals, axis=0)
    found = find_maxima(normals.reshape(3, -1), np.array([[0, 0, 1.0]]), np.zeros(441), np.ones((21, 21), bool))
    np.testing.assert_allclose(found.normals[:, 0], [0, 0, 1], atol=1e-3)
    assert len(found) == 1


def plain_ball(depth):
    surface = cap()
    normals = surface.normals[surface.mask].T
    relief = BasRelief(mu=0.2, nu=-0.1, depth=depth)
    return relief, albedo_of(relief.normals(normals), np.ones(normals.shape[1]), surface.mask)


def test_entropy_and_variation_are_least_for_the_true_surface():
    relief, albedo = plain_ball(1.4)
    back = np.linalg.inv(relief.matrix)
    truth = np.array([back[2, 0], back[2, 1], np.log(back[2, 2])])
    others = truth + np.array([[0.3, 0, 0], [0, -0.3, 0], [0, 0, 0.3], [0, 0, -0.3]])
    assert albedo.variation(truth[None])[0] < 1e-12
    assert (albedo.variation(others) > 1e-3).all()
    assert (albedo.entropy(others) > albedo.entropy(truth[None])[0] + 0.3).all()
    found = by_entropy(albedo).relief
    assert found.mu == pytest.approx(truth[0], abs=0.1)
    assert found.nu == pytest.approx(truth[1], abs=0.1)
    assert np.log(found.depth) == pytest.approx(truth[2], abs=0.1)


def test_strengths_give_a_known_transformation_back():
    relief = BasRelief(mu=0.4, nu=-0.3, depth=2.2)
    changed = relief.lights(DIRECTIONS)
    found = by_strengths(changed).relief
    np.testing.assert_allclose(found.lights(changed), DIRECTIONS, atol=1e-6)


def test_few_maxima_are_refused():
    _, albedo = plain_ball(1.0)
    with pytest.raises(InputError, match="5 local maxima"):
        by_maxima(synthetic_maxima(BasRelief(mu=0.0, nu=0.0, depth=1.0), count=5), albedo)


@pytest.mark.data
@pytest.mark.slow
@pytest.mark.parametrize(("name", "limit"), [("ballPNG", 4.8), ("catPNG", 9.6)])
def test_diligent_without_its_lights(data_dir, name, limit):
    from psstereo.io import read_capture
    from psstereo.normals.robust import Robust

    capture, truth = read_capture(data_dir / "diligent" / name)
    found = find_lights(forget(capture))
    normals = estimate_normals(found.capture, Robust()).normals
    assert summarise_angles(normals, truth.normals, capture.mask).mean_deg < limit
