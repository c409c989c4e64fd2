"""Rendered mirror balls to lights; highlights that cannot be used, each with its reason."""

import numpy as np
import pytest

from psstereo.calibrate.balls import Ball, BallPictures, Reach, calibrate_mirror_balls, find_highlight
from psstereo.calibrate.balls.mirror_ball import mirrored_pixels
from psstereo.calibrate.viewing import Homogeneous
from psstereo.camera import Orthographic, Pinhole
from psstereo.errors import InputError
from psstereo.lights import Directional, Led
from psstereo.stack import MemoryStack
from psstereo_synth.calibration_balls import mirror_ball_picture

TOWARD = np.array([[0.1, 0.2, 1.0], [0.8, 0.2, 0.7], [-0.5, 0.9, 0.2], [-0.7, -0.6, 0.9]])
TOWARD /= np.linalg.norm(TOWARD, axis=1, keepdims=True)


def angles(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1)))


def pictures(ball, shape, size=0.03, samples=9, surroundings=0.02):
    lights = [Directional(direction=d, strength=1.0) for d in TOWARD]
    return np.stack(
        [mirror_ball_picture(ball, x, shape, size=size, samples=samples, surroundings=surroundings) for x in lights]
    )


@pytest.mark.parametrize(
    "camera", [Orthographic(), Pinhole(fx=1200.0, fy=1200.0, cx=20.0, cy=40.0)], ids=["parallel", "pinhole"]
)
def test_a_ball_of_200_pixels_gives_lights_to_a_twentieth_of_a_degree(camera):
    """100 px radius; 8 bits. At 100 px a pixel is 1.15° at the middle, so that this is a twentieth of a pixel."""
    ball = Ball(seen=[104.3, 103.6, 100.0], camera=camera, covariance=1e-4 * np.eye(3))
    values = np.rint(240 * pictures(ball, (208, 210), samples=7)).astype(np.uint8)
    found = calibrate_mirror_balls([BallPictures(stack=MemoryStack(values), ball=ball)])
    errors = angles(found.rig.directions, TOWARD)
    assert errors.max() < 0.05
    assert found.lamps.reach is Reach.UNTOLD
    assert "one ball" in found.quality.verdict
    assert (np.radians(errors) < 2 * found.quality.direction_error).all()


def test_a_wide_lamp_near_the_rim_is_not_pulled_inward():
    """The mean of pixels is, by far more than a pixel; the mean of what they mirror is not."""
    ball = Ball.circle(60.0, 60.0, 55.0)
    toward = np.array([0.97, 0.0, 0.1])
    toward /= np.linalg.norm(toward)
    image = mirror_ball_picture(ball, Directional(direction=toward, strength=1.0), (120, 120), size=0.12)
    found = find_highlight(image, ball, white=1.0)
    want = mirrored_pixels(
        ball.camera, ball.sphere[0], np.array(55.0), Homogeneous(ball.sphere[0], toward, np.zeros(()))
    )
    rows, columns = np.indices(image.shape)
    plain = np.array([(columns * image).sum(), (rows * image).sum()]) / image.sum()
    assert np.hypot(*(found.pixel - want)) < 0.1
    assert np.hypot(*(plain - want)) > 1.2 * np.hypot(*(found.pixel - want))


def test_two_balls_see_a_near_lamp_where_it_is():
    camera = Orthographic()
    balls = [Ball.circle(62.0, 61.0, 56.0, sigma=0.02), Ball.circle(562.0, 61.5, 56.0, sigma=0.02)]
    places = np.array([[300.0, 500.0, 1100.0], [900.0, -300.0, 900.0], [-200.0, 100.0, 1300.0]])
    views = []
    for ball, corner in zip(balls, ((0.0, 0.0), (500.0, 0.0)), strict=True):
        local = BallPictures(stack=MemoryStack(np.zeros((1, 2, 2))), ball=ball, corner=corner).local
        shift = np.array([*corner, 0.0]) * [1, -1, 1]
        frames = [
            mirror_ball_picture(
                local, Led(position=p - shift, axis=[0, 0, -1], mu=0.0, flux=1.0), (124, 124), size=0.04, samples=6
            )
            for p in places
        ]
        views.append(BallPictures(stack=MemoryStack(np.stack(frames)), ball=ball, corner=corner))
    found = calibrate_mirror_balls(views, strengths=[1.0, 2.0, 3.0])
    assert found.camera == camera
    assert found.lamps.reach is Reach.NEAR
    got = np.array([light.position for light in found.rig.lights])
    error = got - places
    spread = np.sqrt(np.trace(found.quality.position_covariance, axis1=1, axis2=2))
    assert (np.linalg.norm(error, axis=1) < 2.5 * spread).all()
    assert np.linalg.norm(error, axis=1).max() < 60
    # In the middle of the balls the lamps are as strong as was said.
    for light, strength in zip(found.rig.lights, (1.0, 2.0, 3.0), strict=True):
        facing = light.directions(found.lamps.middle)
        np.testing.assert_allclose(light.irradiance(found.lamps.middle, facing), strength, rtol=1e-10)
    held = calibrate_mirror_balls(views, reach=Reach.DISTANT)
    assert held.rig.all_distant
    with pytest.raises(InputError, match="seen in one ball only"):
        calibrate_mirror_balls(views[:1], reach=Reach.NEAR)


# ---- what cannot be used -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def ball():
    return Ball.circle(50.0, 50.0, 45.0)


@pytest.fixture(scope="module")
def image(ball):
    return mirror_ball_picture(ball, Directional(direction=TOWARD[0], strength=1.0), (100, 100), size=0.1)


def refused(image, ball, cause, white=1.0):
    with pytest.raises(InputError, match=cause) as caught:
        find_highlight(image, ball, white=white, name="x.png")
    assert "x.png" in caught.value.given
    assert caught.value.remedy
    return caught.value


def test_no_highlight(ball):
    refused(np.zeros((100, 100)), ball, "nothing is brighter")
    noise = np.random.default_rng(0).normal(0.1, 0.01, (100, 100))
    refused(noise, ball, "nothing is brighter")


def test_no_ball_where_the_circle_is(image):
    assert "top" in refused(image, Ball.circle(500, 500, 45), "covers 0 pixels").remedy
    refused(image, Ball.circle(10, 10, 2), "covers")


def test_two_highlights(ball, image):
    other = mirror_ball_picture(ball, Directional(direction=TOWARD[1], strength=1.0), (100, 100), size=0.09)
    assert "Switch other lamps off" in refused(image + other, ball, "shows two highlights").remedy
    weak = find_highlight(image + 0.1 * other, ball, white=1.0)
    np.testing.assert_allclose(weak.pixel, find_highlight(image, ball, white=1.0).pixel, rtol=0, atol=0.1)


def test_a_matte_ball_is_no_mirror(ball):
    from psstereo_synth.calibration_balls import matte_ball_picture

    matte = matte_ball_picture(ball, Directional(direction=TOWARD[1], strength=0.8), (100, 100))[..., 0]
    assert "calibrate matte" in refused(matte, ball, "bright patch|nothing is brighter").remedy


def test_a_clipped_highlight_is_said_and_its_error_grows(ball):
    light = Directional(direction=TOWARD[1], strength=1.0)
    rows, columns = np.indices((100, 100))
    clean = mirror_ball_picture(ball, light, (100, 100), size=0.05)
    at = find_highlight(clean, ball, white=1.0).pixel
    flare = np.exp(-np.hypot(columns - at[0], rows - at[1]) / 4) * (columns > at[0])
    bright = np.clip(30 * clean + 2 * flare, 0, 1)
    sharp, blown = find_highlight(0.9 * clean, ball, white=1.0), find_highlight(bright, ball, white=1.0)
    assert sharp.clipped == 0
    assert blown.clipped > 12
    error = np.hypot(*(blown.pixel - at))
    assert error > 1
    assert np.sqrt(blown.covariance[0, 0]) > 0.25 * error
    assert np.sqrt(blown.covariance[0, 0]) > 5 * np.sqrt(sharp.covariance[0, 0])
    values = np.rint(255 * np.stack([bright, bright])).astype(np.uint8)
    found = calibrate_mirror_balls([BallPictures(stack=MemoryStack(values), ball=ball)])
    assert any("clipped" in line for line in found.quality.advice)


def test_a_small_ball_is_named_with_its_error(ball):
    small = Ball.circle(20.0, 20.0, 15.0, sigma=0.4)
    frames = pictures(small, (40, 40), size=0.2, samples=4)
    found = calibrate_mirror_balls([BallPictures(stack=MemoryStack(frames), ball=small)])
    line = next(line for line in found.quality.advice if line.startswith("Ball too small"))
    assert "15 px" in line
    assert np.degrees(found.quality.direction_error.min()) > 1


def test_what_one_ball_does_not_show_another_may(ball, image):
    frames = np.stack([image, image, image])
    dark = frames.copy()
    dark[1] = 0
    aside = BallPictures(stack=MemoryStack(dark), ball=ball.moved(300.0, 0.0), corner=(300.0, 0.0))
    both = [BallPictures(stack=MemoryStack(frames), ball=ball), aside]
    found = calibrate_mirror_balls(both)
    assert found.highlights[1][1] is None
    assert any("left out of picture 2" in note for note in found.notes)
    with pytest.raises(InputError, match="nothing is brighter"):
        calibrate_mirror_balls(both[1:])
    with pytest.raises(InputError, match="Balls 1 and 2 are 0 px apart"):
        calibrate_mirror_balls([both[0], both[0]])
    with pytest.raises(InputError, match="2 balls with 3, 1 pictures"):
        calibrate_mirror_balls([both[0], BallPictures(stack=MemoryStack(frames[:1]), ball=ball)])
    with pytest.raises(InputError, match="no pictures"):
        calibrate_mirror_balls([])
    other = Ball(seen=ball.seen, camera=Orthographic(pixel_size=2.0))
    with pytest.raises(InputError, match="different cameras"):
        calibrate_mirror_balls([both[0], BallPictures(stack=MemoryStack(frames), ball=other)])


def test_a_ball_that_moved_far_is_found_where_it_went():
    """By a quarter of its radius, more than an outline is followed, before a dark wall."""
    shape, places = (110, 130), [(55.0, 55.0)] * 4 + [(65.0, 55.0)]
    lights = [Directional(direction=d, strength=1.0) for d in (*TOWARD, TOWARD[0])]
    frames = []
    for (x, y), light in zip(places, lights, strict=True):
        seen = Ball.circle(x, y, 40.0)
        frames.append(mirror_ball_picture(seen, light, shape, size=0.06, samples=3, surroundings=0.3))
    stack = MemoryStack(np.stack(frames))
    with pytest.raises(InputError, match=r"\+(9|10)\.\d px to the right"):
        calibrate_mirror_balls([BallPictures(stack=stack, ball=Ball.circle(55.0, 55.0, 40.0))])
