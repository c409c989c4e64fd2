"""The robust and the trimmed solver: options, refusals, dispatch, and what they are for."""

import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.errors import OptionError, RigError
from psstereo.kernels import robust as reference
from psstereo.lights import Rig
from psstereo.metrics import summarise_angles
from psstereo.normals import LeastSquares, estimate_normals
from psstereo.normals.robust import Robust
from psstereo.normals.solver import Samples
from psstereo.normals.trimmed import Trimmed
from psstereo.stack import MemoryStack
from psstereo.verdict import Verdict
from psstereo_synth import checker, hills, lambertian_capture, ring, spiral


def shiny(lights=32, share=0.1, seed=0, noise=0.0):
    """A matte capture in which some observations are brighter than they should be."""
    surface = hills(48, 48, steepness=1.0)
    capture, truth = lambertian_capture(surface, checker((48, 48)), spiral(lights), bits=None, noise=noise, seed=seed)
    images = capture.stack.read()
    hit = np.random.default_rng(seed).random(images.shape) < share
    return Capture(stack=MemoryStack(images + 0.4 * hit), rig=capture.rig, mask=capture.mask), truth


def error(capture, truth, solver):
    return summarise_angles(estimate_normals(capture, solver).normals, truth.normals, capture.mask).mean_deg


@pytest.mark.parametrize(
    ("loss", "share"),
    [
        ("auto", 1e-4),
        ("geman-mcclure", 1e-4),
        ("tukey", 0.1),
        ("welsch", 0.1),
        ("cauchy", 0.2),
        ("l1", 0.2),
        ("huber", 0.4),
    ],
)
def test_highlights_weigh_less_than_with_least_squares(loss, share):
    """Not at all under the narrow loss that finds the majority, less and less the faster a loss falls."""
    capture, truth = shiny()
    assert error(capture, truth, LeastSquares()) > 5
    assert error(capture, truth, Robust(loss=loss)) < share * error(capture, truth, LeastSquares())


def test_with_noise_alone_hardly_anything_is_lost_against_least_squares():
    capture, truth = shiny(share=0.0, noise=0.01)
    assert error(capture, truth, Robust()) < 1.15 * error(capture, truth, LeastSquares())


def test_a_given_scale_is_heeded():
    capture, truth = shiny(noise=0.005)
    strength = float(capture.rig.strengths(1)[0, 0])
    right = error(capture, truth, Robust(loss="tukey", scale=0.005 / strength))
    wide = error(capture, truth, Robust(loss="tukey", scale=1.0 / strength))
    assert right < 0.1 * error(capture, truth, LeastSquares())
    assert wide > 3 * right


def test_trimming_leaves_highlights_out_by_rank():
    capture, truth = shiny(share=0.08)
    assert error(capture, truth, Trimmed()) < 0.3 * error(capture, truth, LeastSquares())
    verdicts = (
        Trimmed()
        .solve(Trimmed().prepare(capture.rig), Samples(capture.stack.read()[..., 0][:, capture.mask], verdicts=True))
        .verdicts
    )
    assert 0.3 < (verdicts == Verdict.USED).mean() < 0.6
    assert (verdicts == Verdict.NOT_NEEDED).mean() > 0.3


@pytest.mark.parametrize(
    "options",
    [
        {"loss": "tuky"},
        {"scale": 0.0},
        {"scale": np.nan},
        {"loss": "huber", "tuning": -1.0},
        {"tuning": 1.0},
        {"rounds": 0},
    ],
)
def test_options_that_mean_nothing_are_refused(options):
    with pytest.raises(OptionError) as caught:
        Robust(**options)
    assert caught.value.remedy


@pytest.mark.parametrize("ranks", [(0.5, 0.5), (0.7, 0.3), (-0.1, 0.5), (0.2, 1.1), (np.nan, 0.5)])
def test_ranks_that_mean_nothing_are_refused(ranks):
    with pytest.raises(OptionError, match="ranks"):
        Trimmed(low=ranks[0], high=ranks[1])


def test_compiled_code_is_loaded_for_much_work_only():
    rig = Rig.distant(spiral(96))
    assert Robust().prepare(rig).fit is reference.robust_fit
    assert Robust().prepare(rig, 1000).fit is reference.robust_fit
    assert Robust().prepare(rig, 200_000).fit.__module__ == "psstereo.kernels.robust_compiled"


def test_pixels_whose_rounds_do_not_settle_are_left_to_least_squares(monkeypatch):
    capture, _ = shiny(noise=0.01)
    plain = estimate_normals(capture, LeastSquares()).normals[capture.mask]
    monkeypatch.setattr(reference, "MORE", 1)
    left = (estimate_normals(capture, Robust(loss="l1", rounds=1)).normals[capture.mask] == plain).all(axis=1)
    assert left.mean() > 0.9
    monkeypatch.undo()
    left = (estimate_normals(capture, Robust(loss="l1")).normals[capture.mask] == plain).all(axis=1)
    assert left.mean() < 0.01


def test_few_lights_get_least_squares():
    surface = hills(32, 32, steepness=0.6)
    capture, _ = lambertian_capture(surface, checker((32, 32)), ring(5), bits=None, noise=0.01)
    plain, robust = (estimate_normals(capture, solver) for solver in (LeastSquares(), Robust()))
    np.testing.assert_array_equal(plain.normals, robust.normals)
    with pytest.raises(RigError):
        estimate_normals(Capture(stack=MemoryStack(np.ones((2, 4, 4))), rig=Rig.distant(ring(2))), Robust())
