"""The sweep along the horizon, against walking each ray on its own and against closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import binary_dilation, binary_erosion, map_coordinates

from psstereo.errors import InputError, UnsupportedError
from psstereo.forward import ReliefShadows, shadow_height
from psstereo.lights import Beam

FULL_TURN = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]


def walked(height, spacing, direction):
    """Follow the ray of every node, a row or column at a time, linear between nodes."""
    rows, columns = np.indices(height.shape, dtype=float)
    step_column, step_row = direction[0] / spacing[0], -direction[1] / spacing[1]
    along = 1 / max(abs(step_column), abs(step_row))
    found = np.full(height.shape, -np.inf)
    for k in range(1, max(height.shape)):
        r, c = rows + step_row * along * k, columns + step_column * along * k
        slack = 1e-9
        inside = (r >= -slack) & (r <= len(height) - 1 + slack) & (c >= -slack) & (c <= height.shape[1] - 1 + slack)
        there = map_coordinates(height, [r, c], order=1, mode="nearest") - k * along * direction[2]
        found = np.where(inside, np.maximum(found, there), found)
    return found


def ripples(shape=(50, 70)):
    rows, columns = np.indices(shape)
    return 4 * np.sin(columns / 6) * np.cos(rows / 5) + 0.02 * columns


@pytest.mark.parametrize("ground", FULL_TURN)
@pytest.mark.parametrize("elevation", [0.15, 0.6, 1.4])
def test_along_rows_columns_and_diagonals_it_is_the_walked_ray(ground, elevation):
    flat = np.array(ground) / np.hypot(*ground)
    direction = np.array([*(np.cos(elevation) * flat), np.sin(elevation)])
    found, wanted = shadow_height(ripples(), (1.0, 1.0), direction), walked(ripples(), (1.0, 1.0), direction)
    np.testing.assert_array_equal(found > -1e200, np.isfinite(wanted))
    there = np.isfinite(wanted)
    np.testing.assert_allclose(found[there], wanted[there], rtol=0, atol=1e-12)


@pytest.mark.parametrize("azimuth", np.radians([13.0, 60.0, 111.0, 200.0, 290.0, 351.0]))
@pytest.mark.parametrize("spacing", [(1.0, 1.0), (0.7, 1.3)])
def test_at_any_azimuth_shadows_differ_from_the_walked_ones_at_edges_only(azimuth, spacing):
    direction = np.array([np.cos(azimuth), np.sin(azimuth), 0.5])
    height = ripples((120, 140))
    found = height < shadow_height(height, spacing, direction)
    wanted = height < walked(height, spacing, direction)
    assert 0.05 < wanted.mean() < 0.8
    assert (found != wanted).mean() < 0.015
    # Where they differ, a neighbour differs from the pixel in the walked picture: an edge.
    square = np.ones((3, 3))
    edge = binary_dilation(wanted, square) & ~binary_erosion(wanted, square)
    assert not (found & ~wanted & ~edge)[2:-2, 2:-2].any()
    assert not (~found & wanted & ~edge)[2:-2, 2:-2].any()


def test_the_shadow_of_a_wall_is_as_long_as_the_sun_says():
    """A wall of height H shades H / tan e of the ground."""
    wall = np.zeros((9, 200))
    wall[:, 150] = 30.0
    for elevation in np.radians([20.0, 45.0, 70.0]):
        direction = np.array([np.cos(elevation), 0.0, np.sin(elevation)])
        dark = wall < shadow_height(wall, (1.0, 1.0), direction)
        assert dark[4].sum() == int(np.ceil(30.0 / np.tan(elevation))) - 1
        assert not dark[:, 150:].any()


def test_a_hemisphere_shades_its_disc_turned_by_the_light():
    """The shadow of a sphere on the ground is an ellipse, 1 / sin e long, with the closed form per point."""
    n, radius, elevation = 301, 40.0, np.radians(30.0)
    rows, columns = np.indices((n, n), dtype=float)
    x, y = columns - 200, 150 - rows
    height = np.sqrt(np.maximum(radius**2 - x**2 - y**2, 0.0))
    direction = np.array([np.cos(elevation) * np.cos(0.4), np.cos(elevation) * np.sin(0.4), np.sin(elevation)])
    dark = height < shadow_height(height, (1.0, 1.0), direction)
    points = np.stack([x, y, height], axis=-1)
    along = points @ direction
    distance = np.sqrt((points**2).sum(axis=-1) - along**2)
    ground = np.hypot(x, y) > radius + 1
    wanted = ground & (distance < radius) & (along < 0)
    band = np.abs(distance - radius) < 1.5
    assert wanted.sum() > 2000
    assert not ((dark != wanted) & ground & ~band).any()


def test_holes_throw_no_shadow_and_light_from_the_zenith_none_at_all():
    height = ripples()
    assert (shadow_height(height, (1.0, 1.0), np.array([0.0, 0.0, 1.0])) < -1e200).all()
    holes = np.where(height > 3, np.nan, height)
    direction = np.array([0.9, 0.1, 0.4])
    assert (holes < shadow_height(holes, (1.0, 1.0), direction)).sum() < (
        height < shadow_height(height, (1.0, 1.0), direction)
    ).sum()
    nothing = np.full((6, 7), np.nan)
    assert (shadow_height(nothing, (1.0, 1.0), direction) < -1e200).all()


@given(
    seed=st.integers(0, 10**6),
    azimuth=st.floats(0, 6.28),
    lift=st.floats(-1e3, 1e3),
    scale=st.floats(1e-3, 1e3),
)
@settings(max_examples=40, deadline=None)
def test_lifting_and_scaling_the_scene_change_nothing(seed, azimuth, lift, scale):
    height = np.random.default_rng(seed).normal(size=(12, 17))
    direction = np.array([np.cos(azimuth), np.sin(azimuth), 0.8])
    plain = shadow_height(height, (1.0, 1.0), direction)
    moved = shadow_height(height + lift, (1.0, 1.0), direction)
    larger = shadow_height(height * scale, (scale, scale), direction)
    near = plain > -1e100
    np.testing.assert_allclose(moved[near], plain[near] + lift, rtol=0, atol=1e-11 * (1 + abs(lift)))
    np.testing.assert_allclose(larger[near], plain[near] * scale, rtol=0, atol=1e-12 * scale * 10)


@pytest.mark.parametrize(
    ("height", "spacing", "direction"),
    [
        (np.zeros(5), (1, 1), np.ones(3)),
        (np.zeros((0, 5)), (1, 1), np.ones(3)),
        (np.zeros((5, 5)), (0, 1), np.ones(3)),
        (np.zeros((5, 5)), (1, np.nan), np.ones(3)),
        (np.zeros((5, 5)), (1, 1), np.ones(2)),
    ],
)
def test_what_means_nothing_is_refused(height, spacing, direction):
    with pytest.raises(InputError, match="height field"):
        shadow_height(height, spacing, direction)


def points_of(height, spacing=1.0):
    rows, columns = np.indices(height.shape)
    return np.stack([columns * spacing, -rows * spacing, height], axis=-1).reshape(-1, 3)


def test_relief_shadows_are_those_of_the_sweep_and_left_out_where_nothing_can_be_in_the_way():
    height = ripples()
    shadows = ReliefShadows(height, (1.0, 1.0))
    for elevation in np.radians([10.0, 30.0, 80.0]):
        direction = np.array([np.cos(elevation) * 0.6, np.cos(elevation) * 0.8, np.sin(elevation)])
        beam = Beam(directions=direction, irradiance=np.ones(1))
        wanted = height >= shadow_height(height, (1.0, 1.0), direction)
        np.testing.assert_array_equal(shadows.lit(points_of(height), np.zeros((height.size, 3)), beam), wanted.ravel())
        assert shadows.may_block(direction) or wanted.all()
    assert not shadows.may_block(np.array([0.0, 0.1, 0.995]))
    gaps = ReliefShadows(np.where(height > 3, np.nan, height), (1.0, 1.0))
    assert gaps.may_block(np.array([0.3, 0.1, 0.9]))  # two sides of a gap may face each other steeply


def test_points_between_nodes_and_beyond_the_grid():
    wall = np.zeros((9, 60))
    wall[:, 40] = 10.0
    beam = Beam(directions=np.array([1.0, 0.0, 1.0]) / np.sqrt(2), irradiance=np.ones(1))
    shadows = ReliefShadows(wall, (1.0, 1.0))
    points = np.array([[35.5, -4.5, 0.0], [35.5, -4.5, 6.0], [20.0, -4.0, 0.0], [-50.0, -4.0, 0.0], [41.0, -4.0, 0.0]])
    assert shadows.lit(points, points, beam).tolist() == [False, True, True, True, True]


def test_lamps_are_not_for_the_sweep():
    beam = Beam(directions=np.array([[0.0, 0.0, 1.0]]), irradiance=np.ones(1), distances=np.ones(1))
    with pytest.raises(UnsupportedError, match="parallel"):
        ReliefShadows(np.zeros((3, 3)), (1.0, 1.0)).lit(np.zeros((1, 3)), np.zeros((1, 3)), beam)
