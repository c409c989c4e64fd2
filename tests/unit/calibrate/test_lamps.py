import math

import numpy as np
import pytest

from psstereo.calibrate.lamps import (
    Chessboard,
    PlaneSamples,
    board_pose,
    board_samples,
    calibrate_lamp,
    calibrate_lamps,
    joined,
)
from psstereo.camera import Pinhole
from psstereo.errors import InputError
from psstereo.lights import Led, Rig

RHO = 0.25


def turned(about_x, about_y):
    cx, sx, cy, sy = math.cos(about_x), math.sin(about_x), math.cos(about_y), math.sin(about_y)
    return np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]]) @ np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])


POSES = [
    (turned(0.0, 0.0), -600.0),
    (turned(0.4, 0.1), -550.0),
    (turned(-0.3, 0.35), -700.0),
    (turned(0.1, -0.45), -500.0),
]


def plane(lamp, *, noise=0.0, seed=0, count=14, half=220.0):
    """Return what the forward model says of a plane in four poses, in units of the brightest place."""
    across = np.linspace(-half, half, count)
    grid = np.stack([*np.meshgrid(across, across), np.zeros((count, count))], axis=-1).reshape(-1, 3)
    points = np.concatenate([grid @ r.T + [0, 0, z] for r, z in POSES])
    normals = np.concatenate([np.broadcast_to(r[:, 2], grid.shape) for r, _ in POSES])
    values = RHO * lamp.irradiance(points, normals)
    noisy = values + np.random.default_rng(seed).normal(0, 1, values.shape) * noise * values.max()
    cell = np.arange(count * count) // count // 4 * 4 + np.arange(count * count) % count // 4
    groups = np.concatenate([100 * k + cell for k in range(len(POSES))])
    return PlaneSamples(points=points, normals=normals, values=noisy, groups=groups)


def degrees_between(a, b):
    return math.degrees(math.atan2(np.linalg.norm(np.cross(a, b)), a @ b))


@pytest.mark.parametrize(
    ("mu", "axis"), [(0.0, (0, 0, -1)), (1.0, (0.1, -0.2, -1)), (0.5, (0, 0, -1)), (6.0, (-0.25, 0.05, -1))]
)
def test_clean_planes_give_the_lamp_back(mu, axis):
    lamp = Led(
        position=np.array([150.0, 60.0, 30.0]), axis=np.array(axis, float), mu=mu, flux=np.array([3e4, 2e4, 1e4])
    )
    found = calibrate_lamp(plane(lamp), lamp.position, brdf=RHO)
    assert found.lamp.mu == pytest.approx(mu, abs=2e-3)
    np.testing.assert_allclose(found.lamp.flux, lamp.flux, rtol=1e-3)
    if mu > 0:
        assert degrees_between(found.lamp.axis, lamp.axis) < 0.05
    assert found.residual < 1e-3


def test_mu_and_flux_to_a_percent_with_noise_and_errors_that_fit():
    """Noise of 0.2 % of the brightest place, as of a few pixels averaged; predicted errors are those that are made."""
    lamp = Led(position=np.array([150.0, 60.0, 30.0]), axis=np.array([0.1, -0.2, -1.0]), mu=1.2, flux=np.array([3e4]))
    off = []
    for seed in range(8):
        found = calibrate_lamp(plane(lamp, noise=0.002, seed=seed), lamp.position, brdf=RHO)
        turn = math.radians(degrees_between(found.lamp.axis, lamp.axis))
        off.append(
            (
                (found.lamp.mu - 1.2) / found.mu_error,
                (found.lamp.flux[0] / 3e4 - 1) / found.flux_error[0],
                turn / found.axis_error,
            )
        )
        assert found.lamp.mu == pytest.approx(1.2, rel=0.02)
        assert found.lamp.flux[0] == pytest.approx(3e4, rel=0.01)
    spread = np.sqrt((np.array(off) ** 2).mean(axis=0))
    assert ((spread > 0.4) & (spread < 1.7)).all(), spread


def test_gloss_and_dirt_are_left_out():
    lamp = Led(position=np.array([150.0, 60.0, 30.0]), axis=np.array([0.1, -0.2, -1.0]), mu=1.2, flux=np.array([3e4]))
    clean = plane(lamp, noise=0.002)
    values = clean.values.copy()
    values[::17] *= 2.5
    values[5::23] *= 0.2
    spoilt = PlaneSamples(points=clean.points, normals=clean.normals, values=values, groups=clean.groups)
    found = calibrate_lamp(spoilt, lamp.position, brdf=RHO)
    assert found.lamp.mu == pytest.approx(1.2, abs=0.02)
    assert found.lamp.flux[0] == pytest.approx(3e4, rel=0.01)


def test_a_position_that_is_off_is_refined():
    lamp = Led(position=np.array([150.0, 60.0, 30.0]), axis=np.array([0.1, -0.2, -1.0]), mu=1.0, flux=np.array([3e4]))
    samples = plane(lamp, noise=0.002)
    start = lamp.position + np.array([12.0, -9.0, 15.0])
    fixed = calibrate_lamp(samples, start, brdf=RHO)
    moved = calibrate_lamp(samples, start, brdf=RHO, refine_position=True)
    assert np.linalg.norm(moved.lamp.position - lamp.position) < 3.0
    assert abs(moved.lamp.mu - 1.0) < abs(fixed.lamp.mu - 1.0)
    assert moved.position_covariance is not None
    np.linalg.cholesky(moved.position_covariance)
    assert math.sqrt(np.trace(moved.position_covariance)) < 5.0


def test_a_rig_of_lamps_with_a_verdict():
    lamps = [
        Led(position=np.array([x, y, 20.0]), axis=np.array([-x / 600, -y / 600, -1.0]), mu=0.9, flux=np.array([flux]))
        for x, y, flux in ((150.0, 0.0, 3e4), (-150.0, 0.0, 2e4), (0.0, 150.0, 2.5e4))
    ]
    samples = [plane(lamp, noise=0.005, seed=k) for k, lamp in enumerate(lamps)]
    found = calibrate_lamps(samples, [lamp.position for lamp in lamps], brdf=RHO, same_mu=True)
    assert isinstance(found.rig, Rig)
    assert {round(light.mu, 12) for light in found.rig.lights} == {round(found.rig.lights[0].mu, 12)}
    assert found.rig.lights[0].mu == pytest.approx(0.9, rel=0.02)
    for light, lamp in zip(found.rig.lights, lamps, strict=True):
        np.testing.assert_allclose(light.flux, lamp.flux, rtol=0.01)
    assert "3 lamps" in found.quality.verdict
    assert found.quality.strength_error.shape == (3,)
    assert found.quality.residual_brightness < 0.03


def test_one_frontal_plane_says_that_it_is_not_enough():
    lamp = Led(position=np.array([0.0, 0.0, 0.0]), axis=np.array([0.0, 0.0, -1.0]), mu=1.0, flux=np.array([3e4]))
    whole = plane(lamp, noise=0.01, half=60.0)
    first = slice(0, 14 * 14)
    one = PlaneSamples(
        points=whole.points[first], normals=whole.normals[first], values=whole.values[first], groups=whole.groups[first]
    )
    found = calibrate_lamps([one], [lamp.position], brdf=RHO)
    assert found.fits[0].mu_error > 0.1
    assert any("told badly" in line for line in found.quality.advice)


@pytest.mark.parametrize(
    ("points", "values", "position"),
    [
        (np.zeros((30, 3)), np.ones(30), [0, 0, 0]),  # the lamp in the plane
        (np.zeros((30, 3)), np.full(30, np.nan), [0, 0, 5]),
        (np.zeros((30, 3)), np.ones(30), [0, 0, -5]),  # behind it
        (np.full((30, 3), np.nan), np.ones(30), [0, 0, 5]),
        (np.zeros((30, 2)), np.ones(30), [0, 0, 5]),
        (np.zeros((30, 3)), np.ones(29), [0, 0, 5]),
        (np.zeros((30, 3)), np.ones(30), [0, 0]),
        (np.zeros((30, 3)), np.ones(30), [0, 0, math.inf]),
    ],
)
def test_what_cannot_be_is_refused(points, values, position):
    with pytest.raises(InputError):
        calibrate_lamps(
            [PlaneSamples(points=points, normals=np.array([0, 0, 1.0]), values=values, groups=np.zeros(30, int))],
            [position],
        )
    with pytest.raises(InputError):
        calibrate_lamps([], np.zeros((0, 3)))


def board_image(lamp, camera, board, pose, shape):
    """Render a chessboard under a lamp, ray by ray."""
    rays, (rotation, position) = camera.rays(shape), pose
    distance = (position @ rotation[:, 2]) / (rays @ rotation[:, 2])
    points = rays * distance[..., None]
    where = (points - position) @ rotation / board.square
    u, v = where[..., 0], where[..., 1]
    inside = (u > -1) & (u < board.columns) & (v > -1) & (v < board.rows)
    black = inside & ((np.floor(u) + np.floor(v)) % 2 == 0)
    margin = (u > -2) & (u < board.columns + 1) & (v > -2) & (v < board.rows + 1)
    paint = np.where(margin, np.where(black, 0.02, RHO), 0.01)
    normal = rotation[:, 2] * -np.sign(rotation[:, 2] @ position)
    return paint[..., None] * lamp.irradiance(points.reshape(-1, 3), normal).reshape(*shape, -1)


def test_a_chessboard_tells_how_it_lies():
    camera = Pinhole(fx=500.0, fy=500.0, cx=199.5, cy=149.5)
    board = Chessboard(columns=7, rows=5, square=25.0)
    lamp = Led(position=np.array([90.0, 40.0, 10.0]), axis=np.array([-0.1, 0.05, -1.0]), mu=1.5, flux=np.array([4e4]))
    parts = []
    for k, (a, b, place) in enumerate([(0.5, 0.1, [-80.0, 50.0, -470.0]), (0.1, -0.5, [-60.0, 50.0, -440.0])]):
        rotation, position = turned(math.pi + a, b), np.array(place)  # rows of the board run down
        image = board_image(lamp, camera, board, (rotation, position), (300, 400))
        found, at = board_pose(image[..., 0], camera, board)
        # Which of two opposite corners is the first is anyone's choice; where the corners are is not.
        truth = board.corners @ rotation.T + position
        seen = board.corners @ found.T + at
        seen = seen if np.linalg.norm(seen[0] - truth[0]) < 50.0 else seen[::-1]
        np.testing.assert_allclose(seen, truth, atol=1.5)
        parts.append(board_samples(image[None], camera, board, pose=k)[0])
    samples = joined(parts)
    expected = RHO * lamp.irradiance(samples.points, samples.normals)
    np.testing.assert_allclose(samples.values, expected, rtol=0.01)
    assert len(np.unique(samples.groups)) == 2 * 12  # white squares
    with pytest.raises(InputError, match="No chessboard"):
        board_pose(np.ones((60, 80)), camera, board)
    with pytest.raises(InputError, match="inner corners"):
        Chessboard(columns=2, rows=5, square=1.0)
    with pytest.raises(InputError, match="shape"):
        board_samples(np.ones((60, 80)), camera, board)


def test_numbers_that_no_lamp_has_are_refused():
    samples = plane(Led(position=np.array([0.0, 0.0, 0.0]), axis=np.array([0, 0, -1.0]), mu=1.0, flux=np.ones(1)))
    for options in ({"mu": -1.0}, {"mu": math.nan}, {"brdf": 0.0}, {"brdf": math.inf}):
        with pytest.raises(InputError):
            calibrate_lamp(samples, [0.0, 0.0, 0.0], **options)
    with pytest.raises(InputError, match="unit normals"):
        PlaneSamples(points=samples.points, normals=2 * samples.normals, values=samples.values, groups=samples.groups)
