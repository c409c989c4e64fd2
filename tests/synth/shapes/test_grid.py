"""Heights on a grid: the spline, its holes, its bounds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from psstereo.errors import InputError
from psstereo_synth.shapes import HeightGrid


def nodes(grid):
    rows, columns = grid.heights.shape
    x = (np.arange(columns) - (columns - 1) / 2) * grid.spacing[0]
    y = ((rows - 1) / 2 - np.arange(rows)) * grid.spacing[1]
    return np.meshgrid(x, y)


def smooth(x, y):
    return np.sin(1.3 * x + 0.4) * np.cos(0.9 * y), 1.3 * np.cos(1.3 * x + 0.4) * np.cos(0.9 * y)


def random_grid(shape=(11, 14), seed=0, spacing=(0.5, 2.0)):
    return HeightGrid(heights=np.random.default_rng(seed).normal(size=shape), spacing=spacing)


def test_it_goes_through_its_heights():
    grid = random_grid()
    found = grid.evaluate(*nodes(grid))
    np.testing.assert_allclose(found.height, grid.heights, rtol=0, atol=1e-14)


def test_row_0_is_at_the_top_and_columns_run_right():
    grid = HeightGrid(heights=np.add.outer(10.0 * np.arange(5), np.arange(7)), spacing=(0.5, 2.0))
    assert grid.extent == (1.5, 4.0)
    found = grid.evaluate(np.array([-1.5, 1.5, 0.25]), np.array([4.0, 4.0, -1.0]))
    np.testing.assert_allclose(found.height, [0.0, 6.0, 28.5], rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.slope_x, 2.0, rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.slope_y, -5.0, rtol=0, atol=1e-13)


def test_it_is_the_tensor_product_of_cubic_splines():
    """Against scipy's one-dimensional spline, with the same ends, along one axis after the other."""
    grid = random_grid(shape=(9, 12), spacing=(1.0, 1.0))
    rng = np.random.default_rng(1)
    row, column = rng.uniform(0, 8, 60), rng.uniform(0, 11, 60)
    found = grid.evaluate(column - 5.5, 4.0 - row)
    along_y = CubicSpline(np.arange(9), grid.heights, axis=0)
    for i in range(60):
        for order, value in ((0, found.height[i]), (1, found.slope_x[i])):
            assert CubicSpline(np.arange(12), along_y(row[i]))(column[i], order) == pytest.approx(value, abs=1e-11)
        slope = CubicSpline(np.arange(12), along_y(row[i], 1))(column[i])
        assert -slope == pytest.approx(found.slope_y[i], abs=1e-11)


def test_a_cubic_is_exact_in_cells_that_are_not_square():
    x, y = nodes(random_grid(spacing=(0.3, 0.7)))
    grid = HeightGrid(heights=x**3 - 2 * x * y**2 + y**3, spacing=(0.3, 0.7))
    u, v = np.random.default_rng(0).uniform(-1, 1, (2, 300)) * np.array(grid.extent)[:, None]
    found = grid.evaluate(u, v)
    np.testing.assert_allclose(found.height, u**3 - 2 * u * v**2 + v**3, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.slope_x, 3 * u**2 - 2 * v**2, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.slope_y, -4 * u * v + 3 * v**2, rtol=0, atol=1e-11)


def test_heights_are_of_fourth_order_and_slopes_of_third():
    errors = []
    for count in (21, 41, 81):
        spacing = 4 / (count - 1)
        axis = np.linspace(-2, 2, count)
        grid = HeightGrid(heights=smooth(axis, -axis[:, None])[0], spacing=(spacing, spacing))
        x, y = np.random.default_rng(0).uniform(-1.4, 1.4, (2, 4000))  # ends of splines are less exact
        found, (z, zx) = grid.evaluate(x, y), smooth(x, y)
        errors.append((np.abs(found.height - z).max(), np.abs(found.slope_x - zx).max()))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert (np.abs(orders[:, 0] - 4) < 0.2).all()
    assert (np.abs(orders[:, 1] - 3) < 0.2).all()


def test_far_above_the_sea_no_digits_are_lost():
    low = random_grid()
    high = HeightGrid(heights=low.heights + 2.0**40, spacing=low.spacing)
    x, y = np.random.default_rng(0).uniform(-1, 1, (2, 50))
    exact = HeightGrid(heights=high.heights - 2.0**40, spacing=low.spacing).evaluate(x, y)
    np.testing.assert_allclose(high.evaluate(x, y).slope_x, exact.slope_x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(high.evaluate(x, y).height - 2.0**40, exact.height, rtol=0, atol=2.0**-12)


def test_a_missing_height_takes_its_four_cells_away():
    heights = np.zeros((6, 7))
    heights[2, 3] = np.nan
    grid = HeightGrid(heights=heights)
    rows, columns = np.meshgrid(np.linspace(0, 5, 101), np.linspace(0, 6, 121), indexing="ij")
    known = np.isfinite(grid.evaluate(columns - 3, 2.5 - rows).height)
    hole = (np.abs(rows - 2) < 1 - 1e-9) & (np.abs(columns - 3) < 1 - 1e-9)
    np.testing.assert_array_equal(known, ~hole)  # the edges of the hole still belong to the cells beside it


def test_what_is_in_a_hole_does_not_matter_far_from_it():
    heights = random_grid((30, 31)).heights.copy()
    holed = heights.copy()
    holed[4, 5] = np.nan
    x, y = np.array([5.0]), np.array([-7.3])
    with_hole, without = (HeightGrid(heights=z).evaluate(x, y).height for z in (holed, heights))
    assert with_hole == pytest.approx(without, abs=1e-5)


def test_edges_belong_to_it_whatever_the_rounding():
    for spacing in (0.1, 1 / 3, 1e-7, 92.6):
        grid = HeightGrid(heights=np.zeros((8, 11)), spacing=(spacing, spacing))
        assert np.isfinite(grid.evaluate(*nodes(grid)).height).all()
        x = np.linspace(-1, 1, 9) * grid.extent[0]
        assert np.isfinite(grid.evaluate(x, np.full(9, grid.extent[1])).height).all()
        assert np.isnan(grid.evaluate(x * (1 + 1e-6), np.full(9, grid.extent[1] * (1 + 1e-6))).height).all()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32), st.integers(4, 12), st.integers(4, 12), st.floats(0.0, 0.15))
def test_bounds_hold_for_any_heights(seed, rows, columns, missing):
    rng = np.random.default_rng(seed)
    heights = rng.normal(size=(rows, columns)) * 10.0 ** rng.integers(-6, 6)
    holes = rng.random(heights.shape) < missing
    holes[:2, :2] = False
    heights[holes] = np.nan
    grid = HeightGrid(heights=heights)
    x, y = np.meshgrid(*(np.linspace(-half, half, 97) for half in grid.extent))
    z = grid.evaluate(x, y).height
    low, high = grid.bounds
    slack = 1e-13 * np.nanmax(np.abs(z))
    assert low - slack <= np.nanmin(z)
    assert np.nanmax(z) <= high + slack


def test_the_array_is_its_own_and_cannot_be_changed():
    heights = np.zeros((5, 5), np.float32)
    grid = HeightGrid(heights=heights)
    heights[2, 2] = 9
    assert (grid.heights == 0).all()
    assert grid.heights.dtype == np.float64
    with pytest.raises(ValueError, match="read-only"):
        grid.heights[0, 0] = 1


@pytest.mark.parametrize(
    ("heights", "spacing"),
    [
        (np.zeros((3, 5)), (1, 1)),
        (np.zeros((5, 3)), (1, 1)),
        (np.zeros(25), (1, 1)),
        (np.zeros((0, 0)), (1, 1)),
        (np.zeros((5, 5, 1)), (1, 1)),
        (np.full((5, 5), np.nan), (1, 1)),
        (np.full((5, 5), np.inf), (1, 1)),
        (np.where(np.indices((6, 6)).sum(axis=0) % 2, 1.0, np.nan), (1, 1)),
        (np.zeros((5, 5)), (0.0, 1)),
        (np.zeros((5, 5)), (1, -1.0)),
        (np.zeros((5, 5)), (np.nan, 1)),
        (np.zeros((5, 5)), (1, np.inf)),
        (np.zeros((5, 5)), (1,)),
        (np.zeros((5, 5)), 2.0),
    ],
)
def test_grids_that_mean_nothing_are_refused(heights, spacing):
    with pytest.raises(InputError) as caught:
        HeightGrid(heights=heights, spacing=spacing)
    assert caught.value.given
    assert caught.value.needed
    assert caught.value.remedy
