import numpy as np
import pytest

from psstereo.calibrate.object_lights import calibrate_from_object
from psstereo.errors import OptionError
from psstereo.lights import Rig
from psstereo.metrics import angular_error
from tests.unit.normals.strength_captures import drawn, hilly, lit_by, relative


def tilted(directions, degrees, seed=3):
    """Return directions that are off by about so much."""
    wrong = directions + np.random.default_rng(seed).normal(0, np.radians(degrees), directions.shape)
    return wrong / np.linalg.norm(wrong, axis=1, keepdims=True)


def test_strengths_come_from_the_object():
    capture, strengths = hilly(), drawn(12)
    found = calibrate_from_object(lit_by(capture, strengths))
    told = found.rig.strengths(1)[:, 0]
    assert np.abs(relative(told, strengths)).max() < 1e-6
    np.testing.assert_allclose(found.rig.directions, capture.rig.directions)
    assert found.quality.strength_error.shape == (12,)
    assert found.quality.direction_error is None
    assert found.directions is None
    assert "strengths to" in found.quality.verdict


def test_directions_are_refined_after_strengths():
    capture, strengths = hilly(), drawn(12)
    truth = capture.rig.directions
    nominal = tilted(truth, 2.0)
    lit = lit_by(capture, strengths, rig=Rig.distant(nominal))
    found = calibrate_from_object(lit, directions=True)
    before, after = angular_error(nominal, truth), angular_error(found.rig.directions, truth)
    assert np.sqrt((after**2).mean()) < 0.6 * np.sqrt((before**2).mean())
    assert found.quality.direction_error.shape == (12,)
    assert found.quality.residual_angle > 0
    assert "directions refined" in found.quality.verdict


def test_nothing_to_do_is_refused():
    with pytest.raises(OptionError, match="Neither"):
        calibrate_from_object(hilly(), strengths=False)
