"""Rendered matte balls and white cards to directions, strengths and levels."""

from functools import cache

import numpy as np
import pytest

from psstereo.calibrate.balls import Ball, BallPictures, calibrate_matte_balls
from psstereo.calibrate.white_target import white_strengths
from psstereo.camera import Orthographic, Pinhole
from psstereo.errors import InputError, OptionError
from psstereo.lights import Directional, Led, Rig, Sun
from psstereo.stack import MemoryStack
from psstereo_synth.calibration_balls import matte_ball_picture

TOWARD = np.array([[0.1, 0.2, 1.0], [0.9, 0.2, 0.4], [-0.5, 0.9, 0.6]])
TOWARD /= np.linalg.norm(TOWARD, axis=1, keepdims=True)
STRENGTHS = np.array([[0.7, 0.5, 0.3], [0.6, 0.6, 0.6], [0.4, 0.5, 0.7]])
BALL = Ball.circle(36.3, 35.8, 32.0)


def frames(ball=BALL, ambient=0.1, noise=0.0, toward=TOWARD, channels=3):
    lights = [Directional(direction=d, strength=s[:channels]) for d, s in zip(toward, STRENGTHS, strict=True)]
    images = np.stack([matte_ball_picture(ball, x, (72, 72), ambient=ambient) for x in lights])
    return images + noise * np.random.default_rng(0).normal(size=images.shape)


@cache
def gray_frames():
    """Return pictures of one channel, a quarter of the work, where colours are not the matter."""
    images = frames(channels=1)
    images.flags.writeable = False
    return images


def angles(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1)))


def calibrated(images, ball=BALL, **options):
    return calibrate_matte_balls([BallPictures(stack=MemoryStack(images), ball=ball)], **options)


@pytest.mark.parametrize("pedestal", ["common", "each", 0.1])
def test_directions_strengths_and_level_come_back(pedestal):
    found = calibrated(frames(), pedestal=pedestal)
    assert angles(found.rig.directions, TOWARD).max() < 0.05
    np.testing.assert_allclose(found.rig.strengths(3), STRENGTHS, rtol=1e-3)
    np.testing.assert_allclose(found.ambient, 0.1, rtol=0, atol=5e-4)
    np.testing.assert_allclose(found.background, 0.1, atol=1e-12)
    assert (found.pedestal is None) == (pedestal != "common")
    assert found.quality.residual_brightness < 1e-3


def test_noise_is_in_the_stated_errors_and_an_albedo_is_a_factor():
    found = calibrated(frames(noise=0.02), albedo=0.5)
    errors = np.radians(angles(found.rig.directions, TOWARD))
    assert (errors < 3.5 * found.quality.direction_error).all()
    assert np.degrees(found.quality.direction_error).max() < 0.5
    off = np.sqrt(((0.5 * found.rig.strengths(3) / STRENGTHS - 1) ** 2).mean(axis=1))
    assert (off < 4 * found.quality.strength_error).all()
    assert found.quality.strength_error.max() < 0.01


def test_through_a_pinhole_and_with_a_highlight_and_a_stand():
    """A pinhole sees other normals; what is not matte is outvoted."""
    camera = Pinhole(fx=150.0, fy=150.0, cx=10.0, cy=20.0)
    ball = Ball(seen=[37.0, 36.0, 27.0], camera=camera)
    images = frames(ball, channels=1)
    images[:, 20:24, 40:44] += 0.5
    images[:, 60:, 24:48] = 0.05
    found = calibrated(images, ball)
    assert angles(found.rig.directions, TOWARD).max() < 0.05
    flat = Ball(seen=ball.seen)
    wrong = calibrated(images, flat)
    assert angles(wrong.rig.directions, TOWARD).max() > 2


def test_two_balls_are_averaged_and_their_disagreement_counts():
    images, turned = gray_frames(), TOWARD + np.array([0.02, 0.0, 0.0])
    other = frames(toward=turned / np.linalg.norm(turned, axis=1, keepdims=True), channels=1)
    both = [BallPictures(stack=MemoryStack(x), ball=BALL) for x in (images, other)]
    found = calibrate_matte_balls(both)
    assert np.degrees(found.quality.direction_error).max() > 0.3
    assert 0.2 < angles(found.rig.directions, TOWARD).max() < 0.7


def test_clipped_unlit_and_mirror_like_balls_are_refused():
    images = gray_frames()
    with pytest.raises(InputError, match="are clipped") as caught:
        calibrated(np.rint(255 * np.clip(4 * images, 0, 1)).astype(np.uint8))
    assert "Expose less" in caught.value.remedy
    some = calibrated(np.rint(255 * np.clip(1.6 * frames(ambient=0.0, channels=1) + 26 / 255, 0, 1)).astype(np.uint8))
    assert angles(some.rig.directions, TOWARD).max() < 0.5
    dark = images.copy()
    dark[1] = 0.1
    with pytest.raises(InputError, match="image 2 has a strength of"):
        calibrated(dark)
    rows, columns = np.indices((72, 72))
    spot = 0.02 + (np.hypot(rows - 32, columns - 40) < 3)[None, ..., None] * np.ones((3, 1, 1, 1))
    with pytest.raises(InputError, match=r"strength of|departs from Lambert"):
        calibrated(spot)
    with pytest.raises(InputError, match="covers"):
        calibrated(images, Ball.circle(300, 300, 20))
    checker = np.where((rows // 6 + columns // 6) % 2, 1.0, 0.15)[None, ..., None] * (images - 0.1) + 0.1
    with pytest.raises(InputError, match=r"departs from Lambert's law|has a strength"):
        calibrated(checker)


def test_options_are_checked():
    images = gray_frames()
    for options in ({"albedo": 0.0}, {"albedo": np.nan}, {"pedestal": "none"}, {"pedestal": -0.1}, {"pedestal": 1.0}):
        with pytest.raises(OptionError):
            calibrated(images, **options)
    with pytest.raises(InputError, match="differ in number"):
        calibrate_matte_balls([])


# ---- white cards ---------------------------------------------------------------------------------------------------


def card(rig, normal, camera=None, distance=None):
    shape = (20, 24)
    rows, columns = np.indices(shape, dtype=float)
    if camera is None:
        points = np.stack([columns, -rows, np.zeros(shape)], axis=-1)
    else:
        points = camera.points(np.full(shape, distance))
    return np.stack([0.8 * light.irradiance(points, np.broadcast_to(normal, points.shape)) for light in rig.lights])


def test_a_white_card_gives_strengths_of_directions_and_lamps():
    normal = np.array([0.1, 0.0, 1.0]) / np.hypot(0.1, 1.0)
    true = Rig.distant(TOWARD, STRENGTHS)
    plain = Rig.distant(TOWARD, np.ones((3, 3)))
    found = white_strengths(MemoryStack(card(true, normal)), plain, (3, 2, 20, 15), normal=tuple(normal), albedo=0.8)
    np.testing.assert_allclose(found.rig.strengths(3), STRENGTHS, rtol=1e-10)
    assert found.error.max() < 1e-12
    camera = Pinhole(fx=100.0, fy=100.0, cx=12.0, cy=10.0)
    lamps = Rig(tuple(Led(position=[x, 20, -100], axis=[0, 0, -1], mu=1.0, flux=2e4 + x) for x in (-60.0, 0.0, 60.0)))
    weak = Rig(tuple(Led(position=light.position, axis=light.axis, mu=1.0, flux=1.0) for light in lamps.lights))
    images = card(lamps, np.array([0, 0, 1.0]), camera, 300.0)
    found = white_strengths(MemoryStack(images), weak, (3, 2, 20, 15), albedo=0.8, camera=camera, distance=300.0)
    got = [float(light.flux[0]) for light in found.rig.lights]
    np.testing.assert_allclose(got, [2e4 - 60, 2e4, 2e4 + 60], rtol=1e-6)


def test_cards_that_tell_nothing_are_refused():
    rig = Rig.distant(TOWARD, np.ones((3, 1)))
    images = card(rig, np.array([0, 0, 1.0]))
    for box, stack, lights in (
        ((0, 0, 100, 5), MemoryStack(images), rig),
        ((0, 0, 1, 1), MemoryStack(images), rig),
        ((0, 0, 9, 9), MemoryStack(images[:2]), rig),
        ((0, 0, 9, 9), MemoryStack(0 * images), rig),
        ((0, 0, 9, 9), MemoryStack(np.full((3, 20, 24), 255, np.uint8)), rig),
        ((0, 0, 9, 9), MemoryStack(images), Rig.distant([[1, 0, 0.05]] * 3)),
    ):
        with pytest.raises(InputError) as caught:
            white_strengths(stack, lights, box)
        assert caught.value.remedy
    sun = Rig((Sun(direction=[0, 0, 1], radiance=1.0, angular_radius=0.01),) * 3)
    with pytest.raises(InputError, match="kind sun"):
        white_strengths(MemoryStack(images), sun, (0, 0, 9, 9), camera=Orthographic())
