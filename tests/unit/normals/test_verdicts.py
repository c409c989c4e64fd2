"""Verdicts asked for, fed back and refused; the covariance beside them; masks of observations."""

import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.errors import InputError, UnsupportedError
from psstereo.flags import Flag
from psstereo.lights import Rig
from psstereo.normals import GATES, OUTSIDE, LeastSquares, PixelNormals, Samples, Verdict, estimate_normals
from psstereo.normals.channels import combine_covariances, combine_verdicts
from psstereo.normals.memory import plan_memory
from psstereo.results import Outcome
from psstereo.stack import MemoryStack, PixelSet
from psstereo_synth import checker, hills, lambertian_capture, spiral

LIGHTS, SIZE = 12, 48


@pytest.fixture(scope="module")
def scene():
    """Attached shadows, one region in cast shadow, some values saturated, all of 16 bit."""
    surface = hills(SIZE, SIZE, steepness=1.5)
    directions = spiral(LIGHTS, max_tilt=1.2)
    capture, truth = lambertian_capture(surface, checker((SIZE, SIZE)), directions, bits=16, noise=0.002)
    images = capture.stack.read().copy()
    images[3, 20:24, 20:30] = 0
    images[5, 30:33, 20:24] = 65535
    return Capture(stack=MemoryStack(images), rig=capture.rig, mask=capture.mask), truth


def test_nothing_is_told_that_was_not_asked_for(scene):
    result = estimate_normals(scene[0], LeastSquares())
    assert result.verdicts is None
    assert result.covariance is None
    assert result.used is None
    solver = LeastSquares()
    found = solver.solve(solver.prepare(scene[0].rig), Samples(np.ones((LIGHTS, 3))))
    assert found.verdicts is None
    assert found.covariance is None


def test_asking_changes_nothing_else(scene):
    plain = estimate_normals(scene[0], LeastSquares())
    asked = estimate_normals(scene[0], LeastSquares(), verdicts=True, covariance=True)
    for name in ("normals", "albedo", "uncertainty", "flags"):
        assert getattr(asked, name).tobytes() == getattr(plain, name).tobytes()


def test_verdicts_say_what_happened(scene):
    capture, truth = scene
    verdicts = estimate_normals(capture, LeastSquares(), verdicts=True).verdicts
    assert verdicts.shape == (LIGHTS, SIZE, SIZE)
    assert verdicts.dtype == np.uint8
    mask = capture.mask
    assert (verdicts[:, ~mask] == OUTSIDE).all()
    assert set(np.unique(verdicts[:, mask])) == {Verdict.USED, Verdict.SHADOW, Verdict.UNUSABLE}
    assert (verdicts[5, 30:33, 20:24] == Verdict.UNUSABLE).all()
    assert (verdicts[3, 20:24, 20:30] == Verdict.SHADOW).all()
    shade = np.einsum("mk,hwk->mhw", capture.rig.directions, truth.normals)
    sound = np.broadcast_to(mask, shade.shape) & (verdicts != Verdict.UNUSABLE)
    sound[3, 20:24, 20:30] = False
    assert (verdicts[sound & (shade < -0.1)] == Verdict.SHADOW).all()
    assert (verdicts[sound & (shade > 0.2)] == Verdict.USED).all()


@pytest.mark.parametrize("gate", ["none", "shadow"])
def test_counts_and_flags_agree_with_verdicts(scene, gate):
    solver = LeastSquares(gate=GATES[gate])
    capture = scene[0]
    values = capture.stack.read()[..., 0][:, capture.mask] / 65535
    values[4, 7] = np.nan
    weights = np.ones_like(values)
    weights[6, 9] = 0.0
    found = solver.solve(solver.prepare(capture.rig), Samples(values, weights, verdicts=True))
    np.testing.assert_array_equal((found.verdicts == Verdict.USED).sum(axis=0), found.used)
    assert found.verdicts[4, 7] == found.verdicts[6, 9] == Verdict.UNUSABLE
    assert (found.verdicts == Verdict.UNUSABLE).sum() == 2
    np.testing.assert_array_equal(
        (found.verdicts == Verdict.SHADOW).any(axis=0), (found.flags & Flag.SHADOWED).astype(bool)
    )
    assert (found.verdicts == Verdict.SHADOW).any() == (gate == "shadow")


def test_feeding_verdicts_back_gives_the_same_normals(scene):
    """Without a gate, what the gate had left out is left out by the verdicts."""
    capture = scene[0]
    first = estimate_normals(capture, LeastSquares(), verdicts=True)
    again = estimate_normals(capture, LeastSquares(gate=GATES["none"]), observation_mask=first.verdicts, verdicts=True)
    np.testing.assert_allclose(again.normals, first.normals, atol=1e-6)
    mask = capture.mask
    np.testing.assert_array_equal(again.verdicts[:, mask] == Verdict.USED, first.verdicts[:, mask] == Verdict.USED)
    assert set(np.unique(again.verdicts[:, mask])) == {Verdict.USED, Verdict.UNUSABLE}
    out = first.verdicts[:, mask] != Verdict.USED
    assert again.facts["left_out_by_hand"] == out.sum()
    assert first.facts["left_out_by_hand"] is None
    np.testing.assert_array_equal(out.any(axis=0), (again.flags[mask] & Flag.UNUSABLE_SAMPLE) > 0)


def test_a_mask_of_observations_is_as_good_as_their_absence(scene):
    """Left out are a light altogether and a patch of another one."""
    capture, _ = scene
    mask = np.ones((LIGHTS, SIZE, SIZE), bool)
    mask[2] = False
    mask[7, 10:30, 10:30] = False
    wild = capture.stack.read().copy()
    wild[~mask] = 40_000
    other = Capture(stack=MemoryStack(wild), rig=capture.rig, mask=capture.mask)
    expected = estimate_normals(capture, LeastSquares(), weights=mask.astype(float))
    for stack in (capture, other):
        for given in (mask, np.where(mask, Verdict.USED, Verdict.HIGHLIGHT).astype(np.uint8)):
            found = estimate_normals(stack, LeastSquares(), observation_mask=given)
            np.testing.assert_allclose(found.normals, expected.normals, atol=1e-6)
            np.testing.assert_array_equal(found.flags, expected.flags)


def test_which_verdicts_take_part(scene):
    capture, _ = scene
    takes_part = {}
    for code in (*Verdict, OUTSIDE):
        given = np.zeros((LIGHTS, SIZE, SIZE), np.uint8)
        given[0] = code
        facts = estimate_normals(capture, LeastSquares(), observation_mask=given).facts
        takes_part[int(code)] = facts["left_out_by_hand"] == 0
    assert {code for code, part in takes_part.items() if part} == {Verdict.USED, Verdict.NOT_NEEDED}


def test_a_black_image_may_be_left_out_by_hand(scene):
    capture, _ = scene
    images = capture.stack.read().copy()
    images[4] = 0
    broken = Capture(stack=MemoryStack(images), rig=capture.rig, mask=capture.mask)
    mask = np.ones((LIGHTS, SIZE, SIZE), bool)
    with pytest.raises(InputError, match="image 5 is black"):
        estimate_normals(broken, observation_mask=mask)
    mask[4] = False
    without = Capture(
        stack=MemoryStack(np.delete(images, 4, axis=0)),
        rig=capture.rig.select(np.arange(LIGHTS) != 4),
        mask=capture.mask,
    )
    expected = estimate_normals(without, LeastSquares())
    found = estimate_normals(broken, LeastSquares(), observation_mask=mask)
    np.testing.assert_allclose(found.normals, expected.normals, atol=1e-6)
    images[:] = 0
    with pytest.raises(InputError, match="All images are black"):
        estimate_normals(Capture(stack=MemoryStack(images), rig=capture.rig), observation_mask=mask)


@pytest.mark.parametrize(
    "mask",
    [
        np.ones((LIGHTS, SIZE, SIZE - 1), bool),
        np.ones((LIGHTS - 1, SIZE, SIZE), bool),
        np.ones((SIZE, SIZE), bool),
        np.ones((LIGHTS, SIZE, SIZE)),
        np.ones((LIGHTS, SIZE, SIZE), np.int64),
    ],
)
def test_masks_that_do_not_fit_are_refused(scene, mask):
    with pytest.raises(InputError, match="observation mask has the shape"):
        estimate_normals(scene[0], observation_mask=mask)


def test_codes_that_mean_nothing_are_refused(scene):
    mask = np.zeros((LIGHTS, SIZE, SIZE), np.uint8)
    mask[-1, -1, -1] = 77
    with pytest.raises(InputError, match="holds 77, which is no verdict") as caught:
        estimate_normals(scene[0], observation_mask=mask)
    assert "0 USED" in caught.value.needed


def least_memory(capture, gray):
    """The smallest bound that is accepted."""
    pixels, values = PixelSet.from_mask(capture.effective_mask), 3 if gray == "per-channel" else 1
    low, high = 0, 1 << 30
    while high - low > 1:
        middle = (low + high) // 2
        try:
            plan_memory(capture.stack, pixels, values, middle, 1, masked=True, verdicts=True, covariance=True)
            high = middle
        except InputError:
            low = middle
    return high


def test_the_covariance_lies_across_the_normal_and_has_the_uncertainty_for_trace(scene):
    capture, _ = scene
    result = estimate_normals(capture, LeastSquares(), covariance=True)
    assert result.covariance.shape == (SIZE, SIZE, 6)
    assert result.covariance.dtype == result.used.dtype == np.float32
    known = np.isfinite(result.uncertainty)
    np.testing.assert_array_equal(np.isfinite(result.covariance).all(axis=2), known)
    assert np.isnan(result.used[~capture.mask]).all()
    xx, xy, yy, xz, yz, zz = np.moveaxis(result.covariance[known].astype(float), -1, 0)
    np.testing.assert_allclose(xx + yy + zz, result.uncertainty[known].astype(float) ** 2, rtol=1e-5)
    matrix = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=1).reshape(-1, 3, 3)
    along = np.einsum("pij,pj->pi", matrix, result.normals[known].astype(float))
    assert (np.linalg.norm(along, axis=1) < 1e-5 * (xx + yy + zz)).all()
    assert (np.linalg.eigvalsh(matrix)[:, 0] > -1e-6 * (xx + yy + zz)).all()


def test_the_covariance_is_what_linear_algebra_says():
    """Against the inverse of the normal matrix, projected by hand."""
    rng, directions = np.random.default_rng(2), spiral(9, max_tilt=0.8)
    values, weights = rng.uniform(0.3, 1.0, (9, 20)), rng.uniform(0.5, 2.0, (9, 20))
    solver = LeastSquares(gate=GATES["none"])
    found = solver.solve(solver.prepare(Rig.distant(directions)), Samples(values, weights, covariance=True))
    for p in range(20):
        inverse = np.linalg.inv((directions.T * weights[:, p]) @ directions)
        b = inverse @ (directions.T * weights[:, p]) @ values[:, p]
        sigma2 = (weights[:, p] * (values[:, p] - directions @ b) ** 2).sum() / (9 - 3)
        rho = np.linalg.norm(b)
        across = np.eye(3) - np.outer(b, b) / rho**2
        expected = across @ inverse @ across * sigma2 / rho**2
        np.testing.assert_allclose(
            found.covariance[p], expected[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]], rtol=1e-8, atol=1e-14
        )


def channel(scaled, codes, used=6):
    scaled = np.atleast_2d(np.asarray(scaled, float))
    count = len(scaled)
    covariance = np.tile([4e-6, 1e-6, 2e-6, 0.0, 0.0, 0.0], (count, 1))
    return PixelNormals(
        scaled,
        np.sqrt(covariance[:, [0, 2, 5]].sum(axis=1)),
        np.zeros(count, np.uint16),
        np.full(count, used, np.uint16),
        covariance,
        np.asarray(codes, np.uint8)[:, None],
    )


def test_channels_agree_on_the_mildest_verdict():
    order = [
        Verdict.USED,
        Verdict.NOT_NEEDED,
        Verdict.SHADOW,
        Verdict.DARK_OUTLIER,
        Verdict.HIGHLIGHT,
        Verdict.UNUSABLE,
    ]
    worst = [Verdict.UNUSABLE] * len(order)
    lost = channel([np.nan] * 3, [Verdict.USED] * len(order))
    up = [0.0, 0.0, 1.0]
    assert combine_verdicts([channel(up, order), channel(up, worst)])[:, 0].tolist() == order
    assert combine_verdicts([channel(up, worst), channel(up, order), lost])[:, 0].tolist() == order
    assert combine_verdicts([lost, channel(up, worst)])[:, 0].tolist() == worst  # a lost channel has no say
    assert combine_verdicts([lost, lost])[:, 0].tolist() == [Verdict.USED] * len(order)  # unless all are


def test_equal_channels_share_variance_and_degrees_of_freedom():
    parts = [channel([0.0, 0.0, 0.5], [0])] * 3
    covariance, used = combine_covariances(parts, np.array([[0.0, 0.0, 1.0]]), np.full((1, 3), 0.5))
    np.testing.assert_allclose(covariance[0], parts[0].covariance[0] / 3, rtol=1e-12)
    np.testing.assert_allclose(used, [3 + 3 * 3], rtol=1e-12)
    weak = [channel([0.0, 0.0, 1.0], [0]), channel([0.0, 0.0, 1e-6], [0])]
    covariance, used = combine_covariances(weak, np.array([[0.0, 0.0, 1.0]]), np.array([[1.0, 1e-6]]))
    np.testing.assert_allclose(covariance[0], parts[0].covariance[0], rtol=1e-9)
    np.testing.assert_allclose(used, [6.0], rtol=1e-9)
    lost = [channel([0.0, 0.0, 1.0], [0]), channel([np.nan] * 3, [0])]
    covariance, used = combine_covariances(lost, np.array([[0.0, 0.0, 1.0]]), np.array([[1.0, np.nan]]))
    np.testing.assert_allclose(covariance[0], parts[0].covariance[0], rtol=1e-12)
    np.testing.assert_allclose(used, [6.0], rtol=1e-12)


class Silent(LeastSquares):
    """A solver that tells normals and nothing else."""

    def solve(self, state, samples):
        return super().solve(state, Samples(samples.values, samples.weights))


@pytest.mark.parametrize("what", ["verdicts", "covariance"])
def test_a_solver_that_does_not_tell_is_refused(scene, what):
    with pytest.raises(UnsupportedError, match="tells no"):
        estimate_normals(scene[0], Silent(), **{what: True})


class Restless(LeastSquares):
    """A solver that gives up at some pixels of each block."""

    every = 1000

    def solve(self, state, samples):
        found = super().solve(state, samples)
        found.flags[:: self.every] |= np.uint16(Flag.NOT_CONVERGED)
        return found


class Exhausted(Restless):
    """A solver that gives up at one pixel in ten."""

    every = 10


def test_pixels_that_did_not_converge_are_no_success(scene):
    few, many = estimate_normals(scene[0], Restless()), estimate_normals(scene[0], Exhausted())
    assert few.outcome is Outcome.PARTIAL  # the flags say which
    assert (few.flags & Flag.NOT_CONVERGED).any()
    assert many.outcome is Outcome.NOT_CONVERGED
