"""What is surveyed agrees with what the scene was made of, and costs no second look at a file."""

from dataclasses import replace

import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.lights import Rig
from psstereo.metrics import summarise_angles
from psstereo.normals import LeastSquares, Robust
from psstereo.pipeline import Options, plan_capture, reconstruct
from psstereo.plan.trials import attempt, folds, judged
from psstereo.stack import MemoryStack
from psstereo_synth import checker, hills, lambertian_capture, spiral


class CountingStack(MemoryStack):
    """A stack that counts how often each image is asked for."""

    def __init__(self, images):
        super().__init__(images)
        self.asked = np.zeros(len(images), int)

    def frame(self, index):
        self.asked[index] += 1
        return super().frame(index)


def scene(count=16, *, steepness=1.2, tilt=1.0, **options):
    surface = hills(64, 64, steepness=steepness)
    return lambertian_capture(surface, checker((64, 64)), spiral(count, max_tilt=tilt), bits=16, **options)


def over(capture, images, **changes):
    return Capture(stack=MemoryStack(images), rig=capture.rig, mask=capture.mask, **changes)


def test_every_image_is_decoded_once():
    capture, _ = scene()
    stack = CountingStack(capture.stack.read())
    watched = replace(capture, stack=stack)
    reconstruct(watched)
    assert (stack.asked == 1).all()
    plan_capture(watched)
    assert (stack.asked == 2).all()


def test_noise_is_told():
    capture, truth = scene(24, steepness=0.4, tilt=0.5, noise=0.01)
    facts = plan_capture(capture).facts
    pixels = capture.stack.read()[..., 0] / capture.stack.white
    clean = truth.normals @ capture.rig.directions.T
    albedo = np.nanmedian((pixels / np.moveaxis(clean, -1, 0))[:, capture.mask], axis=0)
    spread = np.median(np.abs(pixels[:, capture.mask] / albedo - np.moveaxis(clean, -1, 0)[:, capture.mask])) * 1.4826
    assert facts.noise == pytest.approx(spread, rel=0.15)
    assert facts.misfit < 0.03
    assert facts.trials == ()


def test_attached_shadow_is_told():
    capture, truth = scene(24, steepness=2.5, tilt=1.3)
    facts = plan_capture(capture).facts
    behind = (truth.normals[capture.mask] @ capture.rig.directions.T <= 0).mean()
    assert behind > 0.02
    assert facts.shadowed == pytest.approx(behind, rel=0.1)
    assert make_uses(facts, "shadow gate")


def make_uses(facts, stage):
    from psstereo.plan.plan import make_plan

    return make_plan(facts)[stage].use


def test_saturation_is_told():
    capture, _ = scene()
    images = np.minimum(capture.stack.read().astype(np.float64) * 2, 65535).astype(np.uint16)
    facts = plan_capture(over(capture, images)).facts
    there = (images[:, capture.mask] >= 0.98 * 65535).any(axis=2).mean()
    assert facts.saturated == pytest.approx(there, rel=1e-9)
    assert there > 0.05


def test_highlights_call_for_a_rival_and_get_one():
    capture, truth = scene(16)
    half = capture.rig.directions + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half, axis=1)[:, None]
    shine = np.nan_to_num(np.maximum(np.moveaxis(truth.normals @ half.T, -1, 0), 0)) ** 60
    images = (capture.stack.read()[..., 0] * 0.5 + 0.45 * 65535 * shine).astype(np.uint16)
    glossy = over(capture, images)
    facts = plan_capture(glossy).facts
    assert facts.misfit > 0.1
    assert facts.bright_outliers > 0.01
    assert {"least-squares", "robust", "response-bend"} <= {one.solver for one in facts.trials}
    found = reconstruct(glossy, Options(integrator=None)).normals
    plain = reconstruct(glossy, Options(integrator=None, solver=LeastSquares())).normals
    errors = [summarise_angles(one.normals, truth.normals, capture.mask).mean_deg for one in (found, plain)]
    assert errors[0] < 0.3 * errors[1]


def test_ambient_light_is_found_and_solved():
    capture, _ = scene(24, steepness=0.8, tilt=0.9)
    lit = over(capture, (capture.stack.read() * 0.6 + 0.1 * 65535).astype(np.uint16))
    plan = plan_capture(lit)
    assert plan["ambient solving"].use
    assert plan.facts.ambient > 20 * plan.facts.ambient_error > 0


def test_what_is_asked_for_is_not_looked_into():
    capture, _ = scene()
    answer = reconstruct(capture, Options(solver=Robust(loss="huber"), integrator=None))
    assert answer.normals.facts["solver"] == "robust"
    assert answer.normals.facts["options"]["loss"] == "huber"
    assert answer.plan.facts.trials == ()
    assert answer.plan.facts.turning is None
    assert answer.plan["robust solving"].options["settings"] == {"loss": "huber"}


def test_memory_is_no_matter_for_what_is_found():
    capture, _ = scene(12)
    plain, tight = plan_capture(capture), plan_capture(capture, Options(max_memory=3_000_000))
    assert tight.facts.noise == plain.facts.noise
    assert tight.facts.misfit == plain.facts.misfit


def test_sectors_leave_each_light_out_once():
    for count in (8, 13, 24, 31, 96):
        rig = Rig.distant(spiral(count))
        left = [set(range(count)) - set(stays.tolist()) for stays in folds(rig)]
        assert sorted(one for part in left for one in part) == list(range(count))
        assert max(map(len, left)) - min(map(len, left)) <= 1


def test_a_trial_is_exact_on_matte_samples_and_refuses_what_the_solver_refuses():
    rig = Rig.distant(spiral(24))
    normals = np.array([[0.1, 0.2, 1.0], [-0.3, 0.1, 1.0]])
    values = np.maximum(rig.directions @ normals.T, 0.0)
    found = attempt(LeastSquares(), rig, values)
    (trial,) = judged([found], rig, values)
    assert trial.change_deg < 1e-9
    assert trial.apart_deg == 0
    np.testing.assert_allclose(found.scaled, normals, atol=1e-12)
    assert attempt(LeastSquares(), rig.select([0, 1, 2]), values[:3]) is None
