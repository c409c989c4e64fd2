"""Outlines of balls: from clicks, masks and edges, in circles and in the ellipses of a pinhole."""

import numpy as np
import pytest

from psstereo.calibrate.balls import ball_from_mask, ball_from_points, find_balls, refine_outline
from psstereo.calibrate.balls.ball import Ball, inside, outline_points
from psstereo.calibrate.balls.pictures import BallPictures, require_still
from psstereo.camera import Pinhole
from psstereo.errors import InputError
from psstereo.lights import Directional
from psstereo.stack import MemoryStack
from psstereo_synth.calibration_balls import matte_ball_picture

SHAPE = (130, 150)
PINHOLE = Pinhole(fx=260.0, fy=250.0, cx=60.0, cy=70.0)


def room_light(ball):
    """Picture a ball under light from all around, so that its rim is bright."""
    around = [[1, 0.1, 0.2], [-1, 0.9, 0.2], [-0.3, -1, 0.3]]
    return sum(matte_ball_picture(ball, Directional(direction=d, strength=0.5), SHAPE)[..., 0] for d in around) + 0.05


@pytest.fixture(scope="module")
def ball():
    return Ball.circle(76.3, 63.6, 44.4)


@pytest.fixture(scope="module")
def picture(ball):
    return room_light(ball)


def test_three_clicks_make_a_circle():
    found = ball_from_points([[10.0, 20.0], [30.0, 20.0], [20.0, 30.0]])
    np.testing.assert_allclose(found.seen, [20.0, 20.0, 10.0], rtol=0, atol=1e-10)
    # Three points of one standard error, by hand: four equal pulls would give 1/4 each.
    assert 0.2 < found.covariance[0, 0] < 2.0


def test_points_of_a_pinholes_ellipse_make_the_ball():
    """The ball's centre is not the middle of the ellipse, nor the ellipse a circle."""
    true = Ball(seen=[130.0, 75.0, 40.0], camera=PINHOLE, radius=3.0)
    points = outline_points(true, np.linspace(0, 6.2, 60))
    found = ball_from_points(points, PINHOLE, radius=3.0)
    np.testing.assert_allclose(found.seen, true.seen, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.sphere[0], true.sphere[0], rtol=1e-10)
    middle = (points.max(axis=0) + points.min(axis=0)) / 2
    assert abs(middle[0] - 130.0) > 0.5


def test_points_off_the_outline_are_outvoted():
    rng = np.random.default_rng(0)
    points = outline_points(Ball.circle(100, 80, 50), np.linspace(0, 6.28, 100)) + rng.normal(0, 0.1, (100, 2))
    points[:20] += [0.0, 8.0]  # a stand
    found = ball_from_points(points)
    np.testing.assert_allclose(found.seen, [100, 80, 50], rtol=0, atol=0.15)
    assert (np.abs(found.seen - [100, 80, 50]) < 4 * np.sqrt(np.diag(found.covariance))).all()


@pytest.mark.parametrize(
    "bad",
    [
        [[1.0, 2.0], [3.0, 4.0]],
        [[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]],
        [[5.0, 5.0]] * 4,
        [[1.0, np.nan], [2.0, 5.0], [3.0, 3.0]],
        [[1.0, 2.0, 3.0]] * 3,
    ],
)
@pytest.mark.parametrize("camera", [None, PINHOLE], ids=["parallel", "pinhole"])
def test_points_that_make_no_ball_are_refused(bad, camera):
    with pytest.raises(InputError) as caught:
        ball_from_points(np.array(bad), camera)
    assert caught.value.remedy


def test_a_mask_gives_the_ball_to_a_tenth_of_a_pixel(ball):
    mask = inside(ball, SHAPE)
    found = ball_from_mask(mask)
    np.testing.assert_allclose(found.seen, ball.seen, rtol=0, atol=0.1)
    with pytest.raises(InputError, match="is empty"):
        ball_from_mask(np.zeros((20, 20), bool))
    square = np.zeros((60, 90), bool)
    square[10:50, 5:85] = True
    with pytest.raises(InputError, match="off the best circle"):
        ball_from_mask(square)


@pytest.mark.parametrize("camera", [None, PINHOLE], ids=["parallel", "pinhole"])
def test_edges_refine_a_rough_outline(camera):
    true = Ball(seen=[76.0, 65.0, 42.0], camera=camera) if camera else Ball.circle(76.0, 65.0, 42.0)
    image = room_light(true)
    rough = Ball(seen=true.seen + np.array([2.0, -1.5, 2.0]), camera=true.camera)
    found = refine_outline(image, rough)
    np.testing.assert_allclose(found.seen, true.seen, rtol=0, atol=0.2)


def test_balls_are_found_and_what_is_none_is_not(ball, picture):
    found = find_balls(picture)[0]
    np.testing.assert_allclose(found.seen, ball.seen, rtol=0, atol=0.5)
    rng = np.random.default_rng(1)
    rows, columns = np.indices(SHAPE)
    for nothing in (rng.normal(0.5, 0.1, SHAPE), ((rows // 20 + columns // 25) % 2).astype(float)):
        with pytest.raises(InputError, match="0 balls were found") as caught:
            find_balls(nothing)
        assert "x,y,r" in caught.value.remedy
    with pytest.raises(InputError, match="2 are looked for"):
        find_balls(picture, 2)


def test_an_outline_that_is_not_seen_is_refused(picture):
    with pytest.raises(InputError, match="show an edge"):
        refine_outline(np.full(SHAPE, 0.3), Ball.circle(76, 63, 44))
    with pytest.raises(InputError, match="show an edge"):
        refine_outline(picture, Ball.circle(60, 50, 20))


def test_a_ball_that_moved_is_named(ball, picture):
    rng = np.random.default_rng(2)
    frames = np.stack([picture * scale for scale in (1.0, 0.8, 0.9, 0.7, 1.0)])
    frames += rng.normal(0, 0.004, frames.shape)
    still = BallPictures(stack=MemoryStack(frames), ball=ball)
    assert "same place in 5 pictures" in require_still(still)
    frames[3] = np.roll(frames[3], 3, axis=1)
    moved = BallPictures(stack=MemoryStack(frames, names=("a", "b", "c", "d.png", "e")), ball=ball)
    with pytest.raises(InputError, match=r"In d\.png the ball's outline is \+3\.0 px to the right") as caught:
        require_still(moved)
    assert "Leave that picture out" in caught.value.remedy
    dark = BallPictures(stack=MemoryStack(0 * frames), ball=ball)
    assert "too few to tell" in require_still(dark)


def test_cut_out_pictures_and_dark_ones(ball):
    camera = Pinhole(fx=900.0, fy=900.0, cx=300.0, cy=200.0)
    whole = Ball(seen=[300.0, 250.0, 40.0], camera=camera)
    frames = np.full((2, 30, 40, 1), 0.5)
    cut = BallPictures(stack=MemoryStack(frames), ball=whole, corner=(100.0, 50.0), dark=np.full((30, 40, 1), 0.2))
    np.testing.assert_allclose(cut.local.sphere[0], whole.sphere[0], rtol=1e-12)
    np.testing.assert_array_equal(cut.local.seen, [200.0, 200.0, 40.0])
    np.testing.assert_allclose(cut.gray(1), 0.3)
    with pytest.raises(InputError, match="dark image has the shape"):
        BallPictures(stack=MemoryStack(frames), ball=ball, dark=np.zeros((3, 4, 1)))
