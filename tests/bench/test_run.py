"""Measuring: turns, repetitions, medians and ratios."""

import statistics

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.bench import Problem, Record, run_solvers, run_timed, summarise
from psstereo.errors import InputError
from psstereo.normals import GATES, LeastSquares
from psstereo_synth import demo_capture


def record(problem, method, repeat, seconds, **error):
    return Record(suite="s", problem=problem, method=method, repeat=repeat, seconds={"total": seconds}, error=error)


def test_methods_take_turns_and_the_first_round_does_not_count():
    turns = []
    told = []
    methods = {name: (lambda name=name: turns.append(name)) for name in "abc"}
    records = run_timed("s", "p", methods, repeats=3, sizes={"n": 5}, progress=lambda *words: told.append(words))
    assert turns == list("abc") * 4
    assert [(r.method, r.repeat) for r in records] == [(name, i) for i in range(3) for name in "abc"]
    assert all(r.sizes == {"n": 5} and r.seconds["total"] >= 0 and not r.error for r in records)
    assert told == [("suite s", i, 12) for i in range(1, 13)]


def test_solvers_are_scored_on_the_problem_that_is_made_once():
    made = []

    def make():
        made.append(1)
        return demo_capture(24, noise=0.0)

    methods = {name: LeastSquares(gate=GATES[name]) for name in ("none", "auto")}
    told = []
    records = run_solvers(
        "s",
        [Problem(name="hills", summary="-", make=make)],
        methods,
        repeats=2,
        progress=lambda *words: told.append(words),
    )
    assert made == [1]
    assert [(r.problem, r.method, r.repeat) for r in records] == [
        ("hills", "none", 0), ("hills", "auto", 0), ("hills", "none", 1), ("hills", "auto", 1),
    ]  # fmt: skip
    assert told == [("suite s", i, 6) for i in range(1, 7)]
    for r in records:
        assert set(r.error) == {"mean_deg", "median_deg", "rmse_deg", "p95_deg", "max_deg", "coverage"}
        assert r.error["coverage"] == 1
        assert r.error["mean_deg"] < 0.1
        assert r.seconds["total"] >= r.seconds["read"] + r.seconds["solve"] - 1e-3
        assert (r.sizes["lights"], r.sizes["width"], r.sizes["height"]) == (12, 24, 24)
        assert Record.from_json(r.to_json()) == r


def test_without_true_normals_only_time_is_measured():
    def make():
        capture, truth = demo_capture(24)
        return capture, type(truth)(depth=truth.depth)

    records = run_solvers("s", [Problem(name="p", summary="-", make=make)], {"a": LeastSquares()}, repeats=1)
    assert records[0].error == {}


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.floats(0.1, 10), st.floats(0.1, 10)), min_size=1, max_size=9))
def test_ratios_are_medians_of_each_rounds_own_ratio(rounds):
    records = [
        r for i, (a, b) in enumerate(rounds) for r in (record("p", "a", i, a, mean=a), record("p", "b", i, b, mean=b))
    ]
    first, second = summarise(records, "a")
    assert (first.method, first.ratio) == ("a", 1)
    assert second.ratio == statistics.median(b / a for a, b in rounds)
    assert second.seconds == statistics.median(b for _, b in rounds)
    assert second.error == {"mean": statistics.median(b for _, b in rounds)}


def test_a_machine_that_slows_down_changes_times_but_no_ratio():
    records = [record("p", m, i, 2.0**i * t) for i in range(5) for m, t in (("a", 1.0), ("b", 3.0))]
    assert [s.ratio for s in summarise(records, "a")] == [1, 3]


def test_problems_are_kept_apart():
    records = [record(p, m, 0, t) for p, m, t in (("p", "a", 1), ("p", "b", 2), ("q", "a", 10), ("q", "b", 5))]
    assert [(s.problem, s.method, s.ratio) for s in summarise(records, "a")] == [
        ("p", "a", 1), ("p", "b", 2), ("q", "a", 1), ("q", "b", 0.5),
    ]  # fmt: skip


def test_a_round_without_the_baseline_is_told():
    with pytest.raises(InputError, match="Round 1 of the problem 'p' has no record of 'a'"):
        summarise([record("p", "a", 0, 1.0), record("p", "b", 0, 1.0), record("p", "b", 1, 1.0)], "a")
