"""The benchmark's problems: what their names promise."""

import numpy as np
import pytest

from psstereo.metrics import summarise_angles
from psstereo.normals import GATES, LeastSquares, estimate_normals
from psstereo_synth.problems import lambertian_problems

PROBLEMS = {problem.name: problem for problem in lambertian_problems(48)}


def error(name, gate="auto"):
    capture, truth = PROBLEMS[name].make()
    result = estimate_normals(capture, LeastSquares(gate=GATES[gate]))
    return summarise_angles(result.normals, truth.normals, capture.mask)


@pytest.mark.parametrize("name", PROBLEMS)
def test_each_is_the_same_every_time(name):
    (first, truth), (again, _) = PROBLEMS[name].make(), PROBLEMS[name].make()
    assert first.stack.shape[1:3] == (48, 48)
    assert all(np.array_equal(first.stack.frame(i), again.stack.frame(i)) for i in range(len(first.stack)))
    assert truth.normals is not None
    assert PROBLEMS[name].summary


def test_exact_is_exact_only_with_the_gate():
    assert error("exact").max_deg < 1e-6
    assert error("exact", "none").mean_deg > 1


def test_fewer_bits_and_noise_are_harder():
    order = [error(name).mean_deg for name in ("exact", "16 bit", "8 bit", "noise")]
    assert order == sorted(order)
    assert order[1] < 0.1 * order[2]


def test_rigs_are_as_named():
    assert len(PROBLEMS["four lights"].make()[0].rig) == 4
    narrow = PROBLEMS["narrow cone"].make()[0].rig
    assert np.degrees(np.arccos(narrow.directions[:, 2])).max() <= 5
    assert narrow.condition() > 10
