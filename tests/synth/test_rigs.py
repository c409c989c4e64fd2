"""Arrangements of suns: unit vectors, where they should be."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.errors import InputError
from psstereo_synth import ring, spiral
from psstereo_synth.rigs import arc


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 300), st.floats(1e-6, np.pi / 2))
def test_spirals_are_unit_vectors_within_the_cap(count, tilt):
    rows = spiral(count, max_tilt=tilt)
    assert rows.shape == (count, 3)
    assert np.abs(np.linalg.norm(rows, axis=1) - 1).max() < 1e-14
    angle = np.arctan2(np.hypot(rows[:, 0], rows[:, 1]), rows[:, 2])
    assert (angle <= tilt * (1 + 1e-9)).all()
    assert (np.diff(angle) > 0).all()  # from the middle outward
    drop = 2 * np.sin(angle / 2) ** 2
    expected = 2 * np.sin(tilt / 2) ** 2 * (np.arange(count) + 0.5) / count
    assert np.allclose(drop, expected, rtol=1e-6)  # equal shares of the cap's area


def test_a_spiral_spreads_evenly():
    rows = spiral(400)
    assert np.abs(rows.mean(axis=0)[:2]).max() < 0.01
    assert rows[:, 2].mean() == pytest.approx(0.75, abs=1e-3)  # mean height of a cap of 60°
    gaps = np.arccos(np.clip(rows @ rows.T - 2 * np.eye(400), -1, 1)).min(axis=1)
    assert gaps.min() > 0.6 * np.sqrt(np.pi / 400)


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 200), st.floats(0, np.pi / 2))
def test_rings_are_unit_vectors_of_one_tilt(count, tilt):
    rows = ring(count, tilt=tilt)
    assert rows.shape == (count, 3)
    assert np.abs(np.linalg.norm(rows, axis=1) - 1).max() < 1e-14
    assert np.allclose(np.arctan2(np.hypot(rows[:, 0], rows[:, 1]), rows[:, 2]), tilt, atol=1e-12)


@pytest.mark.parametrize("count", [3, 4, 7, 24])
def test_the_default_ring_is_the_best_one(count):
    rows = ring(count)
    gram = rows.T @ rows
    assert np.allclose(gram, np.eye(3) * count / 3, atol=1e-12)  # all directions equally well known
    noise = [np.trace(np.linalg.inv(r.T @ r)) for r in (ring(count, tilt=t) for t in np.linspace(0.3, 1.3, 41))]
    assert np.trace(np.linalg.inv(gram)) <= min(noise) + 1e-12


def test_a_ring_begins_on_the_right_and_turns_up():
    rows = ring(4)
    assert rows[0, 0] > 0
    assert abs(rows[0, 1]) < 1e-15
    assert rows[1, 1] > 0


@pytest.mark.parametrize("make", [ring, spiral])
@pytest.mark.parametrize("count", [0, -3])
def test_no_light_is_no_rig(make, count):
    with pytest.raises(InputError, match=f"{count} lights") as caught:
        make(count)
    assert "at least one" in caught.value.needed


def test_arc_lies_in_one_plane_from_end_to_end():
    rows = arc(7, max_tilt=np.radians(50), azimuth=np.radians(120))
    assert np.allclose(np.linalg.norm(rows, axis=1), 1, atol=1e-15)
    normal = [-np.sin(np.radians(120)), np.cos(np.radians(120)), 0]
    assert np.allclose(rows @ normal, 0, atol=1e-15)
    along = rows[:, 0] * np.cos(np.radians(120)) + rows[:, 1] * np.sin(np.radians(120))
    assert np.allclose(np.degrees(np.arctan2(along, rows[:, 2])), np.linspace(-50, 50, 7))
    assert arc(1).tolist() == [[0, 0, 1]]
    with pytest.raises(InputError):
        arc(0)
