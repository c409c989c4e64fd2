"""Near lamps: exact where the model holds, honest where it does not."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.flags import Flag, fatal_mask
from psstereo.lights import Led, Rig, StrengthUnit
from psstereo.metrics import angular_error
from psstereo.near import NearOptions, fit, level, solve_near, wants_near
from psstereo.normals import GATES, LeastSquares, estimate_normals, memory
from psstereo.normals.memory import plan_memory
from psstereo.pipeline import Options, reconstruct
from psstereo.results import AlbedoKind, DepthKind, Outcome
from psstereo.stack import MemoryStack, PixelSet
from tests.unit.near.near_scenes import parallel_sphere, pinhole_sphere, ring, shoot


def degrees(found, truth):
    angle = np.degrees(angular_error(np.asarray(found, np.float64), truth))
    return angle[np.isfinite(angle)]


def with_images(capture, images, **changes):
    return replace(capture, stack=MemoryStack(images), **changes)


@pytest.fixture(autouse=True)
def compiled(monkeypatch):
    """Take the compiled loop although there is little to do, as large images do; it is sooner done here too."""
    monkeypatch.setattr(fit, "BREAK_EVEN", 0.0)


@pytest.mark.parametrize(("mu", "break_even"), [(0.0, 0.0), (1.0, np.inf), (2.5, 0.0)])
def test_a_sphere_before_a_pinhole_comes_back_metric(mu, break_even, monkeypatch):
    """By either loop, the compiled and the readable one."""
    monkeypatch.setattr(fit, "BREAK_EVEN", break_even)
    camera, depth, normals, mask = pinhole_sphere()
    capture = shoot(camera, depth, normals, mask, ring(mu=mu))
    found = solve_near(capture, NearOptions(length_unit="mm"))
    assert degrees(found.normals.normals, normals).max() < 0.05
    np.testing.assert_allclose(found.depth.depth[mask], depth[mask], rtol=5e-4)
    assert found.depth.kind is DepthKind.DISTANCE
    assert found.depth.unit == "mm"
    assert found.converged
    assert found.normals.outcome is found.depth.outcome is Outcome.SOLVED
    assert np.isnan(found.depth.depth[~mask]).all()
    assert not fatal_mask(found.normals.flags[mask]).any()
    assert found.rounds[-1].energy < 1e-6 < found.rounds[0].energy


def test_a_sphere_seen_in_parallel_comes_back_metric():
    camera, depth, normals, mask = parallel_sphere()
    lamps = tuple(lamp.moved(np.eye(3), np.array([100.0, -100.0, 0.0])) for lamp in ring(aim=(0.0, 0.0, -650.0)))
    capture = shoot(camera, depth, normals, mask, lamps)
    found = solve_near(capture)
    assert degrees(found.normals.normals, normals).max() < 0.1
    assert np.abs(found.depth.depth - depth)[mask].max() < 0.5  # of 600 mm
    assert found.depth.kind is DepthKind.HEIGHT
    assert found.depth.unit == "mm"
    assert found.converged


@pytest.mark.parametrize("distance", [250.0, 450.0, 900.0, 1800.0])
def test_the_distance_is_found_wherever_the_object_is(distance):
    camera, depth, normals, mask = pinhole_sphere(32, radius=0.15 * distance, distance=distance)
    capture = shoot(camera, depth, normals, mask, ring(aim=(0.0, 0.0, -distance)))
    found = solve_near(capture)
    np.testing.assert_allclose(found.depth.depth[mask], depth[mask], rtol=2e-3)


@pytest.mark.parametrize("guess", [400.0, 600.0, 900.0])
def test_a_guess_is_refined(guess):
    camera, depth, normals, mask = pinhole_sphere(32)
    capture = shoot(camera, depth, normals, mask, ring())
    found = solve_near(capture, NearOptions(distance=guess))
    np.testing.assert_allclose(found.depth.depth[mask], depth[mask], rtol=1e-3)


def test_a_known_distance_is_held():
    camera, depth, normals, mask = pinhole_sphere(32)
    capture = shoot(camera, depth, normals, mask, ring())
    found = solve_near(capture, NearOptions(distance=580.0, hold_distance=True))
    assert np.nanmedian(found.depth.depth) == pytest.approx(580.0, rel=1e-3)
    assert abs(np.nanmedian(depth) - 580.0) > 10
    assert found.normals.facts["distance_held"] is True


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_lengths_in_another_unit_change_nothing_else(factor):
    camera, depth, normals, mask = pinhole_sphere(32)
    lamps = ring()
    capture = shoot(camera, depth, normals, mask, lamps)
    other = tuple(
        Led(position=lamp.position * factor, axis=lamp.axis, mu=lamp.mu, flux=lamp.flux * factor**2) for lamp in lamps
    )
    first, second = solve_near(capture), solve_near(replace(capture, rig=Rig(other)))
    np.testing.assert_allclose(second.normals.normals[mask], first.normals.normals[mask], rtol=0, atol=1e-7)
    np.testing.assert_allclose(second.depth.depth[mask], first.depth.depth[mask] * factor, rtol=1e-7)
    np.testing.assert_allclose(second.normals.albedo[mask], first.normals.albedo[mask], rtol=1e-6)


def test_the_order_of_lamps_is_irrelevant():
    camera, depth, normals, mask = pinhole_sphere(32)
    capture = shoot(camera, depth, normals, mask, ring(), noise=0.01)
    order = np.random.default_rng(1).permutation(12)
    swapped = with_images(capture, capture.stack.read()[order], rig=capture.rig.select(order))
    first, second = solve_near(capture), solve_near(swapped)
    np.testing.assert_allclose(second.normals.normals[mask], first.normals.normals[mask], rtol=0, atol=1e-6)
    np.testing.assert_allclose(second.depth.depth[mask], first.depth.depth[mask], rtol=1e-6)


def least_memory(capture):
    """Return a bound that just does for tiles of one block."""
    for bound in range(100_000, 10_000_000, 50_000):
        try:
            plan = plan_memory(capture.stack, PixelSet.from_mask(capture.mask), 1, bound, 1)
        except InputError:
            continue
        assert not plan.in_memory
        return bound
    raise AssertionError


def test_threads_and_tiles_give_the_same_bytes(monkeypatch):
    for module in (fit, level, memory):
        monkeypatch.setattr(module, "BLOCK", 300)  # so that a small image has many blocks and tiles
    camera, depth, normals, mask = pinhole_sphere(40)
    assert mask.sum() > 3 * 300
    capture = shoot(camera, depth, normals, mask, ring(), noise=0.01)
    first = solve_near(capture)
    with ThreadPoolExecutor(2) as pool:
        threaded = solve_near(capture, NearOptions(workers=2), over=pool.map)
    tiled = solve_near(capture, NearOptions(max_memory=least_memory(capture)))
    assert tiled.normals.facts["samples_in"] == "temporary file"
    for other in (threaded, tiled):
        assert other.normals.normals.tobytes() == first.normals.normals.tobytes()
        assert other.depth.depth.tobytes() == first.depth.depth.tobytes()
        assert other.normals.uncertainty.tobytes() == first.normals.uncertainty.tobytes()


def test_light_from_elsewhere_is_subtracted():
    camera, depth, normals, mask = pinhole_sphere(32)
    capture = shoot(camera, depth, normals, mask, ring())
    dark = np.random.default_rng(2).uniform(0.1, 0.5, (32, 32, 1))
    spoilt = with_images(capture, capture.stack.read() + dark, dark=dark)
    found = solve_near(spoilt)
    assert degrees(found.normals.normals, normals).max() < 0.05
    np.testing.assert_allclose(found.depth.depth[mask], depth[mask], rtol=1e-3)


def test_cast_shadows_highlights_and_missing_values_are_outvoted():
    camera, depth, normals, mask = pinhole_sphere(36)
    capture = shoot(camera, depth, normals, mask, ring(20))
    images = capture.stack.read().copy()
    rng = np.random.default_rng(3)
    images[rng.random(images.shape) < 0.05] = 0.0
    images[rng.random(images.shape) < 0.05] += 0.5
    images[rng.random(images.shape) < 0.05] = np.nan
    found = solve_near(with_images(capture, images))
    angle = degrees(found.normals.normals, normals)
    assert np.median(angle) < 0.01
    assert np.quantile(angle, 0.98) < 0.5
    np.testing.assert_allclose(np.nanmedian(found.depth.depth), np.nanmedian(depth), rtol=2e-3)
    flags = found.normals.flags[mask]
    assert ((flags & Flag.UNUSABLE_SAMPLE) != 0).mean() > 0.5
    plain = degrees(estimate_as_distant(with_images(capture, images), depth), normals)
    assert np.median(plain) > 1


def estimate_as_distant(capture, depth):
    """Return the normals by lights as they are at the middle of the object."""
    points = capture.camera.points(depth)
    middle = np.nanmean(points[capture.mask], axis=0)
    beams = [next(light.beams(middle[None], 1)) for light in capture.rig.lights]
    rig = Rig.distant([beam.directions[0] for beam in beams], [beam.irradiance[0] for beam in beams])
    return estimate_normals(replace(capture, rig=rig), LeastSquares(gate=GATES["auto"])).normals


def test_saturated_values_are_left_out():
    camera, depth, normals, mask = pinhole_sphere(28)
    capture = shoot(camera, depth, normals, mask, ring(20))
    images = np.minimum(capture.stack.read() * 1.3, 1.0)
    spoilt = with_images(capture, np.round(images * 65535).astype(np.uint16))
    found = solve_near(spoilt)
    assert degrees(found.normals.normals, normals).max() < 0.1
    left_in = solve_near(spoilt, NearOptions(saturation=False))
    assert left_in.normals.facts["gate"] == "shadow"
    assert degrees(left_in.normals.normals, normals).mean() > 2 * degrees(found.normals.normals, normals).mean()


def test_colours_and_their_albedo():
    camera, depth, normals, mask = pinhole_sphere(32)
    albedo = np.array([0.8, 0.4, 0.2])
    lamps = ring(flux=[1.0, 1.5, 0.7])
    capture = shoot(camera, depth, normals, mask, lamps, albedo=albedo)
    white = (
        next(light.irradiance(camera.points(depth), normals)[mask] * albedo for light in capture.rig.lights[:1])
        / capture.stack.read()[0][mask]
    )
    radiance = float(np.nanmedian(white))
    capture = replace(capture, rig=Rig(lamps, StrengthUnit.IRRADIANCE), radiance_at_white=radiance / np.pi)
    found = solve_near(capture, NearOptions(gray="per-channel"))
    assert found.normals.albedo_kind is AlbedoKind.REFLECTANCE
    np.testing.assert_allclose(found.normals.albedo[mask], np.broadcast_to(albedo, (mask.sum(), 3)), rtol=3e-3)
    assert degrees(found.normals.normals, normals).max() < 0.05


@pytest.mark.parametrize("lamps", [8, 24])
def test_error_bars_hold(lamps):
    camera, depth, normals, mask = pinhole_sphere(64, radius=60.0)
    capture = shoot(camera, depth, normals, mask, ring(lamps), noise=0.02)
    found = solve_near(capture)
    centre = mask & (normals[..., 2] > 0.8)  # every lamp in front
    angle = angular_error(found.normals.normals.astype(float), normals)[centre]
    expected = found.normals.uncertainty[centre]
    share = np.sqrt(np.mean(angle**2)) / np.sqrt(np.mean(expected**2))
    assert 0.85 < share < 1.15


def test_the_deviation_of_the_distance_holds():
    camera, depth, normals, mask = pinhole_sphere(24)
    found, promised = [], []
    for seed in range(8):
        capture = shoot(camera, depth, normals, mask, ring(), noise=0.05, seed=seed)
        # Begun nearby, since where it begins is other tests' matter; eight searches would take half of the time.
        result = solve_near(capture, NearOptions(distance=650.0))
        found.append(np.nanmedian(result.depth.depth) / np.nanmedian(depth) - 1)
        promised.append(result.depth.facts["distance_deviation"] / np.nanmedian(depth))
    assert 0.3 < np.std(found) / np.mean(promised) < 3
    assert abs(np.mean(found)) < 0.005


def test_pieces_apart_each_have_their_own_distance():
    camera, depth, normals, mask = pinhole_sphere(64)
    other = np.roll(depth, 0) * 1.06
    right = np.arange(64) >= 34
    gap = (np.arange(64) >= 30) & ~right
    joined = np.where(right, other, depth)
    mask = mask & ~gap
    capture = shoot(camera, np.where(mask, joined, np.nan), normals, mask, ring())
    found = solve_near(capture)  # a scaled copy has the same normals, seen from the pinhole
    assert found.depth.components.max() == 2
    np.testing.assert_allclose(found.depth.depth[mask], joined[mask], rtol=2e-3)


def test_far_lamps_approach_distant_light_at_first_order():
    """Check 8: the difference to parallel light falls like size over distance, in images and in normals."""
    size, errors, differences = 100.0, [], []
    for distance in (4e3, 8e3, 16e3, 32e3):
        camera, depth, normals, mask = parallel_sphere(24, radius=size, height=0.0)
        lamps = tuple(
            Led(position=np.array([s[0], s[1], 1.0]) * distance, axis=[-s[0], -s[1], -1.0], mu=0.0, flux=distance**2)
            for s in ([0.5, 0], [-0.5, 0], [0, 0.5], [0, -0.5], [0.3, 0.3])
        )
        capture = shoot(camera, depth, normals, mask, lamps)
        middle = camera.points(depth)[12, 12]
        far = np.stack([lamp.irradiance(np.broadcast_to(middle, (24, 24, 3)), normals)[..., 0] for lamp in lamps])
        near = np.stack([lamp.irradiance(camera.points(depth), normals)[..., 0] for lamp in lamps])
        bright = mask & (far > 0.2 * np.nanmax(far)).all(axis=0)
        differences.append(np.abs(near / far - 1)[:, bright].max())
        errors.append(degrees(estimate_as_distant(capture, depth), normals).mean())
        held = solve_near(capture, NearOptions(distance=float(np.nanmedian(depth)), hold_distance=True))
        assert degrees(held.normals.normals, normals).max() < 0.02
        assert size / distance < differences[-1] < 5 * size / distance
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 2.0, rtol=0.1)
    np.testing.assert_allclose(np.divide(differences[:-1], differences[1:]), 2.0, rtol=0.1)


def test_a_distance_that_the_light_does_not_tell_is_refused_unless_it_is_known():
    camera, depth, normals, mask = pinhole_sphere(16, radius=20.0, focal=12.0)
    lamps = tuple(
        Led(position=lamp.position * 60 + [0, 0, 3e4], axis=[0, 0, -1], mu=0.0, flux=lamp.flux) for lamp in ring()
    )
    capture = shoot(camera, depth, normals, mask, lamps, noise=0.1)
    with pytest.raises(InputError, match="standard deviation"):
        solve_near(capture, NearOptions(distance=600.0))
    found = solve_near(capture, NearOptions(distance=600.0, hold_distance=True))
    assert np.median(degrees(found.normals.normals, normals)) < 10
    assert found.depth.facts["distance_deviation"] > 60


def test_too_few_rounds_are_said():
    camera, depth, normals, mask = pinhole_sphere(32)
    capture = shoot(camera, depth, normals, mask, ring())
    found = solve_near(capture, NearOptions(max_rounds=1, tolerance=1e-9))
    assert not found.converged
    assert found.normals.outcome is found.depth.outcome is Outcome.NOT_CONVERGED
    assert ((found.normals.flags[mask] & Flag.NOT_CONVERGED) != 0).all()
    answer = reconstruct(capture)
    assert answer.converged


def test_energy_falls_and_progress_is_told():
    camera, depth, normals, mask = pinhole_sphere(80)
    capture = shoot(camera, depth, normals, mask, ring(), noise=0.01)
    stages = []
    found = solve_near(capture, progress=lambda stage, done, total: stages.append((stage, done, total)))
    names = {stage for stage, _, _ in stages}
    assert {"reading images", "looking for the distance", "alternating"} <= names
    assert all(0 < done <= total for _, done, total in stages)
    fine = [one.energy for one in found.rounds if one.factor == 1]
    assert fine[-1] <= fine[0]
    assert {one.factor for one in found.rounds} == {1, 2}


def test_the_pipeline_takes_near_lamps():
    camera, depth, normals, mask = pinhole_sphere(32)
    capture = shoot(camera, depth, normals, mask, ring())
    assert wants_near(capture)
    answer = reconstruct(capture)
    np.testing.assert_allclose(answer.depth.depth[mask], depth[mask], rtol=1e-3)
    assert len(answer.mesh.vertices) == mask.sum()
    np.testing.assert_allclose(np.median(-answer.mesh.vertices[:, 2]), np.median(depth[mask]), rtol=1e-3)
    steps = {step.name: step for step in answer.steps}
    assert steps["normals (near-lamps)"].done
    assert "fall-off" in steps["depth (poisson)"].reason
    only = reconstruct(capture, Options(integrator=None))
    assert only.depth is None
    assert only.normals.normals.tobytes() == answer.normals.normals.tobytes()


def test_black_pixels_and_images():
    camera, depth, normals, mask = pinhole_sphere(32)
    capture = shoot(camera, depth, normals, mask, ring())
    images = capture.stack.read().copy()
    images[:, 14:17, 14:17] = 0.0
    found = solve_near(with_images(capture, images))
    assert ((found.normals.flags[14:17, 14:17] & Flag.NO_SIGNAL) != 0).all()
    assert np.isnan(found.normals.normals[14:17, 14:17]).all()
    assert found.normals.outcome is Outcome.PARTIAL
    good = np.isfinite(found.depth.depth)
    np.testing.assert_allclose(found.depth.depth[good], depth[good], rtol=5e-3)
    images[4] = 0.0
    with pytest.raises(InputError, match="nothing brighter than black"):
        solve_near(with_images(capture, images))


def test_a_single_pixel_has_a_normal_and_a_distance():
    camera, depth, normals, mask = pinhole_sphere(32)
    one = np.zeros_like(mask)
    one[16, 16] = True
    found = solve_near(replace(shoot(camera, depth, normals, mask, ring()), mask=one))
    assert degrees(found.normals.normals, normals).max() < 0.1
    assert found.depth.depth[16, 16] == pytest.approx(depth[16, 16], rel=2e-3)
