"""What every normal solver promises; a new one is tested by being listed in the catalogue."""

import functools

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from psstereo.capture import Capture
from psstereo.errors import RigError, UnsupportedError
from psstereo.flags import Flag
from psstereo.lights import Led, Rig
from psstereo.normals import GATES, NORMAL_SOLVERS, Samples, estimate_normals
from psstereo.results import Outcome
from psstereo.stack import MemoryStack
from psstereo.verdict import Verdict
from psstereo_synth import ring, spiral
from tests.contract.normal_trials import (
    EXACT,
    MANY,
    RIGS,
    angle,
    arrange,
    assert_circle_refused,
    assert_explained,
    assert_refused,
    conditions,
    design,
    flexible,
    frames,
    hilly,
    on_one_circle,
    pixelwise,
    random_normals,
    with_images,
)


@pytest.fixture(scope="module", params=sorted(NORMAL_SOLVERS))
def method(request):
    return NORMAL_SOLVERS[request.param]


@pytest.mark.parametrize("gate", ["auto", "shadow"])
@pytest.mark.parametrize("rig", sorted(RIGS))
def test_exact_wherever_three_lights_reach(method, rig, gate):
    if len(RIGS[rig]) < method.least_lights:
        assert_refused(method, RIGS[rig])
        return
    if on_one_circle(method, RIGS[rig]):
        assert_circle_refused(method, RIGS[rig])
        return
    capture, truth = hilly(RIGS[rig], steepness=2.5)
    result = estimate_normals(capture, method(gate=GATES[gate]))
    lit = (frames(capture)[..., 0] > 0)[:, capture.mask]
    reached = conditions(lit, RIGS[rig]) < 1e4
    error = angle(result.normals, truth.normals)[capture.mask]
    assert reached.any()
    assert error[reached].max() < EXACT
    if rig.startswith("ring"):
        assert (reached & (lit.sum(axis=0) == 3)).sum() > 100
    few = lit.sum(axis=0) < 3
    assert np.isnan(error[few]).all()
    assert (result.flags[capture.mask][few] & Flag.TOO_FEW_LIGHTS).all()
    np.testing.assert_allclose(result.albedo[capture.mask][reached], truth.albedo[capture.mask][reached], rtol=1e-8)
    assert_explained(result)


@functools.cache
def seen_by_few(rig):
    """Of very many normals, all that three or four lights of a rig reach, and a few others."""
    normals = random_normals(np.random.default_rng(4), 20_000 if len(RIGS[rig]) < MANY else 40_000, tilt=170.0)
    count = (RIGS[rig] @ normals.T > 0).sum(axis=0)
    chosen = (count == 3) | (count == 4)
    chosen[:1000] = True
    return normals[chosen]


@pytest.mark.parametrize("rig", ["spiral 12 to 75 deg", "spiral 24", "spiral 48"])
def test_exact_where_exactly_three_lights_reach_however_dim(method, rig):
    directions = RIGS[rig]
    if len(directions) < method.least_lights:
        assert_refused(method, directions)
        return
    normals = seen_by_few(rig)
    shade = np.maximum(directions @ normals.T, 0.0)
    count, reached = (shade > 0).sum(axis=0), conditions(shade > 0, directions) < 1e4
    dimmest = np.where(shade > 0, shade, np.inf).min(axis=0) / shade.max(axis=0, initial=1e-300)
    assert ((count == 3) & reached & (dimmest < 0.02)).sum() > 20  # the case that a gate can spoil is there
    result = estimate_normals(pixelwise(normals, directions, 0.3), method())
    assert angle(result.normals[0], normals)[reached].max() < EXACT
    away = reached & (normals[:, 2] < 0)
    assert away.sum() > 100
    np.testing.assert_array_equal((result.flags[0, reached] & Flag.FACING_AWAY) != 0, away[reached])
    if method.unknowns == 3:  # else the lights in shadow tell the rest, and are redundant
        assert (result.flags[0, reached & (count == 3)] & Flag.NO_REDUNDANCY).all()
    assert_explained(result)


@pytest.mark.parametrize("gate", sorted(GATES))
def test_exact_where_all_lights_reach(method, gate):
    capture, truth = hilly(arrange(method, spiral, 9, max_tilt=0.5), steepness=0.6)
    assert (frames(capture)[:, capture.mask] > 0).all()
    result = estimate_normals(capture, method(gate=GATES[gate]))
    assert angle(result.normals, truth.normals)[capture.mask].max() < EXACT
    assert result.outcome is Outcome.SOLVED
    assert result.normals.dtype == np.float64


@settings(max_examples=15)
@given(seed=st.integers(0, 2**32 - 1), lights=st.integers(3, 9), albedo=st.floats(1e-3, 1e3))
def test_exact_for_any_rig_and_any_normals(method, seed, lights, albedo):
    rng = np.random.default_rng(seed)
    directions, normals = random_normals(rng, lights, tilt=85.0), random_normals(rng, 40)
    assume(np.linalg.cond(directions) < 100)
    if lights < method.least_lights:
        assert_refused(method, directions)
        directions = np.concatenate([directions, random_normals(rng, MANY, tilt=85.0)])
    assume(np.linalg.cond(design(method, directions)) < 100)
    lit = directions @ normals.T > 0
    reached = conditions(lit, directions) < 1e3
    if method.unknowns > 3:  # with a light in shadow, fewer observations may have two exact explanations
        reached &= lit.all(axis=0) | (len(lit) >= 8) & (lit.sum(axis=0) >= 5)
    assume(reached.any())
    result = estimate_normals(pixelwise(normals, directions, albedo), method())
    assert angle(result.normals[0], normals)[reached].max() < EXACT
    np.testing.assert_allclose(result.albedo[0, reached], albedo, rtol=1e-8)
    assert_explained(result)


@pytest.mark.parametrize("scale", [1e-30, 1e30])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_tiny_and_huge_pixel_values(method, scale, dtype):
    capture, truth = hilly(arrange(method, spiral, 9, max_tilt=0.5), steepness=0.6)
    images = (frames(capture) * scale).astype(dtype)
    result = estimate_normals(with_images(capture, images), method())
    limit = EXACT if dtype is np.float64 else 1e-6
    assert angle(result.normals.astype(float), truth.normals)[capture.mask].max() < limit
    assert np.isfinite(result.uncertainty[capture.mask]).all()
    assert_explained(result)


def observations_used(solver, values, directions):
    """Return the observations that a solver lets take part, bool (m, p)."""
    state = solver.prepare(Rig.distant(directions))
    verdicts = solver.solve(state, Samples(values.astype(np.float64), verdicts=True)).verdicts
    assert verdicts.shape == values.shape
    return verdicts == Verdict.USED


@pytest.mark.parametrize(
    ("dtype", "step"), [(np.uint8, 1 / 255), (np.uint16, 1 / 65535), (np.float32, 2.0**-23), (np.float64, 2.0**-52)]
)
def test_every_type_of_pixel(method, dtype, step):
    directions = arrange(method, spiral, 12, max_tilt=0.5)
    capture, truth = hilly(directions, steepness=0.6)
    images = frames(capture)
    stored = np.rint(images / step).astype(dtype) if np.dtype(dtype).kind == "u" else images.astype(dtype)
    result = estimate_normals(with_images(capture, stored), method())
    # a value is off by half a step, b by |L⁺| √m times that; float32 output and conversion add a few units of 2⁻²⁴
    used = observations_used(method(), stored[..., 0][:, capture.mask], directions)
    rows = design(method, directions)
    worst = np.array([np.linalg.norm(np.linalg.pinv(rows[u])[:3], 2) * np.sqrt(u.sum()) for u in used.T])
    off = worst * step / 2 + 8 * 2.0**-24 * (step > 1e-15)
    length = truth.albedo * 1000 / np.pi / capture.radiance_at_white
    bound = np.arcsin(np.minimum(off / length[capture.mask], 1.0)) + (1e-11 if flexible(method) else 4e-15)
    error = angle(result.normals.astype(float), truth.normals)[capture.mask]
    assert (error <= bound).all()
    assert result.normals.dtype == result.albedo.dtype == (np.float64 if dtype is np.float64 else np.float32)
    assert_explained(result)


def test_samples_that_are_no_numbers_are_left_out_and_flagged(method):
    capture, truth = hilly(arrange(method, spiral, 9, max_tilt=0.5), steepness=0.6)
    images = frames(capture).copy()
    rng = np.random.default_rng(3)
    hit = rng.random(images.shape) < 0.2
    images[hit] = rng.choice([np.nan, np.inf, -np.inf], np.count_nonzero(hit))
    result = estimate_normals(with_images(capture, images), method())
    good = (~hit[..., 0]).sum(axis=0)
    enough = capture.mask & (good >= method.unknowns)
    assert angle(result.normals, truth.normals)[enough].max() < EXACT
    flagged = (result.flags & Flag.UNUSABLE_SAMPLE) != 0
    np.testing.assert_array_equal(flagged, capture.mask & hit.any(axis=(0, 3)))
    assert_explained(result)


def test_saturated_samples_are_left_out_or_not_as_the_gate_says(method):
    directions = arrange(method, spiral, 12, max_tilt=0.5)
    capture, truth = hilly(directions, steepness=0.6, bits=None)
    bright = frames(capture) * 1.3
    images = np.rint(np.minimum(bright, 1.0) * 65535).astype(np.uint16)
    capture = with_images(capture, images)
    over = images[..., 0] >= 0.98 * 65535
    hit = capture.mask & over.any(axis=0)
    fit = hit & ((~over).sum(axis=0) >= method.unknowns)
    assert fit.sum() > 100
    assert (images == 65535).any()
    careful = estimate_normals(capture, method(gate=GATES["auto"]))
    naive = estimate_normals(capture, method(gate=GATES["none"]))
    lit = conditions(~over[:, fit], design(method, directions))
    error = angle(careful.normals.astype(float), truth.normals)[fit]
    # rounding is 2⁻¹⁷ of full scale, √m of them, over the smallest singular value of what is left; bright cells
    assert (error <= 2.0**-17 * np.sqrt(len(directions)) * lit * 3 / 0.5).all()
    np.testing.assert_array_equal((careful.flags & Flag.UNUSABLE_SAMPLE) != 0, hit)
    assert np.degrees(angle(naive.normals.astype(float), truth.normals)[fit].max()) > 1.0
    assert not (naive.flags & Flag.UNUSABLE_SAMPLE).any()
    assert careful.facts["valid_range"] == pytest.approx([-np.inf, 0.98])
    assert naive.facts["valid_range"] is None


@pytest.mark.parametrize("directions", [ring(3)[:2], ring(3)[:1], np.zeros((0, 3))])
def test_fewer_than_three_lights_are_refused(method, directions):
    with pytest.raises(RigError, match="Three or more"):
        method().prepare(Rig.distant(directions))


@pytest.mark.parametrize(
    "directions",
    [
        np.column_stack([np.cos([0.1, 0.9, 2.0, 2.9]), np.zeros(4), np.sin([0.1, 0.9, 2.0, 2.9])]),
        np.repeat(ring(3)[:1], 5, axis=0),
        ring(3)[[0, 1, 0, 1, 1]],
        [[1, 0, 1], [0, 1, 1], [-1, 2, 1]],
    ],
)
def test_coplanar_lights_are_refused_before_anything_is_decoded(method, directions):
    rig = Rig.distant(directions)
    with pytest.raises(RigError, match="one plane"):
        method().prepare(rig)
    with pytest.raises(RigError, match="one plane"):
        estimate_normals(Capture(stack=MemoryStack(np.zeros((len(rig), 2, 2))), rig=rig), method())


def test_duplicate_lights_do_no_harm(method):
    directions = arrange(method, lambda count: ring(count)[[0, 1, 1, *range(2, count), count - 1, count - 1]], 5)
    capture, truth = hilly(directions, steepness=0.6)
    error = angle(estimate_normals(capture, method()).normals, truth.normals)
    assert error[capture.mask].max() < EXACT


def test_near_lights_are_refused(method):
    lamp = Led(position=(0, 0, 9), axis=(0, 0, -1), mu=1.0, flux=1.0)
    rig = Rig((*Rig.distant(ring(3)).lights, lamp))
    with pytest.raises(UnsupportedError, match=r"Light 4 \(led\)"):
        method().prepare(rig)


def test_lengths_of_light_vectors_do_not_matter(method):
    directions = arrange(method, ring, 5)
    capture, truth = hilly(directions, steepness=0.6)
    lengths = np.resize([1e-200, 1e200, 1.0, 1e-3, 1e100], len(directions))
    rig = Rig.distant(directions * lengths[:, None], np.full(len(directions), 1000.0))
    result = estimate_normals(with_images(capture, frames(capture), rig=rig), method())
    assert angle(result.normals, truth.normals)[capture.mask].max() < EXACT


def test_one_pixel(method):
    normal = np.array([[0.1, -0.2, np.sqrt(0.95)]])
    result = estimate_normals(pixelwise(normal, arrange(method, ring, 4)), method())
    assert result.normals.shape == (1, 1, 3)
    assert angle(result.normals[0], normal).max() < EXACT
    capture, truth = hilly(arrange(method, spiral, 12), steepness=0.6)
    mask = np.zeros_like(capture.mask)
    mask[15, 16] = True
    alone = estimate_normals(with_images(capture, frames(capture), mask=mask), method())
    assert angle(alone.normals, truth.normals)[15, 16] < EXACT
    np.testing.assert_array_equal(np.isfinite(alone.normals[..., 0]), mask)
