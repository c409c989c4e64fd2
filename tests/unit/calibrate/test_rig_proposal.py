"""Proposed placements: closed forms where there are any, and no placement of the shape is better."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.calibrate.rig import SHAPES, propose_rig
from psstereo.calibrate.rig.figures import noise_gain, normals_at
from psstereo.errors import OptionError

BEST = np.degrees(np.arctan(np.sqrt(2)))


@pytest.mark.parametrize("count", [3, 5, 12])
@pytest.mark.parametrize("tilt", [0.0, 30.0])
def test_the_best_ring_stands_at_tan_squared_two(count, tilt):
    found = propose_rig(lights=count, max_tilt=np.radians(tilt), shape="ring")
    assert np.degrees(found.slants) == pytest.approx([BEST], abs=0.01)
    # LᵀL = m / 3: every direction errs alike
    assert found.error_per_noise == pytest.approx(np.sqrt(6 / count), rel=1e-4)
    assert found.told == 1


def test_three_lights_for_steep_objects_stand_so_that_none_is_in_shadow():
    for tilt in (45.0, 60.0, 75.0):
        found = propose_rig(lights=3, max_tilt=np.radians(tilt), shape="ring")
        assert np.degrees(found.slants[0]) == pytest.approx(90 - tilt, abs=0.01)
        assert found.told == 1


def test_a_cone_bounds_the_slants():
    found = propose_rig(lights=9, max_tilt=np.radians(30.0), cone=np.radians(40.0), shape="ring")
    assert np.degrees(found.slants) == pytest.approx([40.0], abs=0.01)


def brute_force(directions, tilt):
    """Mean square of the pseudo-normal's error over a picture of a ball, by another way of sampling."""
    random = np.random.default_rng(0)
    tilts = np.arcsin(np.sqrt(random.uniform(0, 1, 1500)) * np.sin(tilt))
    normals = normals_at(tilts, random.uniform(0, 2 * np.pi, 1500))
    total = 0.0
    for normal in normals:
        lit = directions[directions @ normal > 0]
        total += np.trace(np.linalg.inv(lit.T @ lit)) / len(normals)
    return total


def test_no_slant_is_better_for_a_ring_in_shadow():
    tilt = np.radians(70.0)
    found = propose_rig(lights=8, max_tilt=tilt, shape="ring")
    best = brute_force(found.rig.directions, tilt)
    assert 25 < np.degrees(found.slants[0]) < BEST
    for slant in (30.0, 36.0, 48.0, 55.0):
        turned = normals_at(np.full(8, np.radians(slant)), np.arange(8) * (2 * np.pi / 8))
        assert abs(slant - np.degrees(found.slants[0])) < 3 or brute_force(turned, tilt) > best


def test_two_rings_are_better_than_one_for_steep_objects():
    one, two = (propose_rig(lights=10, max_tilt=np.radians(75.0), shape=shape) for shape in ("ring", "rings"))
    assert two.error_per_noise < one.error_per_noise
    assert sum(two.counts) == 10
    assert len(two.counts) == len(two.slants) > 1


@settings(max_examples=4, deadline=None, derandomize=True)
@given(st.integers(3, 20), st.floats(0, 85), st.floats(20, 90), st.sampled_from(sorted(SHAPES)))
def test_proposals_are_rigs_within_their_cone(count, tilt, cone, shape):
    found = propose_rig(lights=count, max_tilt=np.radians(tilt), cone=np.radians(cone), shape=shape)
    directions = found.rig.directions
    assert directions.shape == (count, 3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    assert (directions[:, 2] >= np.cos(np.radians(cone)) - 1e-9).all()
    assert sum(found.counts) == count
    assert 0 <= found.told <= 1
    assert found.error_per_noise >= np.sqrt(4 / count) * (1 - 1e-9)  # two angles, each no better than 1 / Σ (l·t)²
    if found.told == 1 and tilt > 0:
        edge = normals_at(np.full(90, np.radians(tilt)), np.radians(np.arange(90) * 4.0))
        told = np.isfinite(noise_gain(directions, np.ones(count), edge)[0])
        assert told.mean() > 0.97


@pytest.mark.parametrize(
    "words",
    [
        {"lights": 2},
        {"lights": 1001},
        {"shape": "square"},
        {"max_tilt": np.radians(86)},
        {"max_tilt": -0.1},
        {"max_tilt": np.nan},
        {"cone": np.radians(4)},
        {"cone": np.radians(91)},
    ],
)
def test_what_cannot_be_is_refused(words):
    with pytest.raises(OptionError):
        propose_rig(**{"lights": 5, "max_tilt": 0.5, **words})
