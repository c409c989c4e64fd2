"""The pieces of the checks against closed forms and brute force."""

from itertools import combinations

import numpy as np
import pytest
from scipy.ndimage import shift

from psstereo.errors import InputError
from psstereo.plan.diagnosis import MotionProbe
from psstereo.plan.diagnosis.cone import amplification
from psstereo.plan.diagnosis.curl import curls, tiles
from psstereo.plan.diagnosis.evidence import evidence
from psstereo.plan.diagnosis.orders import best_orders
from psstereo.plan.diagnosis.patterns import smooth_patterns
from psstereo.plan.diagnosis.relief import smooth_relief
from psstereo.plan.diagnosis.shifts import shifts_from_residuals
from psstereo_synth.rigs import arc, ring, spiral


@pytest.mark.parametrize("count", [3, 5, 12])
def test_the_best_ring_enlarges_nothing(count):
    assert amplification(ring(count)) == pytest.approx(1.0, rel=1e-12)


def test_a_ring_enlarges_by_its_closed_form():
    # directions (s cos, s sin, c) have the second moments m s² / 2 across the view
    tilt = np.radians(10.0)
    assert amplification(ring(7, tilt=tilt)) == pytest.approx(np.sqrt(2 / 3) / np.sin(tilt), rel=1e-12)
    assert amplification(arc(5)) == np.inf


@pytest.mark.parametrize("count", [5, 9])
def test_exchanges_are_ranked_as_brute_force_does(count):
    rng = np.random.default_rng(count)
    lights = spiral(count)
    values = np.maximum(lights @ rng.standard_normal((3, 200)), 0) + 0.05 * rng.random((count, 200))
    basis, _ = np.linalg.qr(lights)

    def left(order):
        q = basis[order]
        return ((values - q @ (q.T @ values)) ** 2).sum()

    given = np.arange(count)
    orders = []
    for a, b in combinations(range(count), 2):
        order = given.copy()
        order[[a, b]] = b, a
        orders.append(order)
    best = min(orders, key=left)
    found = best_orders(values, lights, tuple("abcdefghi"[:count]))
    assert (found[0] == given).all()
    assert (found[1] == best).all()


def test_any_exchange_is_undone():
    rng = np.random.default_rng(0)
    lights = spiral(7)
    values = lights @ rng.standard_normal((3, 100))
    order = rng.permutation(7)
    order[[0, 1]] = order[[1, 0]]
    swapped = np.arange(7)
    swapped[[1, 5]] = 5, 1
    found = best_orders(values, lights[swapped], tuple("abcdefg"))
    assert (found[1] == swapped).all()


def square(side):
    rows, columns = np.divmod(np.arange(side * side), side)
    return np.stack([rows, columns], axis=1)


@pytest.mark.parametrize("reading", range(4))
@pytest.mark.parametrize("step", [1, 2, 4])
def test_each_reading_of_a_saddle_is_recognised(reading, step):
    pixels = square(16)
    y, x = -(pixels[:, 0] - 7.5) / 20, (pixels[:, 1] - 7.5) / 20
    p, q = 0.9 * x + 0.7 * y, 0.7 * x + 0.2 * y  # z = 0.45 x² + 0.7 x y + 0.1 y²
    read = [(p, q), (p, -q), (q, p), (-q, p)][reading]
    normals = np.stack([-read[0], -read[1], np.ones_like(p)])
    grid = tiles(pixels, np.zeros(256, np.int64), 16)
    found, scale = curls(normals, np.ones(256, np.bool_), grid, step)
    assert found[reading, 0] < 1e-3 * scale[0]
    assert all(found[k, 0] > 0.05 * scale[0] for k in range(4) if k != reading)


def test_noise_has_curl_one_in_every_reading():
    rng = np.random.default_rng(1)
    pixels = np.concatenate([square(16)] * 40)
    blocks = np.repeat(np.arange(40), 256)
    normals = np.stack(
        [0.1 * rng.standard_normal(len(pixels)), 0.1 * rng.standard_normal(len(pixels)), np.ones(len(pixels))]
    )
    found, scale = curls(normals, np.ones(len(pixels), np.bool_), tiles(pixels, blocks, 16), 1)
    assert found.sum(axis=1) / scale.sum() == pytest.approx(np.ones(4), abs=0.05)


def test_tiles_leave_gaps_and_cut_to_the_middle():
    pixels = square(16)[3:]
    grid = tiles(pixels, np.zeros(len(pixels), np.int64), 16)
    assert (grid[0, 0, :3] == -1).all()
    assert (np.sort(grid[grid >= 0]) == np.arange(253)).all()
    small = tiles(square(16), np.zeros(256, np.int64), 8)
    assert (square(16)[small[0, 0, 0]] == (4, 4)).all()


def test_a_smooth_relief_follows_slopes():
    rng = np.random.default_rng(2)
    place = rng.uniform(-1, 1, (2, 500))
    x, y = place
    normals = np.stack([-(0.4 * x + 0.3 * y), -(0.3 * x - 0.2 * y**2), np.ones_like(x)])
    true = 0.2 * x**2 + 0.3 * x * y - 0.2 * y**3 / 3
    assert smooth_relief(place, normals) == pytest.approx(true - true.mean(), abs=5e-3)


def test_an_offset_is_told_beside_noise(shot, sampled):
    lights = spiral(12)
    sample = sampled(shot(lights, texture=0.0).images + 0.05, lights, noise=0.003)
    found = smooth_patterns(sample, evidence(sample))["fill"]
    assert found.size == pytest.approx(0.1, rel=0.2)
    assert found.error < 0.1 * found.size
    assert found.share > 0.5


def test_five_lights_are_needed_for_shifts(shot, sampled):
    assert shifts_from_residuals(sampled(shot(ring(4)).images, ring(4))) is None


def test_shifts_are_told_by_what_a_fit_leaves(shot, sampled):
    lights = spiral(10)
    made = shot(lights, texture=0.6)
    moves = np.random.default_rng(5).uniform(-0.8, 0.8, (10, 2))
    moved = np.array([shift(one, move, order=3, mode="nearest") for one, move in zip(made.images, moves, strict=True)])
    found = shifts_from_residuals(sampled(np.maximum(0.7 * moved, 0), lights))
    true = moves[:, ::-1] * [1, -1]
    true -= true.mean(axis=0)
    assert found.rms == pytest.approx(np.sqrt((true**2).sum(axis=1).mean()), rel=0.25)
    assert np.corrcoef(found.size.ravel(), true.ravel())[0, 1] > 0.95
    assert found.share > 0.1


def test_a_probe_refuses_what_it_cannot_keep():
    with pytest.raises(InputError, match="At least one"):
        MotionProbe(0, (5, 5))
    probe = MotionProbe(2, (40, 40))
    with pytest.raises(InputError, match="Image 2 of 2"):
        probe.feed(np.zeros((80, 80, 1)), 2)
    probe.feed(np.zeros((80, 80, 1)), 0)
    assert probe.shifts() is None  # one frame is missing


def test_a_probe_without_detail_says_nothing(probe):
    assert probe(np.full((3, 144, 144), 0.5)).shifts() is None


def test_a_probe_measures_whole_pixels():
    rng = np.random.default_rng(4)
    picture = 1 + 0.3 * rng.random((160, 160))
    probe = MotionProbe(3, (80, 80))
    for i, (down, right) in enumerate(((0, 0), (2, 0), (0, -1))):
        probe.feed(np.roll(picture, (down, right), axis=(0, 1))[..., None], i)
    found = probe.shifts()
    true = np.array([(0, 0), (0, -2), (-1, 0)]) - np.mean([(0, 0), (0, -2), (-1, 0)], axis=0)
    assert found.size == pytest.approx(true, abs=0.05)
