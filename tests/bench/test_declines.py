"""A method that refuses a problem is recorded with its reason, and the others are measured."""

import math

import pytest

from psstereo.bench import Problem, Record, run_solvers, run_timed, summarise
from psstereo.errors import InputError, UnsupportedError
from psstereo.normals import LeastSquares
from psstereo.normals.bivariate import Bivariate
from psstereo_synth import demo_capture


def refuse():
    raise UnsupportedError(given="The light is near.", needed="Distant lights.", remedy="Use another.")


def test_a_solver_that_needs_more_lights_declines_and_the_other_is_measured():
    problem = Problem(name="hills", summary="-", make=lambda: demo_capture(16, lights=12))
    methods = {"bivariate": Bivariate(), "plain": LeastSquares()}
    for warm_up in (True, False):
        records = run_solvers("s", [problem], methods, repeats=2, warm_up=warm_up)
        assert [(r.method, r.repeat, r.declined is None) for r in records] == [
            ("bivariate", 0, False),
            ("plain", 0, True),
            ("plain", 1, True),
        ]
        assert records[0].declined == "There are 12 lights. The solver bivariate needs 20 or more."
        assert not records[0].seconds
        assert not records[0].error
        assert Record.from_json(records[0].to_json()) == records[0]


def test_work_that_refuses_declines_and_any_other_error_ends_the_run():
    turns = []
    records = run_timed("s", "p", {"no": refuse, "yes": lambda: turns.append(1)}, repeats=2, sizes={})
    assert [(r.method, r.declined) for r in records] == [
        ("no", "The light is near. Distant lights."),
        ("yes", None),
        ("yes", None),
    ]
    assert len(turns) == 3

    def damaged():
        raise InputError(given="The file is damaged.", needed="A sound one.", remedy="Copy it again.")

    with pytest.raises(InputError, match="damaged"):
        run_timed("s", "p", {"no": damaged}, repeats=1, sizes={})


def test_summaries_keep_who_declined_and_ratios_need_a_baseline_that_did_not():
    def record(method, seconds, repeat=0, **more):
        return Record(suite="s", problem="p", method=method, repeat=repeat, seconds=seconds, **more)

    no = record("a", {}, declined="why")
    yes = [record("b", {"total": t}, repeat) for repeat, t in enumerate((2.0, 4.0, 8.0, 16.0))]
    for records in ([no, *yes], [*yes, no]):
        found = {s.method: s for s in summarise(records, "a")}
        assert found["a"].declined == "why"
        assert math.isnan(found["a"].seconds)
        assert (found["b"].seconds, found["b"].declined) == (6.0, None)
        assert math.isnan(found["b"].ratio)
    found = {s.method: s for s in summarise([no, *yes], "b")}
    assert found["b"].ratio == 1
    assert found["b"].spread == pytest.approx(10.0 - 3.5)  # quartiles by linear interpolation
    assert math.isnan(found["a"].ratio)
    first, other = summarise([no, *yes], None)
    assert math.isnan(first.ratio)
    assert math.isnan(other.ratio)
