"""The scene of the demo."""

import numpy as np
import pytest

from psstereo.metrics import summarise_angles
from psstereo.normals import estimate_normals
from psstereo_synth import demo_capture


def frames(capture):
    return np.stack([capture.stack.frame(i) for i in range(len(capture.stack))])


def test_it_is_what_its_options_say():
    capture, truth = demo_capture(40, lights=9)
    assert capture.stack.shape == (9, 40, 40, 1)
    assert capture.stack.dtype == np.uint16
    assert len(capture.rig) == 9
    assert truth.normals.shape == (40, 40, 3)
    assert truth.depth.shape == truth.albedo.shape == (40, 40)


def test_seeds_decide_noise_and_surface():
    first, again, other = (demo_capture(24, seed=seed) for seed in (5, 5, 6))
    assert np.array_equal(frames(first[0]), frames(again[0]))
    assert np.array_equal(first[1].normals, again[1].normals)
    assert not np.array_equal(first[1].normals, other[1].normals)
    still = demo_capture(24, seed=5, noise=0)[0]
    difference = frames(first[0]).astype(float) - frames(still)
    assert difference[difference != 0].std() == pytest.approx(0.002 * 65535, rel=0.2)


def test_its_error_is_the_one_that_the_residual_predicts():
    capture, truth = demo_capture(96)
    result = estimate_normals(capture)
    found = summarise_angles(result.normals, truth.normals, capture.mask)
    predicted = np.degrees(np.sqrt(np.nanmean(result.uncertainty.astype(float) ** 2)))
    assert found.rmse_deg == pytest.approx(predicted, rel=0.15)
    assert found.coverage == 1
