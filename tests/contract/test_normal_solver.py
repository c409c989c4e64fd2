"""What every normal solver promises; a new one is tested by being listed in the catalogue."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from psstereo.capture import Capture
from psstereo.errors import InputError, RigError, UnsupportedError
from psstereo.flags import Flag, fatal_mask
from psstereo.lights import Led, Rig
from psstereo.normals import GATES, NORMAL_SOLVERS, Samples, estimate_normals
from psstereo.normals.memory import BLOCK, plan_memory
from psstereo.results import Outcome
from psstereo.stack import MemoryStack, PixelSet
from psstereo.verdict import Verdict
from psstereo_synth import checker, hills, lambertian_capture, ring, spiral

EXACT = np.radians(1e-6)
RIGS = {
    "ring 3": ring(3),
    "ring 5": ring(5),
    "spiral 12 to 75 deg": spiral(12, max_tilt=np.radians(75)),
    "spiral 24": spiral(24),
    "spiral 48": spiral(48),
}
MANY = 48
"""Lights for a method that refuses the few which others get."""


@pytest.fixture(scope="module", params=sorted(NORMAL_SOLVERS))
def method(request):
    return NORMAL_SOLVERS[request.param]


def angle(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(-1))


def assert_refused(method, directions):
    """Assert that a method refuses so few lights before anything is decoded, and says what would serve."""
    for attempt in (
        lambda: method().prepare(Rig.distant(directions)),
        lambda: estimate_normals(pixelwise(np.array([[0.0, 0.0, 1.0]]), directions), method()),
    ):
        with pytest.raises(RigError, match=f"needs {method.least_lights} or more") as caught:
            attempt()
        assert str(len(directions)) in caught.value.given
        assert "least-squares" in caught.value.remedy


def on_one_circle(method, directions):
    """Whether lights stand on one circle, which tells nobody a constant besides the normal."""
    rows = np.column_stack([directions, np.ones(len(directions))])
    return method.unknowns > 3 and len(directions) > 3 and np.linalg.matrix_rank(rows, tol=1e-9) < 4


def assert_circle_refused(method, directions):
    with pytest.raises(RigError, match="on one circle") as caught:
        method().prepare(Rig.distant(directions))
    assert "least-squares" in caught.value.remedy


def design(method, directions):
    """Light matrix, with a column of ones where a constant is unknown too."""
    return np.column_stack([directions, np.ones(len(directions))]) if method.unknowns > 3 else directions


def arrange(method, make, count, **how):
    """Directions of some lights; of many for a method that refuses so few, once it has done so."""
    directions = make(count, **how)
    if on_one_circle(method, directions):
        assert_circle_refused(method, directions)
        return np.concatenate([directions, [[0.0, 0.0, 1.0]]])
    if count >= method.least_lights:
        return directions
    assert_refused(method, directions)
    return make(MANY, **how)


def flexible(method):
    """Whether a method has more unknowns than the normal, for which Lambert's law would be too easy a trial."""
    return method.least_lights > 3


def trial(method, count, size=64, *, many=MANY, **how):
    """A capture of hills for what holds whatever the surface is like; not matte for methods that look for that.

    Those get many lights too, so that what they do beyond Lambert's law has a part in the answer.
    """
    make = {key: how.pop(key) for key in ("max_tilt",) if key in how}
    if not flexible(method):
        return hilly(spiral(count, **make), size, **how)[0]
    arrange(method, spiral, count, **make)  # for its refusal
    capture, _ = hilly(spiral(max(many, method.least_lights), **make), size, **how)
    images = frames(capture)
    white = 65535.0 if images.dtype == np.uint16 else 1.0
    bent = white * np.maximum(images / white, 0.0) ** 1.4
    return with_images(capture, np.rint(bent).astype(np.uint16) if white > 1 else bent)


def hilly(directions, size=64, *, steepness=1.0, bits=None, noise=0.0, tint=False):
    surface = hills(size, size, steepness=steepness)
    albedo = checker((size, size), tint=tint)
    return lambertian_capture(surface, albedo, directions, bits=bits, noise=noise)


def frames(capture):
    return capture.stack.read()


def with_images(capture, images, **changes):
    kept = {"rig": capture.rig, "mask": capture.mask} | changes
    return Capture(stack=MemoryStack(images), **kept)


def pixelwise(normals, directions, albedo=1.0, **changes):
    """A capture whose image is a list of normals."""
    values = np.maximum(directions @ normals.T, 0.0) * albedo
    return Capture(stack=MemoryStack(values[:, None]), rig=Rig.distant(directions), **changes)


def random_normals(rng, count, *, tilt=80.0):
    z = rng.uniform(np.cos(np.radians(tilt)), 1.0, count)
    turn = rng.uniform(0, 2 * np.pi, count)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)


def conditions(lit, directions):
    """Condition number of the lights (or of rows of a design) that reach each pixel, (p,)."""
    shown = np.where(lit.T[..., None], directions, 0.0)
    values = np.linalg.svd(shown, compute_uv=False)
    with np.errstate(divide="ignore", invalid="ignore"):
        return values[:, 0] / values[:, -1]


def assert_explained(result):
    unknown = ~np.isfinite(result.normals).all(axis=2)
    np.testing.assert_array_equal(unknown, fatal_mask(result.flags))
    known = result.normals[~unknown]
    tolerance = 4 * np.finfo(known.dtype).eps
    np.testing.assert_allclose(np.linalg.norm(known.astype(float), axis=1), 1.0, rtol=0, atol=tolerance)
    np.testing.assert_array_equal(np.isnan(result.normals).all(axis=2), unknown)
    assert (result.albedo[~unknown] > 0).all()
    assert np.isnan(result.albedo[unknown]).all()
    assert np.isnan(result.uncertainty[unknown]).all()


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


@pytest.mark.parametrize("rig", ["spiral 12 to 75 deg", "spiral 24", "spiral 48"])
def test_exact_where_exactly_three_lights_reach_however_dim(method, rig):
    directions = RIGS[rig]
    if len(directions) < method.least_lights:
        assert_refused(method, directions)
        return
    normals = random_normals(np.random.default_rng(4), 20_000 if len(directions) < MANY else 40_000, tilt=170.0)
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


@settings(max_examples=30, deadline=None)
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


def test_outside_the_mask_there_is_nothing(method):
    capture = trial(method, 12)
    result = estimate_normals(capture, method())
    outside = ~capture.mask
    assert outside.any()
    for image in (result.normals, result.albedo, result.uncertainty):
        assert np.isnan(image[outside]).all()
    assert (result.flags[outside] == Flag.OUTSIDE_MASK).all()
    assert not (result.flags[~outside] & Flag.OUTSIDE_MASK).any()
    assert_explained(result)


def test_what_lies_outside_the_mask_does_not_matter(method):
    capture = trial(method, 12, noise=0.01)
    images = frames(capture).copy()
    images[:, ~capture.mask] = np.random.default_rng(1).uniform(-5, 5, images[:, ~capture.mask].shape)
    first = estimate_normals(capture, method())
    second = estimate_normals(with_images(capture, images), method())
    assert first.normals.tobytes() == second.normals.tobytes()


def test_the_order_of_lights_is_irrelevant(method):
    capture = trial(method, 12, max_tilt=1.2, noise=0.01, steepness=1.5)
    order = np.random.default_rng(2).permutation(len(capture.rig))
    first = estimate_normals(capture, method())
    swapped = with_images(capture, frames(capture)[order], rig=capture.rig.select(order))
    second = estimate_normals(swapped, method())
    np.testing.assert_allclose(second.normals, first.normals, rtol=0, atol=1e-11)
    np.testing.assert_allclose(second.uncertainty, first.uncertainty, rtol=1e-9)
    np.testing.assert_array_equal(second.flags, first.flags)


@pytest.mark.parametrize("factor", [2.0**-40, 2.0**30])
def test_brightness_scales_the_albedo_only(method, factor):
    capture = trial(method, 12, max_tilt=1.2, noise=0.01, steepness=1.5)
    first = estimate_normals(with_images(capture, frames(capture)), method())
    second = estimate_normals(with_images(capture, frames(capture) * factor), method())
    assert second.normals.tobytes() == first.normals.tobytes()  # powers of two are exact
    assert second.uncertainty.tobytes() == first.uncertainty.tobytes()
    np.testing.assert_array_equal(second.albedo, first.albedo * factor)


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


def test_a_quarter_turn_of_the_picture_turns_the_normals(method):
    capture = trial(method, 12, max_tilt=1.2, noise=0.01, steepness=1.5)
    images = np.rot90(frames(capture), axes=(1, 2)).copy()
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rig = Rig.distant(capture.rig.directions @ quarter.T, capture.rig.strengths(1))
    first = estimate_normals(capture, method())
    second = estimate_normals(with_images(capture, images, rig=rig, mask=np.rot90(capture.mask).copy()), method())
    np.testing.assert_allclose(second.normals, np.rot90(first.normals) @ quarter.T, rtol=0, atol=1e-11)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), turn=st.floats(-np.pi, np.pi), tip=st.floats(-0.5, 0.5))
def test_turning_rig_and_surface_turns_the_normals(method, seed, turn, tip):
    rng = np.random.default_rng(seed)
    tip = 0.0 if method.sees_the_eye else tip
    c, s, ct, st_ = np.cos(turn), np.sin(turn), np.cos(tip), np.sin(tip)
    rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, ct, -st_], [0, st_, ct]])
    directions, normals = arrange(method, spiral, 8), random_normals(rng, 30, tilt=30.0)
    noisy = np.maximum(directions @ normals.T + rng.normal(0, 0.01, (len(directions), 30)), 0.05)
    if flexible(method):
        noisy **= 1.4
    first, second = (
        estimate_normals(Capture(stack=MemoryStack(noisy[:, None]), rig=Rig.distant(turned)), method())
        for turned in (directions, directions @ rotation.T)
    )
    # Reflectance that depends on the eye is fitted by steps, which end where they gain nothing any more.
    ends, rounding = (1e-6, 1e-9) if method.sees_the_eye else (1e-11, 1e-14)
    np.testing.assert_allclose(second.normals, first.normals @ rotation.T, rtol=0, atol=ends)
    np.testing.assert_allclose(second.uncertainty, first.uncertainty, rtol=1e3 * ends, atol=rounding)


def least_memory(capture, values, workers=1):
    """The smallest bound that is accepted."""
    pixels = PixelSet.from_mask(capture.effective_mask)
    low, high = 0, 1 << 40
    while high - low > 1:
        middle = (low + high) // 2
        try:
            plan_memory(capture.stack, pixels, values, middle, workers)
            high = middle
        except InputError:
            low = middle
    return high


@pytest.mark.parametrize("bits", [None, 16])
@pytest.mark.parametrize("gray", ["mean", "per-channel"])
def test_any_tiling_and_any_number_of_threads_gives_the_same_bytes(method, gray, bits):
    capture = trial(method, 12, 120, many=16, max_tilt=1.2, noise=0.01, steepness=2.0, bits=bits, tint=gray != "mean")
    values = 3 if gray != "mean" else 1
    limit = least_memory(capture, values)
    tile = plan_memory(capture.stack, PixelSet.from_mask(capture.mask), values, limit, 1).tile
    assert capture.mask.sum() > 3 * tile  # several tiles, the last of them short
    assert capture.mask.sum() % BLOCK
    expected = estimate_normals(capture, method(), gray=gray)
    answers = [estimate_normals(capture, method(), gray=gray)]
    for workers in (3,) if flexible(method) else (1, 2, 3):  # those take long
        with ThreadPoolExecutor(workers) as pool:
            answers.append(estimate_normals(capture, method(), gray=gray, over=pool.map))
            answers.append(estimate_normals(capture, method(), gray=gray, over=pool.map, max_memory=limit))
    answers.append(estimate_normals(capture, method(), gray=gray, max_memory=limit))
    assert [a.facts["samples_in"] for a in answers[-2:]] == ["temporary file"] * 2
    assert expected.facts["samples_in"] == "memory"
    for answer in answers:
        for name in ("normals", "albedo", "uncertainty", "flags"):
            assert getattr(answer, name).tobytes() == getattr(expected, name).tobytes(), name


def test_any_split_of_the_pixels_gives_the_same_numbers(method):
    capture = trial(method, 12, max_tilt=1.2, noise=0.01, steepness=2.0)
    values = frames(capture)[..., 0][:, capture.mask]
    solver = method()
    state = solver.prepare(capture.rig)
    whole = solver.solve(state, Samples(values))
    for cut in (1, 7, 1000):
        parts = [solver.solve(state, Samples(part)) for part in (values[:, :cut], values[:, cut:])]
        split = np.concatenate([p.scaled for p in parts])
        np.testing.assert_allclose(split, whole.scaled, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(np.concatenate([p.flags for p in parts]), whole.flags)


def test_solving_leaves_its_input_alone(method):
    capture = trial(method, 12, max_tilt=1.2, noise=0.01)
    values = frames(capture)[..., 0][:, capture.mask].copy()
    values[2, 5] = np.nan
    weights = np.ones_like(values)
    for array in (values, weights):
        array.setflags(write=False)
    solver = method()
    solver.solve(solver.prepare(capture.rig), Samples(values, weights))


def test_solver_and_state_pickle(method):
    capture = trial(method, 12, noise=0.01)
    solver = method(gate=GATES["shadow"])
    state = solver.prepare(capture.rig)
    samples = Samples(frames(capture)[..., 0][:, capture.mask])
    expected = solver.solve(state, samples)
    assert pickle.loads(pickle.dumps(solver)) == solver
    again = pickle.loads(pickle.dumps(solver)).solve(pickle.loads(pickle.dumps(state)), samples)
    assert again.scaled.tobytes() == expected.scaled.tobytes()
    result = estimate_normals(capture, solver)
    assert pickle.loads(pickle.dumps(result)).normals.tobytes() == result.normals.tobytes()


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
    mask[30, 33] = True
    alone = estimate_normals(with_images(capture, frames(capture), mask=mask), method())
    assert angle(alone.normals, truth.normals)[30, 33] < EXACT
    np.testing.assert_array_equal(np.isfinite(alone.normals[..., 0]), mask)


def test_a_weight_of_zero_leaves_an_observation_out(method):
    directions = arrange(method, spiral, 12, max_tilt=0.5)
    capture, truth = hilly(directions, steepness=0.6)
    images, weights = frames(capture).copy(), np.full((len(directions), 64, 64), 2.0)
    bad = np.random.default_rng(5).random(weights.shape) < 0.3
    images[bad] = 7.0
    weights[bad] = 0.0
    weights[:, 30, 30] = 0.0
    result = estimate_normals(with_images(capture, images), method(), weights=weights)
    enough = capture.mask & ((~bad).sum(axis=0) >= method.unknowns)
    enough[30, 30] = False
    assert angle(result.normals, truth.normals)[enough].max() < EXACT
    assert result.flags[30, 30] & Flag.TOO_FEW_LIGHTS
    assert not result.flags[30, 30] & Flag.NO_SIGNAL  # nobody looked
    assert_explained(result)


def test_equal_weights_are_no_weights(method):
    capture = trial(method, 12, max_tilt=1.2, noise=0.01, steepness=1.5)
    plain = estimate_normals(capture, method())
    weighted = estimate_normals(capture, method(), weights=np.full((len(capture.rig), 64, 64), 0.125))
    np.testing.assert_allclose(weighted.normals, plain.normals, rtol=0, atol=1e-11)
    np.testing.assert_array_equal(weighted.flags, plain.flags)


def test_progress_rises_to_the_end(method):
    seen = {}
    capture = trial(method, 12, 100, many=24)
    estimate_normals(
        capture, method(), progress=lambda stage, done, total: seen.setdefault(stage, []).append(done / total)
    )
    assert list(seen) == ["reading images", "solving pixels"]
    for steps in seen.values():
        assert steps == sorted(steps)
        assert steps[-1] == 1.0
