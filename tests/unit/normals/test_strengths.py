"""Unknown strengths of lights: what is recovered, on what it does not depend, how far to trust it, what is refused."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.errors import InputError
from psstereo.io import read_capture
from psstereo.lights import Rig, StrengthUnit
from psstereo.metrics import angular_error
from psstereo.normals import LeastSquares, estimate_normals
from psstereo.normals.strength_choice import StrengthChoice, choose_strengths
from psstereo.normals.strength_steps import StrengthSystem, closed_form, strength_system
from psstereo.normals.strengths import estimate_strengths
from psstereo.normals.thinning import sample_grid
from psstereo.results import Outcome
from psstereo.stack import MemoryStack
from psstereo.verdict import Verdict
from psstereo_synth import ring, spiral
from tests.unit.normals.strength_captures import bent, drawn, hilly, lit_by, relative, seen

# --- what is recovered ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "directions", [ring(4), ring(5), spiral(8), spiral(24, max_tilt=np.radians(75))], ids=["4", "5", "8", "24 to 75°"]
)
def test_without_noise_strengths_are_exact_in_spite_of_shadows(directions):
    capture, strengths = hilly(directions), drawn(len(directions))
    found = estimate_strengths(lit_by(capture, strengths))
    assert np.abs(relative(found.strengths, strengths)).max() < 1e-8
    assert found.strengths.mean() == pytest.approx(1.0)
    assert found.outcome is Outcome.SOLVED
    known = estimate_normals(capture, LeastSquares()).normals
    again = estimate_normals(found.capture, LeastSquares()).normals
    assert np.nanmax(angular_error(known, again)) < 1e-7


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**31), st.integers(4, 12))
def test_any_strengths_of_any_scattered_lights(seed, count):
    rng = np.random.default_rng(seed)
    turn, tilt = np.arange(count) * 2.4 + rng.uniform(0, 0.5, count), rng.uniform(0.3, 0.8, count)
    directions = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], axis=1)
    strengths = drawn(count, seed)
    found = estimate_strengths(lit_by(hilly(directions, 20, steepness=1.0), strengths))
    assert np.abs(relative(found.strengths, strengths)).max() < 1e-6


def test_noise_averages_out_and_is_not_taken_for_model_error():
    strengths = drawn(12)
    found = estimate_strengths(lit_by(hilly(noise=0.01), strengths))
    error = np.sqrt((relative(found.strengths, strengths) ** 2).mean())
    assert error < 0.004
    assert error < found.health.expected_error < 0.02


def test_highlights_and_saturated_values_do_not_count():
    capture, strengths = hilly(spiral(24)), drawn(24)
    images = capture.stack.read()
    hit = np.random.default_rng(1).random(images.shape) < 0.1
    found = estimate_strengths(lit_by(replace(capture, stack=MemoryStack(images + 0.5 * hit)), strengths))
    assert np.abs(relative(found.strengths, strengths)).max() < 0.01

    images = images * strengths[:, None, None, None]
    clipped = np.round(np.minimum(images / np.quantile(images, 0.7), 1.0) * 65535).astype(np.uint16)
    assert (clipped == 65535).mean() > 0.2
    found = estimate_strengths(replace(capture, stack=MemoryStack(clipped)))
    assert np.abs(relative(found.strengths, strengths)).max() < 1e-4
    with pytest.raises(InputError, match="leave the strengths"):  # were they taken for brightness
        estimate_strengths(replace(capture, stack=MemoryStack(clipped)), valid_range=(-1.0, 2.0))


def test_each_channel_has_a_factor_of_its_own_if_asked():
    capture, strengths = hilly(tint=True), drawn(12, channels=3)
    found = estimate_strengths(lit_by(capture, strengths), gray="per-channel")
    assert found.strengths.shape == (12, 3)
    assert np.abs(relative(found.strengths, strengths)).max() < 1e-8
    assert np.allclose(found.rig.strengths(3), found.strengths * capture.rig.strengths(3))
    one = estimate_strengths(lit_by(capture, strengths[:, :1]))
    assert one.strengths.shape == (12,)
    assert np.abs(relative(one.strengths, strengths[:, 0])).max() < 1e-8


def test_a_light_that_reaches_little_of_the_object_is_not_taken_for_weak():
    directions = np.vstack([spiral(12), [[np.sin(1.65), 0.0, np.cos(1.65)]]])  # five degrees behind
    capture, strengths = hilly(directions), drawn(13)
    lit = (capture.stack.read()[-1] > 0)[capture.effective_mask].mean()
    assert 0.01 < lit < 0.5
    found = estimate_strengths(lit_by(capture, strengths))
    assert np.abs(relative(found.strengths, strengths)).max() < 1e-7


# --- what it does not depend on ---------------------------------------------------------------------------------------


def test_the_answer_follows_strengths_order_and_exposure():
    capture, strengths = hilly(noise=0.01), drawn(12)
    plain = estimate_strengths(capture).strengths
    shifted = estimate_strengths(lit_by(capture, strengths)).strengths
    assert np.abs(relative(shifted, plain * strengths)).max() < 1e-3
    brighter = estimate_strengths(lit_by(capture, np.full(12, 1e-6))).strengths
    assert np.allclose(brighter, plain, rtol=1e-9)
    order = np.random.default_rng(2).permutation(12)
    mixed = replace(capture, stack=MemoryStack(capture.stack.read()[order]), rig=capture.rig.select(order))
    assert np.allclose(estimate_strengths(mixed).strengths, plain[order], rtol=1e-6)


def test_nominal_strengths_change_the_factors_and_not_the_answer():
    capture, strengths = hilly(), drawn(12)
    nominal = drawn(12, seed=5)
    told = replace(lit_by(capture, strengths), rig=Rig.distant(capture.rig.directions, nominal))
    found = estimate_strengths(told)
    assert np.abs(relative(found.strengths * nominal, strengths)).max() < 1e-8
    assert np.abs(relative(found.rig.strengths(1)[:, 0], strengths)).max() < 1e-8
    assert found.rig.strength_unit is StrengthUnit.RELATIVE
    assert "from the images" in found.rig.source


def test_threads_give_the_same_bytes():
    capture = lit_by(hilly(noise=0.01), drawn(12))
    alone = estimate_strengths(capture)
    with ThreadPoolExecutor(4) as pool:
        together = estimate_strengths(capture, over=pool.map)
    assert alone.strengths.tobytes() == together.strengths.tobytes()
    assert alone.health == together.health


def test_the_input_stays_as_it_is():
    capture = lit_by(hilly(), drawn(12))
    before, rig = capture.stack.read().copy(), capture.rig
    estimate_strengths(capture)
    assert np.array_equal(capture.stack.read(), before)
    assert capture.rig is rig


def test_observations_left_out_by_hand_have_no_say():
    capture, strengths = hilly(spiral(24)), drawn(24)
    images = capture.stack.read() * strengths[:, None, None, None]
    spoilt = images.copy()
    spoilt[3, :, :20] *= 3.0
    mask = np.ones(images.shape[:3], np.bool_)
    mask[3, :, :20] = False
    dirty = replace(capture, stack=MemoryStack(spoilt))
    found = estimate_strengths(dirty, observation_mask=mask)
    assert np.abs(relative(found.strengths, strengths)).max() < 1e-8
    verdicts = np.where(mask, np.uint8(Verdict.USED), np.uint8(Verdict.UNUSABLE))
    assert np.array_equal(estimate_strengths(dirty, observation_mask=verdicts).strengths, found.strengths)
    with pytest.raises(InputError, match="observation mask"):
        estimate_strengths(dirty, observation_mask=mask[:-1])
    mask[3] = False
    with pytest.raises(InputError, match="Only 0 pixels"):
        estimate_strengths(dirty, observation_mask=mask)


# --- the algebra ------------------------------------------------------------------------------------------------------


def test_the_closed_form_is_exact_where_all_lights_reach():
    directions, strengths = spiral(9, max_tilt=np.radians(30)), drawn(9)
    normals = bent(0.5).reshape(-1, 3)
    normals = normals[(directions @ normals.T > 0).all(axis=0)]
    found, ratio = closed_form((directions @ normals.T) * strengths[:, None], directions)
    assert np.abs(relative(found, strengths)).max() < 1e-9
    assert ratio > 1e6


def test_the_system_is_the_derivative_of_the_residual_with_normals_removed():
    """Against the sum of squares itself, whose normals numpy's solver removes."""
    from psstereo.normals.low_rank_fit import fit_normals

    rng, directions = np.random.default_rng(0), spiral(6)
    values = np.maximum(directions @ bent(1.0, 6).reshape(-1, 3).T, 0.05) + 0.05 * rng.standard_normal((6, 36))
    weights = rng.uniform(0.5, 1.0, values.shape)
    fit = fit_normals(values, directions, weights)

    def cost(logarithms):
        lights, total = np.exp(logarithms)[:, None] * directions, 0.0
        for v, w in zip(values.T, weights.T, strict=True):
            root = np.sqrt(w)
            total += np.linalg.lstsq(root[:, None] * lights, root * v, rcond=None)[1].item() / 2
        return total

    step = 1e-5
    slope = [(cost(step * one) - cost(-step * one)) / (2 * step) for one in np.eye(6)]
    system = strength_system(values, directions, fit)
    np.testing.assert_allclose(system.right, -np.array(slope), rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(system.matrix @ np.ones(6), 0.0, atol=1e-10)
    assert 0 < system.determinacy() < 1
    moved = system.solve()
    assert moved.sum() == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(system.matrix @ moved, system.right - system.right.mean(), atol=1e-9)
    assert cost(moved) < cost(np.zeros(6))


def test_a_light_without_information_leaves_no_determinacy():
    matrix = np.diag([1.0, 1.0, 0.0])
    assert StrengthSystem(matrix, np.zeros(3)).determinacy() == 0.0


# --- the thinned grid -------------------------------------------------------------------------------------------------


def test_the_grid_thins_and_finds_masks_that_it_would_miss():
    capture = hilly(size=40)
    grid = sample_grid(capture, gray="mean", limit=400, strengths=True)
    assert grid.step == 2
    assert grid.values.shape == (1, 12, grid.mask.sum())
    assert grid.values.shape[2] <= 400
    odd = np.zeros((40, 40), np.bool_)
    odd[1::2, 1::2] = True
    thin = sample_grid(replace(capture, mask=odd), gray="mean", limit=100, strengths=False)
    assert thin.step == 2
    frames = capture.stack.read()[:, 1::2, 1::2, 0]
    np.testing.assert_allclose(thin.values[0], frames.reshape(12, -1)[:, thin.mask.ravel()], rtol=1e-6)
    assert thin.mask.all()


# --- whose strengths --------------------------------------------------------------------------------------------------


def test_given_and_equal_strengths():
    capture = replace(hilly(), rig=Rig.distant(spiral(12), drawn(12), source="a file"))
    taken = choose_strengths(capture, StrengthChoice.GIVEN)
    assert taken.capture is capture
    assert not taken.step.done
    assert not taken.facts
    equal = choose_strengths(capture, StrengthChoice.EQUAL)
    assert np.array_equal(equal.capture.rig.strengths(1), np.ones((12, 1)))
    assert equal.capture.rig.source == "a file, strengths taken as equal"
    assert equal.step.done


def test_a_wrong_strength_is_named_with_its_size():
    capture, strengths = hilly(noise=0.003), drawn(12)
    told = replace(lit_by(capture, strengths), rig=Rig.distant(spiral(12), strengths))
    fine = choose_strengths(told, StrengthChoice.CHECKED)
    assert fine.capture is told
    assert "agree with the images" in fine.step.reason
    wrong = strengths.copy()
    wrong[6] /= 1.3
    rig = Rig.distant(spiral(12), wrong)
    checked = choose_strengths(replace(told, rig=rig), StrengthChoice.CHECKED)
    assert checked.capture.rig is rig
    assert "disagree with the images" in checked.step.reason
    assert "light 7 by +30 %." in checked.step.reason
    assert checked.facts["light_strengths"]["choice"] == "checked"
    many = choose_strengths(replace(told, rig=Rig.distant(spiral(12))), StrengthChoice.CHECKED)
    assert " more." in many.step.reason


def test_what_cannot_be_checked_is_said_and_what_is_unknown_is_refused():
    flat = seen(bent(0.0), spiral(12), 0.01)
    checked = choose_strengths(flat, StrengthChoice.CHECKED)
    assert checked.capture is flat
    assert not checked.step.done
    assert "could not be checked" in checked.step.reason
    with pytest.raises(InputError):
        choose_strengths(flat, StrengthChoice.UNKNOWN)


def test_unknown_strengths_come_with_their_figures():
    strengths = drawn(12)
    chosen = choose_strengths(lit_by(hilly(), strengths), StrengthChoice.UNKNOWN)
    assert chosen.settled
    assert np.abs(relative(chosen.capture.rig.strengths(1)[:, 0], strengths)).max() < 1e-8
    facts = chosen.facts["light_strengths"]
    assert np.abs(relative(np.array(facts["factors"]), strengths)).max() < 1e-8
    assert facts["residual_after"] < facts["residual_before"]
    assert facts["outcome"] == "solved"


# --- real captures ----------------------------------------------------------------------------------------------------


def test_a_figure_under_lamps_of_unknown_strength(data_dir):
    """PSBox's cat: plain least squares leaves a residual of 0.198 with equal strengths."""
    capture, _ = read_capture(data_dir / "psbox_cat")
    health = estimate_strengths(capture).health
    assert health.residual_before == pytest.approx(0.199, abs=0.002)
    assert health.residual_after <= 0.045
    assert health.expected_error < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ballPNG", "catPNG"])
def test_hidden_strengths_of_photographs(data_dir, name):
    from psstereo.normals.robust import Robust

    capture, truth = read_capture(data_dir / "diligent" / name)
    images = capture.stack.read().astype(np.float32) / np.float32(capture.stack.white)
    known = replace(capture, stack=MemoryStack(images))
    strengths = drawn(96, seed=1).astype(np.float32)
    found = estimate_strengths(lit_by(known, strengths))
    assert np.abs(relative(found.strengths, strengths)).mean() < 0.02
    assert found.health.expected_error < 0.06
    every_third = np.zeros_like(capture.mask)
    every_third[::3, ::3] = capture.mask[::3, ::3]
    for solver in (LeastSquares(), Robust()):
        before, after = (
            np.degrees(np.nanmean(angular_error(estimate_normals(one, solver).normals, truth.normals)[every_third]))
            for one in (replace(known, mask=every_third), replace(found.capture, mask=every_third))
        )
        assert abs(after - before) < 0.4
