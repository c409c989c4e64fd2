"""What every surface promises; a new one is tested by being listed in the catalogue."""

import dataclasses
import itertools
import pickle

import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo_synth.shapes import RELIEFS, FiniteRelief, HeightGrid

STEP = 1e-3


def bumpy_grid():
    rows, columns = np.indices((9, 12))
    heights = 0.2 * np.sin(0.7 * rows + 0.3) * np.cos(0.6 * columns) + 0.03 * columns
    heights[0, 0] = heights[2, 3] = np.nan
    return HeightGrid(heights=heights, spacing=(0.17, 0.25))


# Surfaces without defaults need a maker, and so do second forms of others.
MAKERS = {name: [kind] for name, kind in RELIEFS.items() if kind is not HeightGrid} | {"grid": [bumpy_grid]}
MAKERS["plane"].append(lambda: RELIEFS["plane"](slope_x=0.4, slope_y=-1.3))
MAKERS["ripples"].append(lambda: RELIEFS["ripples"](direction=0.4))
MAKERS["ripples"].append(lambda: RELIEFS["ripples"](wavelength=9.0))
MAKERS["cliffs"].append(lambda: RELIEFS["cliffs"](tapered=True))
MAKERS["vase"].append(lambda: RELIEFS["vase"](swell=0.0))
CASES = [(name, number) for name in sorted(MAKERS) for number in range(len(MAKERS[name]))]

# Lines where slopes have a kink or jump, on which differences are no measure: distance of places to them.
BREAKS = {
    "cliffs": lambda r, x, y: np.minimum(np.abs(x), np.abs(np.abs(y) - 0.5 * r.half_width)),
    "steps": lambda r, x, _: abs(x[..., None] - ramp_edges(r)).min(axis=-1),
    "grid": lambda r, x, y: np.minimum(off_lines(x, r, 0), off_lines(y, r, 1)),
    "cone": lambda _, x, y: np.hypot(x, y),
}


def ramp_edges(steps):
    middles = steps.half_width * (2 * np.arange(1, steps.count + 1) / (steps.count + 1) - 1)
    return np.concatenate([middles - steps.ramp / 2, middles + steps.ramp / 2])


def off_lines(at, grid, axis):
    cell = (at + grid.extent[axis]) / grid.spacing[axis]
    return np.abs(cell - np.rint(cell)) * grid.spacing[axis]


@pytest.fixture(params=CASES, ids=lambda case: f"{case[0]}-{case[1]}")
def relief(request):
    name, number = request.param
    return MAKERS[name][number]()


def test_every_surface_is_tested():
    assert set(MAKERS) == set(RELIEFS)


def places(relief, count, seed=0):
    """Places spread over a little more than the surface."""
    half = 1.1 * np.array(relief.extent)
    return np.random.default_rng(seed).uniform(-half, half, (count, 2)).T


def outline(relief, count=400):
    """Places just inside the outline, and the surface there."""
    x, y = places(relief, 4000, seed=5)
    inside = np.isfinite(relief.evaluate(x, y).height)
    turn = np.random.default_rng(6).uniform(0, 2 * np.pi, count)
    start = np.stack([x[inside][:count], y[inside][:count]])
    end = start + 3 * max(relief.extent) * np.stack([np.cos(turn), np.sin(turn)])
    for _ in range(60):
        middle = 0.5 * (start + end)
        there = np.isfinite(relief.evaluate(*middle).height)
        start, end = np.where(there, middle, start), np.where(there, end, middle)
    return start


def test_it_is_a_frozen_value_with_a_name(relief):
    assert RELIEFS[relief.name] is type(relief)
    assert relief.summary.endswith(".")
    assert isinstance(relief, FiniteRelief)
    assert all(field.kw_only for field in dataclasses.fields(relief))
    with pytest.raises(dataclasses.FrozenInstanceError):
        relief.anything = 1


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_shapes_are_kept_and_numbers_are_double(relief, kind):
    for shape in ((), (0,), (1,), (5, 7), (2, 3, 4)):
        x, y = np.full(shape, 0.31, kind), np.full(shape, -0.42, kind)
        x.flags.writeable = y.flags.writeable = False
        found = relief.evaluate(x, y)
        for part in (found.height, found.slope_x, found.slope_y):
            assert isinstance(part, np.ndarray | np.float64)
            assert part.shape == shape
            assert part.dtype == np.float64
            assert np.isfinite(part).all()


def test_what_is_nowhere_is_unknown_altogether(relief):
    x, y = places(relief, 5000)
    found = relief.evaluate(x, y)
    unknown = np.isnan(found.height)
    assert 0.1 < np.mean(unknown) < 0.9
    np.testing.assert_array_equal(np.isfinite(found.height), ~unknown)
    np.testing.assert_array_equal(np.isfinite(found.slope_x), ~unknown)
    np.testing.assert_array_equal(np.isfinite(found.slope_y), ~unknown)
    np.testing.assert_array_equal(np.isnan(found.slope_x), unknown)
    outside = (np.abs(x) > relief.extent[0]) | (np.abs(y) > relief.extent[1])
    assert unknown[outside].all()


def test_places_without_numbers_have_no_surface(relief):
    for x, y in itertools.product([np.nan, np.inf, -np.inf, 1e300, 0.0], [np.nan, np.inf, -1e300]):
        for u, v in ((x, y), (y, x)):
            found = relief.evaluate(np.array([u]), np.array([v]))
            assert np.isnan([found.height, found.slope_x, found.slope_y]).all(), (u, v)


def test_coordinates_of_different_shapes_are_refused(relief):
    with pytest.raises(InputError, match="same places"):
        relief.evaluate(np.zeros(3), np.zeros(4))


def slope_errors(relief, seed=1):
    """Differences of eighth order against the slopes, over 1 + slope, where the surface is smooth all around."""
    x, y = places(relief, 3000, seed)
    safe = np.ones(x.shape, bool)
    for u, v in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        safe &= np.isfinite(relief.evaluate(x + 60 * STEP * u, y + 60 * STEP * v).height)
    if relief.name in BREAKS:
        safe &= BREAKS[relief.name](relief, x, y) > 20 * STEP
    x, y = x[safe], y[safe]
    assert len(x) > 150
    found = relief.evaluate(x, y)
    by_x, by_y = np.zeros((2, len(x)))
    for n, weight in enumerate((4 / 5, -1 / 5, 4 / 105, -1 / 280), 1):
        h = n * STEP
        by_x += weight / STEP * (relief.evaluate(x + h, y).height - relief.evaluate(x - h, y).height)
        by_y += weight / STEP * (relief.evaluate(x, y + h).height - relief.evaluate(x, y - h).height)
    steep = 1 + np.hypot(found.slope_x, found.slope_y)
    return np.maximum(np.abs(by_x - found.slope_x), np.abs(by_y - found.slope_y)) / steep


def test_slopes_are_those_of_the_heights(relief):
    assert slope_errors(relief).max() < 1e-11


def test_bounds_hold_and_are_tight(relief):
    low, high = relief.bounds
    x, y = np.meshgrid(*(np.linspace(-half, half, 401) for half in relief.extent))
    inner, rim = relief.evaluate(x, y).height, relief.evaluate(*outline(relief)).height
    lowest, highest = min(np.nanmin(inner), np.nanmin(rim)), max(np.nanmax(inner), np.nanmax(rim))
    assert low <= lowest
    assert highest <= high
    assert (high - highest) + (lowest - low) <= 0.05 * (highest - lowest)


def test_extent_is_tight(relief):
    x, y = np.abs(outline(relief))
    assert x.max() > 0.9 * relief.extent[0]
    assert y.max() > 0.9 * relief.extent[1]


def test_convex_surfaces_lie_above_their_chords_and_others_do_not(relief):
    """A convex cap: the middle of a chord is over its outline, and not above the surface."""
    (x, y), (u, v) = places(relief, 20000, seed=2), places(relief, 20000, seed=3)
    first, second = relief.evaluate(x, y).height, relief.evaluate(u, v).height
    middle = relief.evaluate(0.5 * (x + u), 0.5 * (y + v)).height
    both = np.isfinite(first) & np.isfinite(second)
    assert both.sum() > 3000
    over = (middle >= 0.5 * (first + second) - 1e-15)[both]
    assert over.all() == relief.convex


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case[0]}-{case[1]}")
def test_it_is_the_same_every_time_and_through_pickle(case):
    make = MAKERS[case[0]][case[1]]
    first, again = make(), make()
    copy = pickle.loads(pickle.dumps(first))
    x, y = places(first, 300)
    expected = first.evaluate(x, y)
    for other in (again, copy, pickle.loads(pickle.dumps(first))):  # the last one with its figures at hand
        assert other.bounds == first.bounds
        found = other.evaluate(x, y)
        assert found.height.tobytes() == expected.height.tobytes()
        assert found.slope_x.tobytes() == expected.slope_x.tobytes()
    if case[0] != "grid":
        assert copy == first
        assert hash(copy) == hash(first)
        assert repr(copy) == repr(first)
