import math

import cv2
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.calibrate.shape import calibrate_known_shape, mesh_normals, sphere_normals
from psstereo.camera import Orthographic, Pinhole
from psstereo.errors import InputError, RigError

BALL = sphere_normals((61, 61), (30.0, 30.0), 27.0)
INSIDE = np.isfinite(BALL[..., 0])
PLACES = np.argwhere(INSIDE)
LIGHTS = np.array([[0.3, 0.2, 0.9], [-0.6, 0.1, 0.7], [0.1, -0.8, 0.4], [0.0, 0.0, 1.0], [0.95, 0.1, 0.2]])
LIGHTS /= np.linalg.norm(LIGHTS, axis=1, keepdims=True)
POWERS = np.array([[1.0, 0.8, 0.6], [0.7, 0.7, 0.5], [1.2, 0.9, 0.9], [0.5, 0.6, 0.7], [1.0, 1.0, 1.0]])
LEVELS = np.array([0.02, 0.1, 0.05, 0.0, 0.03])


def degrees(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)))


def shown(normals, noise=0.0, seed=0):
    """Return the brightness (m, p, c) of an even matte surface of the given normals (p, 3)."""
    shade = np.maximum(LIGHTS @ normals.T, 0.0)[..., None] * POWERS[:, None] + LEVELS[:, None, None]
    return shade + np.random.default_rng(seed).normal(0, noise, shade.shape)


def test_a_clean_ball_gives_everything_back():
    found = calibrate_known_shape(shown(BALL[INSIDE]), BALL[INSIDE], places=PLACES)
    assert degrees(found.rig.directions, LIGHTS).max() < 1e-6
    np.testing.assert_allclose(found.rig.strengths(3), POWERS, rtol=1e-8)
    np.testing.assert_allclose(found.ambient, np.broadcast_to(LEVELS[:, None], (5, 3)), atol=1e-9)
    assert "5 lights from a known shape" in found.quality.verdict
    assert any("Ambient light differs" in line for line in found.quality.advice)


def test_predicted_errors_are_those_that_noise_makes():
    ratios = []
    for seed in range(4):
        found = calibrate_known_shape(shown(BALL[INSIDE], 0.02, seed), BALL[INSIDE], places=PLACES)
        off = np.radians(degrees(found.rig.directions, LIGHTS))
        strong = np.abs(found.rig.strengths(3) / POWERS - 1).max(axis=1)
        ratios.append([off / found.quality.direction_error, strong / found.quality.strength_error])
        assert np.degrees(off).max() < 1.0
    spread = np.sqrt((np.array(ratios) ** 2).mean(axis=(0, 2)))
    assert ((spread > 0.5) & (spread < 1.8)).all(), spread


def test_gloss_and_a_cast_shadow_hardly_matter():
    values = shown(BALL[INSIDE], 0.005)
    for k, light in enumerate(LIGHTS):
        half = light + np.array([0.0, 0.0, 1.0])
        values[k] += 3.0 * np.maximum(BALL[INSIDE] @ (half / np.linalg.norm(half)), 0.0)[:, None] ** 80
    values[:, PLACES[:, 0] > 50] = LEVELS[:, None, None]
    found = calibrate_known_shape(values, BALL[INSIDE], places=PLACES)
    assert degrees(found.rig.directions, LIGHTS).max() < 0.6
    np.testing.assert_allclose(found.rig.strengths(3), POWERS, rtol=0.02)


@settings(max_examples=6, derandomize=True, deadline=None)
@given(st.floats(-1.0, 1.0), st.floats(-3.1, 3.1), st.floats(0.01, 100.0), st.floats(0.0, 1.0))
def test_any_light_from_the_front_side(tilt, turn, power, level):
    light = np.array([math.sin(tilt) * math.cos(turn), math.sin(tilt) * math.sin(turn), math.cos(tilt)])
    values = power * (np.maximum(BALL[INSIDE] @ light, 0.0) + level)
    found = calibrate_known_shape(values[None], BALL[INSIDE], places=PLACES)
    assert degrees(found.rig.directions[0], light) < 1e-4
    assert found.rig.strengths(1)[0, 0] == pytest.approx(power, rel=1e-5)
    assert found.ambient[0, 0] == pytest.approx(power * level, abs=1e-5 * power)


def test_a_plane_tells_one_number_a_light():
    plane = np.broadcast_to([0.0, 0.0, 1.0], (400, 3))
    values = shown(plane) - LEVELS[:, None, None]
    with pytest.raises(InputError, match="plane") as caught:
        calibrate_known_shape(values, plane, ambient=False)
    assert "one number a light" in caught.value.needed
    found = calibrate_known_shape(values, plane, ambient=False, directions=LIGHTS)
    np.testing.assert_allclose(found.rig.strengths(3), POWERS, rtol=1e-9)
    assert found.quality.direction_error is None
    assert "as given" in found.quality.verdict


def test_a_cylinder_and_a_cone_do_not_tell_all():
    turn = np.linspace(-1.2, 1.2, 300)
    cylinder = np.stack([np.sin(turn), 0 * turn, np.cos(turn)], axis=1)
    with pytest.raises(InputError, match="one plane"):
        calibrate_known_shape(shown(cylinder), cylinder)
    around = np.linspace(0, 6.28, 300)
    cone = np.stack([0.6 * np.cos(around), 0.6 * np.sin(around), 0.8 + 0 * around], axis=1)
    with pytest.raises(InputError, match="one angle"):
        calibrate_known_shape(shown(cone), cone)
    found = calibrate_known_shape(shown(cone)[:1] - LEVELS[0], cone, ambient=False)
    assert degrees(found.rig.directions[0], LIGHTS[0]) < 1e-6


@pytest.mark.parametrize(
    ("values", "normals", "options"),
    [
        (np.ones((2, 10)), np.ones((10, 3)), {}),
        (np.ones((2, 9)), BALL[INSIDE], {}),
        (np.zeros((2, INSIDE.sum())), BALL[INSIDE], {}),
        (np.full((2, INSIDE.sum()), np.nan), BALL[INSIDE], {}),
        (shown(BALL[INSIDE]), np.full((INSIDE.sum(), 3), np.nan), {}),
        (shown(BALL[INSIDE]), BALL[INSIDE], {"directions": LIGHTS[:2]}),
        (shown(BALL[INSIDE]), BALL[INSIDE], {"directions": -LIGHTS}),
        (shown(BALL[INSIDE]), BALL[INSIDE], {"places": np.zeros((3, 2), int)}),
    ],
)
def test_what_cannot_be_is_refused(values, normals, options):
    with pytest.raises((InputError, RigError)):
        calibrate_known_shape(values, normals, **options)


def test_a_sphere_out_of_the_picture_is_refused():
    for centre, radius in (((5.0, 5.0), 0.0), ((500.0, 5.0), 3.0), ((math.nan, 5.0), 3.0), ((5.0, 5.0), math.inf)):
        with pytest.raises(InputError):
            sphere_normals((10, 10), centre, radius)


def test_a_mesh_of_a_sphere_is_seen_as_one():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=27.0)
    seen = mesh_normals(ball.vertices + np.array([30.0, -30.0, 5.0]), ball.faces, Orthographic(), (61, 61))
    both = INSIDE & np.isfinite(seen[..., 0]) & (BALL[..., 2] > 0.3)
    assert both.sum() > 0.85 * INSIDE.sum()
    assert degrees(seen[both], BALL[both]).max() < 1.5
    inside_out = mesh_normals(
        ball.vertices + np.array([30.0, -30.0, 5.0]), ball.faces[:, ::-1], Orthographic(), (61, 61)
    )
    np.testing.assert_allclose(inside_out[both], seen[both], atol=1e-9)
    found = calibrate_known_shape(shown(BALL[both]), seen[both])
    assert degrees(found.rig.directions, LIGHTS).max() < 0.3


def test_a_mesh_before_a_pinhole():
    camera = Pinhole(fx=100.0, fy=100.0, cx=20.0, cy=20.0)
    ball = trimesh.creation.icosphere(subdivisions=4, radius=10.0)
    seen = mesh_normals(ball.vertices + np.array([0.0, 0.0, -100.0]), ball.faces, camera, (41, 41), smooth=False)
    assert degrees(seen[20, 20], np.array([0.0, 0.0, 1.0])) < 3
    assert seen[20, 27, 0] > 0.5
    assert seen[13, 20, 1] > 0.5
    assert np.isnan(seen[0, 0]).all()
    with pytest.raises(InputError, match="sees"):
        mesh_normals(ball.vertices + np.array([0.0, 0.0, 100.0]), ball.faces, camera, (41, 41))
    with pytest.raises(InputError, match="mesh"):
        mesh_normals(ball.vertices, ball.faces + len(ball.vertices), camera, (41, 41))


@pytest.mark.data
def test_a_real_sphere_with_its_pedestal_subtracted(data_dir):
    """Columbia's matte sphere: directions that a fit elsewhere gave, and a free level that gives itself away."""
    folder = data_dir / "hand"
    images = np.array([cv2.imread(str(folder / f"sphere{k}.pgm"), -1) for k in (1, 2, 3)], np.float64)
    normals = sphere_normals(images.shape[1:], (367.2, 220.0), 80.4)
    inside = np.isfinite(normals[..., 0])
    inside[np.arange(480) % 4 > 0] = False
    free = calibrate_known_shape(images[:, inside], normals[inside], places=np.argwhere(inside))
    assert any("Ambient light differs" in line for line in free.quality.advice)
    pedestal = np.median(images[:, :100, :200])
    found = calibrate_known_shape(
        images[:, inside] - pedestal, normals[inside], places=np.argwhere(inside), ambient=False
    )
    known = np.array([[0.145, -0.447, 0.882], [0.521, 0.114, 0.846], [0.211, 0.537, 0.817]])
    assert degrees(found.rig.directions, known / np.linalg.norm(known, axis=1, keepdims=True)).max() < 1.5
    assert found.quality.residual_brightness < 0.08
