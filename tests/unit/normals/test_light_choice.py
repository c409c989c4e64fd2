"""Given, refined and unknown lights: what is done, what is told, and options that belong elsewhere."""

import numpy as np
import pytest

from psstereo.errors import OptionError
from psstereo.normals.light_choice import LightChoice, LightSource, choose_lights
from psstereo_synth import checker, hills, lambertian_capture, spiral


@pytest.fixture(scope="module")
def capture():
    surface = hills(56, 56, steepness=1.5)
    return lambertian_capture(surface, checker((56, 56)), spiral(12), bits=None)[0]


def test_given_lights_are_left_alone(capture):
    chosen = choose_lights(capture, LightChoice())
    assert chosen.capture is capture
    assert (chosen.steps, chosen.facts, chosen.settled) == ((), {}, True)


def test_refined_lights_are_told(capture):
    chosen = choose_lights(capture, LightChoice(source=LightSource.REFINED, doubt=0.01), gray="per-channel")
    facts = chosen.facts["lights_refined"]
    assert [step.name for step in chosen.steps] == ["refined lights"]
    assert len(facts["moved_deg"]) == 12
    assert np.shape(facts["directions"]) == (12, 3)
    assert facts["disagreement_deg"] < 0.5
    assert "disagreement" not in facts


def test_unknown_lights_are_told_with_the_alternative(capture):
    chosen = choose_lights(capture, LightChoice(source=LightSource.UNKNOWN, relief="concave"))
    facts = chosen.facts["lights_found"]
    assert facts["relief"] == "concave"
    assert facts["ambiguity"] == "maxima"
    np.testing.assert_array_equal(facts["directions"], chosen.capture.rig.directions)
    np.testing.assert_allclose(facts["alternative_directions"], chosen.capture.rig.directions * [-1, -1, 1])
    assert np.shape(facts["strengths"]) == (12, 1)
    assert facts["integrability_ratio"] > 10
    assert chosen.settled


@pytest.mark.parametrize(
    ("source", "options", "belongs"),
    [
        (LightSource.GIVEN, {"ambiguity": "maxima"}, "unknown"),
        (LightSource.REFINED, {"relief": "convex"}, "unknown"),
        (LightSource.GIVEN, {"doubt": 0.1}, "refine"),
        (LightSource.UNKNOWN, {"doubt": 0.1, "relief": "convex"}, "refine"),
    ],
)
def test_an_option_of_another_source_is_refused(source, options, belongs):
    with pytest.raises(OptionError, match=f"lights that are {belongs}"):
        LightChoice(source=source, **options)
