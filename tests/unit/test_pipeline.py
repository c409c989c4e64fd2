from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.depth import Poisson
from psstereo.lights import Rig
from psstereo.normals import GATES, LeastSquares, estimate_normals
from psstereo.pipeline import Options, reconstruct
from psstereo.results import DepthKind, Outcome
from psstereo.stack import MemoryStack, Response
from psstereo_synth import checker, hills, lambertian_capture, spiral


def scene(size=64, *, bits=None, steepness=0.6, **options):
    surface = hills(size, size, steepness=steepness)
    return lambertian_capture(surface, checker((size, size)), spiral(12, max_tilt=0.6), bits=bits, **options)


def steps_of(capture, **options):
    return {step.name: step for step in reconstruct(capture, Options(**options)).steps}


def changed(capture, images=None, **changes):
    stack = MemoryStack(capture.stack.read() if images is None else images)
    return Capture(**{"stack": stack, "rig": capture.rig, "mask": capture.mask} | changes)


def test_hills_come_back_to_a_hundredth_of_a_pixel():
    capture, truth = scene(256)
    answer = reconstruct(capture)
    mask = capture.mask
    gap = (answer.depth.depth - truth.depth)[mask]
    assert np.abs(gap - gap.mean()).max() < 0.01
    assert np.ptp(truth.depth[mask]) > 10
    assert answer.depth.kind is DepthKind.HEIGHT
    assert answer.converged
    assert answer.normals.outcome is answer.depth.outcome is Outcome.SOLVED
    assert np.isnan(answer.depth.depth[~mask]).all()
    assert len(answer.mesh.vertices) == mask.sum()


def test_normals_only():
    capture, _ = scene()
    answer = reconstruct(capture, Options(integrator=None))
    assert answer.depth is None
    assert answer.mesh is None
    assert answer.converged
    last = answer.steps[-1]
    assert (last.name, last.done, last.seconds) == ("depth and mesh", False, 0.0)
    assert "Only normals" in last.reason
    assert answer.normals.normals.tobytes() == estimate_normals(capture, LeastSquares()).normals.tobytes()


def test_what_was_done_is_said():
    capture, _ = scene(bits=16)
    steps = steps_of(capture)
    assert list(steps) == [
        "linearisation",
        "dark level",
        "flat field",
        "light strengths",
        "near lamps",
        "reading",
        "survey",
        "saturation gate",
        "shadow gate",
        "observation mask",
        "tiling",
        "ambient solving",
        "robust solving",
        "non-Lambertian solving",
        "compiled kernels",
        "normals (least-squares)",
        "perspective",
        "discontinuities",
        "depth (poisson)",
        "mesh",
    ]
    done = {name for name, step in steps.items() if step.done}
    timed = {"reading", "survey", "normals (least-squares)", "depth (poisson)", "mesh"}
    assert done == timed | {"saturation gate"}  # so shallow that no light leaves a shadow
    for name in timed:
        assert steps[name].seconds > 0
    for name in set(steps) - done:
        assert steps[name].seconds == 0
    assert all(step.reason.endswith(".") for step in steps.values())
    assert "12 images" in steps["reading"].reason
    assert f"{capture.mask.sum()} pixels under 12 lights" in steps["normals (least-squares)"].reason
    assert "0.98 of full scale" in steps["saturation gate"].reason
    assert f"{capture.mask.sum()} vertices" in steps["mesh"].reason


@pytest.mark.parametrize("gate", sorted(GATES))
def test_gates_are_told_apart(gate):
    chosen = GATES[gate]
    steps = steps_of(scene(bits=16)[0], solver=LeastSquares(gate=chosen), integrator=None)
    assert steps["shadow gate"].done == chosen.shadow
    assert ("left out" in steps["shadow gate"].reason) == chosen.shadow
    assert "saturat" not in steps["shadow gate"].reason.lower()
    assert steps["saturation gate"].done == chosen.saturation
    assert ("leaves saturated values in" in steps["saturation gate"].reason) == (not chosen.saturation)


def test_floats_have_no_full_scale():
    steps = steps_of(scene()[0], integrator=None)
    assert not steps["saturation gate"].done
    assert "floating-point" in steps["saturation gate"].reason
    given = steps_of(scene()[0], integrator=None, valid_range=(0.0001, 0.9))
    assert given["saturation gate"].done
    assert "0.0001 to 0.9 of full scale" in given["saturation gate"].reason


def test_response_and_dark_are_said_and_undone():
    capture, truth = scene()
    light = capture.stack.read() * 0.9 + 0.05
    encoded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    dark = np.full((64, 64, 1), 0.05)
    other = changed(capture, encoded, response=Response("srgb"), dark=dark)
    answer = reconstruct(other, Options(integrator=None))
    steps = {step.name: step for step in answer.steps}
    assert steps["linearisation"].done
    assert "srgb" in steps["linearisation"].reason
    assert steps["dark level"].done
    # the standard's rounded constants leave 1e-8 of light, some 1e-7 of the dimmest pixels
    assert np.abs(answer.normals.normals - truth.normals)[capture.mask].max() < 2e-6


def test_tiling_is_said():
    capture, _ = scene(128)
    plain = steps_of(capture, integrator=None)["tiling"]
    tight = steps_of(capture, integrator=None, max_memory=2_500_000)["tiling"]
    assert (plain.done, tight.done) == (False, True)
    assert "in memory" in plain.reason
    assert "in temporary file" in tight.reason


def test_threads_change_nothing():
    capture, _ = scene(100, bits=16, noise=0.01)
    plain = reconstruct(capture)
    with ThreadPoolExecutor(3) as pool:
        again = reconstruct(capture, over=pool.map)
    assert again.depth.depth.tobytes() == plain.depth.depth.tobytes()
    assert again.mesh.vertices.tobytes() == plain.mesh.vertices.tobytes()


def test_not_converged_is_said():
    capture, _ = scene()
    options = Options(integrator=Poisson(max_iterations=1, tolerance=1e-15))
    answer = reconstruct(capture, options)
    assert answer.converged == (answer.depth.outcome is not Outcome.NOT_CONVERGED)
    assert not answer.converged


def test_progress_names_every_stage():
    seen = []
    reconstruct(scene()[0], progress=lambda stage, done, total: seen.append((stage, done, total)))
    stages = list(dict.fromkeys(stage for stage, _, _ in seen))
    assert stages[:2] == ["reading images", "solving pixels"]
    assert len(stages) >= 3
    assert all(0 <= done <= total for _, done, total in seen)


def test_the_rig_decides_before_the_integrator():
    capture, _ = scene()
    flat = Rig.distant(np.column_stack([np.cos(np.arange(12.0)), np.sin(np.arange(12.0)), np.zeros(12)]))
    with pytest.raises(ValueError, match="one plane"):
        reconstruct(changed(capture, rig=flat))
