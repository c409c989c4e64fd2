import numpy as np
import pytest

from psstereo.results import AlbedoKind, DepthKind, DepthResult, NormalsResult, Outcome


def test_outcomes_are_sentences_for_a_person():
    assert {outcome.name: outcome.converged for outcome in Outcome} == {
        "SOLVED": True,
        "PARTIAL": True,
        "NOT_CONVERGED": False,
    }
    assert all(outcome.value.endswith(".") and outcome.value[0].isupper() for outcome in Outcome)


def test_results_are_frozen():
    nothing = np.zeros((1, 1))
    normals = NormalsResult(normals=nothing, albedo=nothing, uncertainty=nothing, flags=nothing)
    depth = DepthResult(depth=nothing, kind=DepthKind.HEIGHT, unit="px", components=nothing, iterations=0, residual=0.0)
    assert normals.albedo_kind is AlbedoKind.RELATIVE
    assert normals.facts == depth.facts == {}
    for result in (normals, depth):
        assert result.outcome is Outcome.SOLVED
        with pytest.raises(AttributeError):
            result.outcome = Outcome.PARTIAL
