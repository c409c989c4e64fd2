"""Highlights on mirror balls against Fermat's principle and closed forms; the adjustment against its statistics."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.calibrate.balls import Reach, triangulate_lamps
from psstereo.calibrate.balls.adjustment import adjust, tangents
from psstereo.calibrate.balls.ball import Ball, inside, outline_points
from psstereo.calibrate.balls.mirror_ball import mirrored_pixels, reflected_rays
from psstereo.calibrate.viewing import Homogeneous, pixel_rays, project
from psstereo.camera import Orthographic, Pinhole
from psstereo.errors import InputError

PINHOLE = Pinhole(fx=900.0, fy=950.0, cx=320.0, cy=240.0, skew=3.0)


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def homogeneous(positions, origin):
    arm = positions - origin
    distance = np.linalg.norm(arm, axis=-1)
    return Homogeneous(origin, arm / distance[..., None], 1 / distance)


def directions(count, seed, lowest=-0.5):
    rng = np.random.default_rng(seed)
    u = rng.normal(size=(20 * count, 3))
    u = unit(u)
    return u[u[:, 2] > lowest][:count]


def test_parallel_rays_and_a_distant_lamp_in_closed_form():
    """The normal halves the angle between eye and lamp, and the light comes along 2 n_z n − v."""
    ball, u = Ball.circle(110.3, 95.7, 60.0), directions(200, 1)
    v = np.array([0.0, 0.0, 1.0])
    normal = unit(u + v)
    want = np.array([110.3, 95.7]) + 60.0 * normal[:, :2] * [1, -1]
    lamps = Homogeneous(ball.sphere[0], u, np.zeros(len(u)))
    got = mirrored_pixels(ball.camera, ball.sphere[0], np.array(60.0), lamps)
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-11)
    _, rays = reflected_rays(ball.camera, *ball.sphere, want)
    np.testing.assert_allclose(rays, u, rtol=0, atol=1e-6)
    np.testing.assert_allclose(rays, 2 * normal[:, 2:] * normal - v, rtol=0, atol=1e-12)
    assert np.degrees(np.arccos((normal * u).sum(axis=1)).max()) > 45  # the ball's normal itself would be far off


@pytest.mark.parametrize("camera", [Orthographic(pixel_size=0.3), PINHOLE], ids=["parallel", "pinhole"])
def test_the_way_by_the_highlight_is_the_shortest(camera):
    """Fermat: from lamp over the ball to the eye, no neighbouring way is shorter; a search by length, not by angles."""
    from scipy.optimize import minimize

    ball = Ball(seen=[400.0, 180.0, 80.0], camera=camera, radius=2.0)
    centre, radius = ball.sphere
    eye = np.zeros(3) if camera is PINHOLE else None
    for u, distance in zip(directions(3, 2, lowest=0.0), (1.5, 4, 1000), strict=True):
        lamp = centre + distance * radius * u

        def length(angles, lamp=lamp):
            a, b = angles
            p = centre + radius * np.array([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)])
            to_eye = -p[2] if eye is None else np.linalg.norm(p - eye)
            return np.linalg.norm(p - lamp) + to_eye

        start = unit(u + unit(-centre if eye is not None else np.array([0, 0, 1.0])))
        found = minimize(
            length, [np.arccos(start[2]), np.arctan2(start[1], start[0])], method="Nelder-Mead",
            options={"xatol": 1e-8, "fatol": 1e-15, "maxiter": 300},
        )  # fmt: skip
        a, b = found.x
        want = centre + radius * np.array([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)])
        got = mirrored_pixels(camera, centre, np.array(radius), homogeneous(lamp, centre))
        np.testing.assert_allclose(got, project(camera, want), rtol=0, atol=1e-4)


@settings(max_examples=8)
@given(
    seed=st.integers(0, 10**6),
    near=st.floats(1.05, 1e4),
    pinhole=st.booleans(),
)
def test_there_and_back(seed, near, pinhole):
    camera = PINHOLE if pinhole else Orthographic(pixel_size=0.7)
    ball = Ball(seen=[300.0, 260.0, 120.0], camera=camera, radius=3.0)
    centre, radius = ball.sphere
    u = directions(20, seed)
    for inverse in (0.0, 1 / (near * radius), -1e-4 / radius):
        lamps = Homogeneous(centre, u, np.full(len(u), inverse))
        pixels = mirrored_pixels(camera, centre, np.array(radius), lamps)
        points, rays = reflected_rays(camera, centre, radius, pixels)
        shown = np.isfinite(pixels[:, 0])
        assert shown[u[:, 2] > 0.5].all()
        np.testing.assert_allclose(rays[shown], unit(lamps.seen_from(points))[shown], rtol=0, atol=1e-6)


def test_what_a_ball_cannot_show_is_nan():
    ball = Ball.circle(50, 50, 20)
    centre, radius = ball.sphere
    inner = homogeneous(centre + np.array([[0.0, 0.0, 10.0]]), centre)
    assert np.isnan(mirrored_pixels(ball.camera, centre, np.array(radius), inner)).all()
    behind = Homogeneous(centre, np.array([[0.0, 0.0, -1.0]]), np.zeros(1))
    assert np.isnan(mirrored_pixels(ball.camera, centre, np.array(radius), behind)).all()
    facing = Homogeneous(centre, np.array([[0.0, 0.0, 1.0]]), np.zeros(1))
    np.testing.assert_array_equal(mirrored_pixels(ball.camera, centre, np.array(radius), facing), [[50.0, 50.0]])
    points, rays = reflected_rays(ball.camera, centre, radius, np.array([75.0, 50.0]))
    assert np.isnan(points).all()
    assert np.isnan(rays).all()


def test_rays_and_pixels_undo_each_other():
    pixels = np.random.default_rng(0).uniform(0, 600, (50, 2))
    for camera in (PINHOLE, Orthographic(pixel_size=0.2)):
        origins, rays = pixel_rays(camera, pixels)
        np.testing.assert_allclose(project(camera, origins + 7.0 * rays), pixels, rtol=0, atol=1e-9)
    assert np.isnan(project(PINHOLE, np.array([0.0, 0.0, 1.0]))).all()


def test_the_outline_of_a_ball_touches_it():
    """Rays of the outline meet the sphere in one point; those of a smaller one in two."""
    for camera in (PINHOLE, Orthographic(pixel_size=0.2)):
        ball = Ball(seen=[400.0, 100.0, 90.0], camera=camera, radius=2.5)
        centre, radius = ball.sphere
        origins, rays = pixel_rays(camera, outline_points(ball, np.linspace(0, 6, 40)))
        arm = centre - origins
        off = np.linalg.norm(arm - (arm * rays).sum(axis=1, keepdims=True) * rays, axis=1)
        np.testing.assert_allclose(off, radius, rtol=1e-12)
        assert inside(ball, (300, 600)).sum() == pytest.approx(np.pi * 90**2, rel=0.1 if camera is PINHOLE else 0.002)


@pytest.mark.parametrize(
    "bad",
    [
        {"seen": [1.0, 2.0, 0.0]},
        {"seen": [1.0, np.nan, 3.0]},
        {"seen": [1.0, 2.0]},
        {"seen": [1.0, 2.0, 3.0], "radius": -1.0},
        {"seen": [1.0, 2.0, 3.0], "covariance": -np.eye(3)},
        {"seen": [1.0, 2.0, 3.0], "covariance": np.eye(2)},
        {"seen": [1.0, 2.0, 3.0], "covariance": [[1.0, 0.5, 0], [0, 1, 0], [0, 0, 1]]},
        {"seen": [320.0, 240.0, 930.0], "camera": PINHOLE},
    ],
)
def test_balls_that_are_none_are_refused(bad):
    with pytest.raises(InputError) as caught:
        Ball(**bad)
    assert caught.value.remedy


# ---- adjustment ----------------------------------------------------------------------------------------------------


def pictured(balls, positions, sigma, rng):
    """Return noisy highlights (m, k, 2) of lamps, and their covariance."""
    columns = [
        mirrored_pixels(b.camera, b.sphere[0], np.array(b.sphere[1]), homogeneous(positions, b.sphere[0]))
        for b in balls
    ]
    exact = np.stack(columns, axis=1)
    return exact + sigma * rng.normal(size=exact.shape), np.full((*exact.shape, 2), sigma**2) * np.eye(2)


def pair(sigma, camera=None, apart=600.0):
    camera = camera or Orthographic()
    at = np.array([[200.0, 210.0, 100.0], [200.0 + apart, 220.0, 95.0]])
    return tuple(Ball(seen=one, covariance=np.eye(3) * sigma**2, camera=camera, radius=100.0) for one in at)


def test_positions_scatter_as_predicted_over_a_hundred_draws():
    """χ² of 100 lamps at one place, each with highlights of its own noise; mean 3, standard error 0.245."""
    balls = pair(1e-5)
    place = np.array([900.0, 700.0, 2400.0])
    rng = np.random.default_rng(3)
    pixels, covariance = pictured(balls, np.tile(place, (100, 1)), 0.05, rng)
    found = triangulate_lamps(balls, pixels, covariance)
    assert found.reach is Reach.NEAR
    error = found.positions - place
    square = np.einsum("mi,mij,mj->m", error, np.linalg.inv(found.covariance), error)
    assert square.mean() == pytest.approx(3.0, abs=4 * np.sqrt(6 / 100))
    assert np.quantile(square, 0.5) == pytest.approx(2.366, abs=0.7)
    # The weak direction is the way to the lamp.
    toward = unit(place - found.middle)
    assert np.abs(found.weakest @ toward).min() > 0.99
    assert (
        found.weakest_error > 5 * np.sqrt(np.trace(found.covariance, axis1=1, axis2=2) - found.weakest_error**2)
    ).all()
    assert found.enlarged < 1.3


def test_errors_of_outlines_are_in_the_predicted_covariance():
    """Draws of outlines and highlights together: one lamp each, since an outline's error is shared by all lamps."""
    rng = np.random.default_rng(4)
    place = np.array([[-500.0, 900.0, 2000.0], [700.0, -200.0, 1800.0], [300.0, 800.0, 2200.0]])
    true = pair(0.1)
    squares, fits = [], []
    for _ in range(16):
        pixels, covariance = pictured(true, place, 0.05, rng)
        shaken = tuple(
            Ball(seen=one.seen + 0.1 * rng.normal(size=3), covariance=one.covariance, radius=100.0) for one in true
        )
        done = adjust(shaken, pixels, covariance, near=True)
        lamps = done.lamps
        position = lamps.origin + lamps.direction / lamps.inverse[:, None]
        first, second = tangents(lamps.direction)
        q = lamps.inverse[:, None]
        slopes = np.stack([first / q, second / q, -lamps.direction / q**2], axis=-1)
        spread = slopes @ done.covariance @ np.swapaxes(slopes, 1, 2)
        error = (position - place)[0]
        squares.append(error @ np.linalg.solve(spread[0], error))
        fits.append(done.chi_square / done.freedom)
    assert np.mean(squares) == pytest.approx(3.0, abs=3.5 * np.sqrt(6 / 16))
    assert np.mean(fits) == pytest.approx(1.0, abs=3.5 * np.sqrt(2 / 3 / 16))


def test_exact_highlights_give_exact_lamps_through_a_pinhole():
    camera = Pinhole(fx=2000.0, fy=2000.0, cx=500.0, cy=250.0)
    balls = pair(0.01, camera)
    middle = np.mean([b.sphere[0] for b in balls], axis=0)
    place = middle + np.array(
        [[600.0, 500.0, 1500.0], [-900.0, 0.0, 1200.0], [0.0, 100.0, 2500.0], [50.0, -800.0, 900.0]]
    )
    pixels, covariance = pictured(balls, place, 0.0, np.random.default_rng(0))
    found = triangulate_lamps(balls, pixels, covariance + 1e-4 * np.eye(2))
    assert found.reach is Reach.NEAR
    np.testing.assert_allclose(found.positions, place, rtol=0, atol=1e-4)
    assert found.residual < 1e-8


def test_distant_lamps_are_told_where_the_balls_can_and_untold_where_not():
    rng = np.random.default_rng(7)
    far = 1e7 * directions(12, 5, lowest=0.3)
    sharp = pair(0.002)
    pixels, covariance = pictured(sharp, far, 0.002, rng)
    found = triangulate_lamps(sharp, pixels, covariance)
    assert found.reach is Reach.DISTANT
    assert found.least_distance > 50 * found.spread
    assert found.probability > 0.01
    np.testing.assert_allclose(found.directions, unit(far), rtol=0, atol=1e-3)
    blurred = pair(0.5)
    pixels, covariance = pictured(blurred, far, 0.5, rng)
    untold = triangulate_lamps(blurred, pixels, covariance)
    assert untold.reach is Reach.UNTOLD
    assert untold.positions is None
    assert 1 < untold.least_distance / untold.spread < 50
    # 2 px on a radius of 100 px are about a degree; the stated error must cover the real one.
    error = np.linalg.norm(untold.directions - unit(far), axis=1)
    assert np.sqrt((error**2).mean()) < 2 * np.sqrt((untold.direction_error**2).mean())
    assert np.sqrt((error**2).mean()) > 0.3 * np.sqrt((untold.direction_error**2).mean())


def test_disagreement_that_no_lamp_explains_enlarges_the_errors():
    balls = pair(0.01)
    place = 2500 * directions(8, 5, lowest=0.4)
    pixels, covariance = pictured(balls, place, 0.05, np.random.default_rng(1))
    plain = triangulate_lamps(balls, pixels, covariance)
    pixels[:, 0, 1] += np.random.default_rng(2).normal(0, 2.0, 8)  # across the plane of balls and lamps
    odd = triangulate_lamps(balls, pixels, covariance)
    assert odd.enlarged > 5 > plain.enlarged
    assert (odd.direction_error > 3 * plain.direction_error).all()


def test_one_ball_and_balls_that_share_no_lamp_tell_directions_only():
    balls, u = pair(0.05), directions(6, 9, lowest=0.2)
    pixels, covariance = pictured(balls, 1e8 * u, 0.0, np.random.default_rng(0))
    alone = triangulate_lamps(balls[:1], pixels[:, :1], covariance[:, :1] + 1e-4 * np.eye(2))
    assert alone.reach is Reach.UNTOLD
    assert alone.probability is None
    np.testing.assert_allclose(alone.directions, u, rtol=0, atol=1e-5)
    pixels[:3, 0] = np.nan
    pixels[3:, 1] = np.nan
    parted = triangulate_lamps(balls, pixels, covariance + 1e-4 * np.eye(2))
    assert parted.reach is Reach.UNTOLD
    np.testing.assert_allclose(parted.directions, u, rtol=0, atol=2e-5)


def test_the_error_of_a_direction_is_two_pixels_over_the_radius():
    """At the middle of a ball l turns by 2 dN = 2 px / R, for each of two directions."""
    ball = Ball(seen=[100.0, 100.0, 50.0], covariance=1e-12 * np.eye(3))
    found = triangulate_lamps((ball,), np.array([[[100.0, 100.0]]]), np.full((1, 1, 2, 2), 0.01) * np.eye(2))
    assert found.direction_error[0] == pytest.approx(2 * 0.1 / 50 * np.sqrt(2), rel=1e-3)
