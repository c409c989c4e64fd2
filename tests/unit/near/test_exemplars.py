"""Near lamps over glossy surfaces: exemplar materials in each pixel's own frame."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from psstereo.brdf import Ggx, Lambert
from psstereo.errors import OptionError, RigError
from psstereo.kernels.exemplar_lobes import lights_table, lobes
from psstereo.kernels.near import lamp_vectors
from psstereo.lights import Led, Rig
from psstereo.metrics import angular_error
from psstereo.near import NearOptions, fit, level, reflectance, solve_near
from psstereo.near.exemplars import exemplar_state, fit_block, share_of
from psstereo.near.frames import eye_frames, seen_lamps, turned
from psstereo.near.lamps import lamp_array
from psstereo.near.profile import least_energy
from psstereo.near.pull import Places, exemplar_pull
from psstereo.normals import memory
from psstereo.normals.estimate import estimate_normals
from psstereo.normals.exemplar import LOBES, Exemplar
from psstereo.results import Outcome
from tests.unit.near.near_scenes import dome, parallel_sphere, pinhole_sphere, ring, shoot, shoot_glossy

PLASTIC = Ggx(albedo=[0.4], f0=[0.05], roughness=[0.45])
METAL = Ggx(albedo=[0.0], f0=[0.8], roughness=[0.6])


@pytest.fixture(autouse=True)
def compiled(monkeypatch):
    """Take the compiled loops although there is little to do."""
    monkeypatch.setattr(fit, "BREAK_EVEN", 0.0)
    monkeypatch.setattr(reflectance, "_FITS", 1e5)


def degrees(found, truth):
    angle = np.degrees(angular_error(np.asarray(found, np.float64), truth))
    return angle[np.isfinite(angle)]


def rays(count=50, seed=0):
    across = np.random.default_rng(seed).uniform(-1.5, 1.5, (count, 2))
    return np.concatenate([across, np.full((count, 1), -1.0)], axis=1)


def test_frames_turn_the_eye_to_z_and_no_farther():
    sight = rays()
    frames = eye_frames(sight)
    eye = -sight / np.linalg.norm(sight, axis=1, keepdims=True)
    np.testing.assert_allclose(turned(frames, eye), np.broadcast_to([0, 0, 1.0], eye.shape), atol=1e-14)
    np.testing.assert_allclose(frames @ frames.transpose(0, 2, 1), np.broadcast_to(np.eye(3), frames.shape), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(frames), 1.0, atol=1e-14)
    np.testing.assert_allclose(np.trace(frames, axis1=1, axis2=2), 1 + 2 * eye[:, 2], atol=1e-14)  # angle of the turn
    vectors = np.random.default_rng(1).normal(size=eye.shape)
    np.testing.assert_allclose(turned(frames, turned(frames, vectors), back=True), vectors, atol=1e-14)
    np.testing.assert_array_equal(eye_frames(np.array([[0, 0, -1.0]]))[0], np.eye(3))


def test_seen_lamps_are_what_a_facing_surface_gets():
    sight = rays(20)
    points = 6.0 * sight
    lamps = np.array([[1, 2, 0.5, 0, 0, -1, 1.0], [-2, 0, 1, 0.2, 0, -1, 0.0], [0, 1, 0, 0, 0, 1, 2.0]])
    light, _ = lamp_vectors(points, points, lamps)
    seen = seen_lamps(light, eye_frames(sight))
    for i, row in enumerate(lamps):
        led = Led(position=row[:3], axis=row[3:6], mu=row[6], flux=1.0)
        to_lamp = row[:3] - points
        to_lamp /= np.linalg.norm(to_lamp, axis=1, keepdims=True)
        np.testing.assert_allclose(seen.strengths[:, i], led.irradiance(points, to_lamp)[:, 0], rtol=1e-12)
    assert (seen.strengths[:, 2] == 0).all()  # it shines away
    values = seen.values(np.ones((3, 20)))
    assert np.isnan(values[:, 2]).all()
    np.testing.assert_allclose(values[:, :2] * seen.strengths[:, :2], 1.0)
    np.testing.assert_allclose(np.linalg.norm(seen.directions[:, :2], axis=2), 1.0)
    assert (seen.directions[:, 2] == 0).all()
    np.testing.assert_allclose(seen.weights.max(axis=1), 1.0)


def exact_pixels(state, count=60, lamps=32):
    """Return places, lamps and the brightness of a material of the dictionary there."""
    rng = np.random.default_rng(5)
    sight = rays(count, 6) * [0.3, 0.3, 1.0]
    points = 600.0 * sight
    array = lamp_array(Rig(ring(lamps)))
    normals = np.add(rng.normal(0, 0.25, (count, 3)), [0, 0, 1.0])
    places = Places(points, points, eye_frames(sight))
    facing = turned(places.frames, normals / np.linalg.norm(normals, axis=1, keepdims=True))
    seen = places.lamps(array)
    d = state.dictionary
    amounts = np.array([{"lambert": 0.5, "gloss-0.6": 0.3}.get(lobe.name, 0.0) for lobe in LOBES])
    shown = amounts @ lobes(facing, lights_table(seen.directions), d.kinds, d.shapes)
    return places, array, (shown * seen.strengths).T, facing


def test_the_pull_leads_back_to_where_a_surface_is():
    """To first order a Gauss–Newton step is exact; that other materials and normals are free costs part of the way."""
    state = exemplar_state(Exemplar(), ring_directions(32), None, 1e9)
    places, array, brightness, facing = exact_pixels(state)
    begin = turned(places.frames, facing, back=True)
    for moved in (-2e-3, 2e-3):
        there = Places(places.points * (1 + moved), places.motion * (1 + moved), places.frames)
        found, values = fit_block(state, brightness, there, array, begin)
        scale = 0.1 * brightness.mean(axis=0)
        pull, stiffness = exemplar_pull(found, state.dictionary, values, there, lamps=array, scale=scale)
        assert (stiffness >= 0).all()
        assert pull.sum() / stiffness.sum() == pytest.approx(-moved, rel=0.25)
    found, _ = fit_block(state, brightness, places, array, begin)
    assert np.median(angular_error(found.normal, facing)) < 1e-3  # lobes that look alike share the light


def ring_directions(count):
    away = lamp_array(Rig(ring(count)))[:, :3] - [0, 0, -600.0]
    return away / np.linalg.norm(away, axis=1, keepdims=True)


def test_the_least_energy_of_a_known_curve_is_found():
    found = least_energy(lambda x: 3.0 + 5.0 * (x - 0.037) ** 2, 1.0)
    assert found.shift == pytest.approx(0.037, abs=1e-12)
    assert found.stiffness == pytest.approx(5.0)
    found = least_energy(lambda x: np.cosh((x + 7.0) / 100.0), 100.0)
    assert found.shift == pytest.approx(-7.0, abs=0.05)
    far = least_energy(lambda x: -x, 1.0)
    assert far.stiffness == 0
    assert far.shift > 0.1


def test_shares_grow_from_none_to_all():
    share = share_of(np.array([-5.0, np.nan, 2.0, 3.0, 4.0, 50.0]), 48)
    np.testing.assert_allclose(share, [0, 0, 0, 0.5, 1, 1])
    assert share_of(np.array([4.0]), 16)[0] == 0  # twice as much with half of the lamps


def solved(capture, word, **more):
    return solve_near(capture, NearOptions(reflectance=word, **more))


def test_plastic_loses_two_thirds_of_its_error_and_says_why():
    camera, depth, normals, mask = pinhole_sphere(16)
    capture = shoot_glossy(camera, depth, normals, mask, dome(24), brdf=PLASTIC)
    matte, found = solved(capture, "lambert"), solved(capture, "auto")
    before, after = degrees(matte.normals.normals, normals), degrees(found.normals.normals, normals)
    assert after.mean() < before.mean() / 3
    error = [abs(np.nanmedian(one.depth.depth / depth) - 1) for one in (matte, found)]
    assert error[1] < error[0] / 3
    facts = found.normals.facts
    assert facts["reflectance"] == "exemplar"
    assert facts["lambert_broken"] > 0.05
    assert facts["pixels_glossy"] > 0.5
    assert 1 <= facts["materials"] <= 3
    assert "Lambert's law does not" in facts["reflectance_reason"]
    assert matte.normals.facts["reflectance"] == "lambert"
    assert {one.reflectance for one in found.rounds} == {"lambert", "exemplar"}
    assert {one.reflectance for one in matte.rounds} == {"lambert"}


def test_metal_is_found_although_lambert_is_lost():
    camera, depth, normals, mask = pinhole_sphere(16)
    capture = shoot_glossy(camera, depth, normals, mask, dome(32), brdf=METAL)
    found = solved(capture, "auto", tolerance=2e-3, max_rounds=10)
    assert np.median(degrees(found.normals.normals, normals)) < 1.5
    assert abs(np.nanmedian(found.depth.depth / depth) - 1) < 0.01
    assert np.median(degrees(solved(capture, "lambert", max_rounds=10).normals.normals, normals)) > 10.0


def test_matte_surfaces_keep_their_bytes():
    camera, depth, normals, mask = pinhole_sphere(16)
    capture = shoot_glossy(camera, depth, normals, mask, ring(20), brdf=Lambert(albedo=[0.5]), noise=0.01)
    plain, found = solved(capture, "lambert"), solved(capture, "auto")
    assert found.normals.normals.tobytes() == plain.normals.normals.tobytes()
    assert found.depth.depth.tobytes() == plain.depth.depth.tobytes()
    assert found.normals.facts["reflectance"] == "lambert"
    assert found.normals.facts["lambert_broken"] < 0.05
    assert "stands" in found.normals.facts["reflectance_reason"]


def test_lamps_far_away_give_the_normals_of_the_solver_for_distant_light():
    size, far = 1.0, 1e4
    camera, depth, normals, mask = parallel_sphere(18, radius=size, height=0.0)
    lamps = []
    for k in range(24):
        z = 1 - 0.45 * (k + 0.5) / 24
        across = np.sqrt(1 - z * z) * np.array([np.cos(2.4 * k), np.sin(2.4 * k)])
        direction = np.array([*across, z])
        lamps.append(Led(position=direction * far, axis=-direction, mu=0.0, flux=far**2))
    capture = shoot_glossy(camera, depth, normals, mask, lamps, brdf=PLASTIC)
    held = NearOptions(distance=float(np.nanmedian(depth)), hold_distance=True, reflectance="exemplar")
    near = solve_near(capture, replace(held, exemplars=Exemplar(shared=0)))
    rig = Rig.distant([lamp.position / far for lamp in lamps], [lamp.flux / far**2 for lamp in lamps])
    distant = estimate_normals(replace(capture, rig=rig), Exemplar(shared=0))
    apart = angular_error(near.normals.normals.astype(float), distant.normals.astype(float))[mask]
    assert np.median(apart) < 5e-4
    assert np.mean(apart < 1e-3) > 0.75  # the two begin elsewhere and weigh Lambert's law otherwise


@pytest.mark.parametrize("distance", [1e4, 1e6])
def test_far_lamps_and_distant_lights_are_the_same_to_the_loop(distance):
    """From the same start; what is left of the difference falls as the lamps go away."""
    state = exemplar_state(Exemplar(), ring_directions(32), None, 1e9)
    _, _, brightness, facing = exact_pixels(state)
    count, eye = len(facing), np.broadcast_to([0, 0, -1.0], facing.shape)
    across = ring_directions(32)
    lamps = np.concatenate([distance * across, -across, np.zeros((32, 1))], axis=1)
    points = np.random.default_rng(1).uniform(-0.5, 0.5, (count, 3))
    places = Places(points, np.broadcast_to([0, 0, 1.0], points.shape), eye_frames(eye))
    brightness = brightness / brightness.mean()
    near, _ = fit_block(state, brightness / distance**2, places, lamps, facing / distance**2)
    rows, table = brightness.T.copy(), lights_table(across)
    distant = state.fit(rows, np.ones((0, 0)), facing, table, state.dictionary, state.settings)
    apart = angular_error(near.normal, distant.normal)
    assert np.median(apart) < 10 / distance
    assert np.quantile(apart, 0.95) < 1e-3


def test_threads_and_blocks_give_the_same_bytes(monkeypatch):
    camera, depth, normals, mask = pinhole_sphere(18)
    capture = shoot_glossy(camera, depth, normals, mask, dome(18), brdf=PLASTIC, noise=0.003)
    for module in (memory, level, fit):
        monkeypatch.setattr(module, "BLOCK", 100)
    first = solved(capture, "exemplar", max_rounds=1)
    with ThreadPoolExecutor(2) as pool:
        options = NearOptions(reflectance="exemplar", max_rounds=1, workers=2)
        other = solve_near(capture, options, over=pool.map)
    assert first.normals.normals.tobytes() == other.normals.normals.tobytes()
    assert first.depth.depth.tobytes() == other.depth.depth.tobytes()
    assert first.normals.uncertainty.tobytes() == other.normals.uncertainty.tobytes()
    assert first.normals.outcome is Outcome.NOT_CONVERGED


def test_too_few_lamps_are_said_or_refused():
    camera, depth, normals, mask = pinhole_sphere(16)
    capture = shoot(camera, depth, normals, mask, ring(15))
    with pytest.raises(RigError, match="15 lamps"):
        solved(capture, "exemplar")
    facts = solved(capture, "auto").normals.facts
    assert facts["reflectance"] == "lambert"
    assert "15" in facts["reflectance_reason"]
    with pytest.raises(OptionError, match="nonsense"):
        NearOptions(reflectance="nonsense")
