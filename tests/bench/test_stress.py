"""The judge of the cruel cases can fail what is silently wrong, and the cases that are quick pass."""

import numpy as np
import pytest

from psstereo.bench import read_records, write_records
from psstereo.bench.stress import Answer, Rule, StressCase, judge, run_case, run_stress
from psstereo.errors import InputError, OptionError, RigError
from psstereo.flags import Flag
from psstereo_cli.suites.stress import _notes, _plain, _row
from psstereo_synth.stress import STRESS_FAMILIES, grid_case, stress_cases

GOOD, BAD = np.zeros(4), np.array([0.0, 0.0, 5.0, 0.0])
LOST = np.array([0.0, np.nan, 0.0, 0.0])
RANK, REDUNDANCY = np.uint16(Flag.RANK_DEFICIENT), np.uint16(Flag.NO_REDUNDANCY)
QUICK = ("sun", "sources", "shading")


def case(run=None, **rule):
    return StressCase(family="f", name="n", parameter="p", run=run or (lambda _kind: None), **rule)


def at(place, flag):
    flags = np.zeros(4, np.uint16)
    flags[place] = flag
    return flags


@pytest.mark.parametrize("rule", [Rule.WITHIN, Rule.TOLD])
def test_a_value_beyond_its_bound_is_a_failure(rule):
    assert judge(case(rule=rule), "float64", Answer(error=GOOD, bound=1.0)).passed
    verdict = judge(case(rule=rule), "float64", Answer(error=BAD, bound=1.0))
    assert verdict.passed is False
    assert (verdict.measured, verdict.bound) == (5.0, 1.0)
    assert "1 are wrong and 0 missing" in verdict.why
    assert verdict.record("stress").error["passed"] == 0.0


@pytest.mark.parametrize("rule", [Rule.WITHIN, Rule.TOLD])
def test_a_missing_value_without_a_flag_is_a_failure(rule):
    verdict = judge(case(rule=rule), "float64", Answer(error=LOST, bound=1.0))
    assert verdict.passed is False
    assert "0 are wrong and 1 missing" in verdict.why


def test_a_flag_tells_only_if_it_is_fatal_or_agreed_upon():
    told = case(rule=Rule.TOLD)
    assert judge(told, "float64", Answer(error=LOST, bound=1.0, flags=at(1, RANK))).passed
    assert not judge(told, "float64", Answer(error=LOST, bound=1.0, flags=at(1, REDUNDANCY))).passed
    assert not judge(told, "float64", Answer(error=LOST, bound=1.0, flags=at(2, RANK))).passed  # elsewhere
    assert not judge(told, "float64", Answer(error=BAD, bound=1.0, flags=at(2, RANK))).passed  # and yet a number stands
    agreed = case(rule=Rule.TOLD, remarks=Flag.NO_REDUNDANCY)
    assert judge(agreed, "float64", Answer(error=BAD, bound=1.0, flags=at(2, REDUNDANCY))).passed
    strict = case(rule=Rule.WITHIN, remarks=Flag.NO_REDUNDANCY)
    assert not judge(strict, "float64", Answer(error=BAD, bound=1.0, flags=at(2, REDUNDANCY))).passed


def test_an_error_bar_tells_only_as_far_as_it_reaches():
    told = case(rule=Rule.TOLD)
    assert judge(told, "float64", Answer(error=BAD, bound=1.0, bar=np.full(4, 1.0))).passed
    assert not judge(told, "float64", Answer(error=BAD, bound=1.0, bar=np.full(4, 0.1))).passed
    assert not judge(told, "float64", Answer(error=BAD, bound=1.0, bar=np.full(4, np.nan))).passed


def test_the_flag_has_to_be_the_right_one_and_on_every_value():
    demand = case(rule=Rule.FLAGGED, demanded=Flag.RANK_DEFICIENT)
    gone, all_flags = np.full(4, np.nan), np.full(4, RANK)
    assert judge(demand, "float64", Answer(error=gone, bound=1.0, flags=all_flags)).passed
    assert not judge(demand, "float64", Answer(error=gone, bound=1.0, flags=at(1, RANK))).passed
    assert not judge(demand, "float64", Answer(error=GOOD, bound=1.0, flags=all_flags)).passed
    other = np.full(4, np.uint16(Flag.NOT_FINITE))
    assert not judge(demand, "float64", Answer(error=gone, bound=1.0, flags=other)).passed


def test_nothing_at_all_is_a_failure():
    assert judge(case(), "float64", Answer(error=np.zeros(0), bound=1.0)).why == "no value came out"


def refusing(error):
    def run(_kind):
        raise error(given="It.", needed="That.", remedy="Do.")

    return run


@pytest.mark.parametrize(
    ("rule", "refusals", "passed"),
    [
        (Rule.REFUSED, (RigError,), True),
        (Rule.TOLD, (InputError,), True),  # a RigError is one
        (Rule.TOLD, (OptionError,), False),
        (Rule.TOLD, (), False),
        (Rule.WITHIN, (RigError,), False),
        (Rule.FLAGGED, (RigError,), False),
    ],
)
def test_a_refusal_counts_where_it_is_agreed_upon(rule, refusals, passed):
    verdict = run_case(case(refusing(RigError), rule=rule, refusals=refusals), "float64")
    assert verdict.passed is passed
    assert verdict.told == "RigError: It."


def test_an_answer_where_there_is_none_is_a_failure():
    verdict = run_case(
        case(lambda _kind: Answer(error=GOOD, bound=1.0), rule=Rule.REFUSED, refusals=(RigError,)), "float64"
    )
    assert verdict.passed is False


def test_crashes_and_warnings_are_failures():
    def crash(_kind):
        raise ZeroDivisionError("oh")

    def warn(_kind):
        return Answer(error=np.float64([1e308]) * 10.0, bound=1.0)

    assert "ZeroDivisionError" in run_case(case(crash), "float64").why
    assert "overflow" in run_case(case(warn), "float64").why


def test_a_missing_package_is_said():
    verdict = run_case(case(refusing(RigError), needs="no_such_package"), "float64")
    assert verdict.passed is None
    assert "no_such_package" in verdict.why
    assert verdict.record("stress").error == {"passed": 1.0, "left_out": 1.0}


def test_a_solver_that_is_wrong_by_a_millionth_is_found(monkeypatch):
    """Not the judge alone: a real case, with an answer that was tampered with."""
    from psstereo_synth.stress import pixels

    chosen = next(one for one in stress_cases("lights") if one.name == "condition, least-squares")
    assert run_case(chosen, "float64").passed
    honest = pixels.relative
    monkeypatch.setattr(pixels, "relative", lambda found, scaled: honest(found, scaled) + 1e-6)
    verdict = run_case(chosen, "float64")
    assert verdict.passed is False
    assert verdict.measured > verdict.bound


@pytest.mark.parametrize("family", QUICK)
def test_quick_families_pass(family):
    verdicts = run_stress(stress_cases(family)[:: 6 if family == "shading" else 3])
    assert len(verdicts) > 8
    assert [(one.case.name, one.case.parameter, one.kind, one.why) for one in verdicts if not one.passed] == []


def test_least_squares_rounded_images_and_few_lit_lights_pass_throughout():
    wanted = ("least-squares", "round", "cast shadow, sparse-bayesian")
    chosen = [one for one in stress_cases("lights", "values") if any(name in one.name for name in wanted)]
    assert {one.name.split(",")[0] for one in chosen} >= {"rounding", "albedo ratio", "cast shadow", "cone"}
    verdicts = run_stress(chosen)
    assert len(verdicts) > 60
    assert [(one.case.name, one.case.parameter, one.kind) for one in verdicts if one.passed is False] == []


def test_refused_lights_name_what_is_not_told():
    chosen = [one for family in QUICK for one in stress_cases(family) if "names what is not told" in one.name]
    assert chosen
    assert all(one.passed for one in run_stress(chosen))


def test_cases_have_names_of_their_own_and_a_rule_that_can_be_met():
    cases = stress_cases()
    names = [(one.family, one.name, one.parameter) for one in cases]
    assert len(set(names)) == len(names) > 300
    for one in cases:
        assert (one.rule is not Rule.REFUSED) or one.refusals
        assert (one.rule is Rule.FLAGGED) == bool(one.demanded)
        assert not one.large
    assert grid_case(4096, 4096).large
    with pytest.raises(OptionError):
        stress_cases("wind")
    assert set(STRESS_FAMILIES) >= set(QUICK)


def test_table_notes_and_records(tmp_path):
    cases = [grid_case(24, 16), case(lambda _kind: Answer(error=BAD, bound=1.0))]
    verdicts = run_stress(cases)
    write_records(tmp_path / "all.jsonl", [one.record("stress") for one in verdicts])
    assert [one.error["passed"] for one in read_records(tmp_path / "all.jsonl")] == [1.0, 1.0, 0.0, 0.0]
    notes = _notes(verdicts)
    assert notes[0].startswith("4 runs: 2 passed, 2 failed")
    assert all(note.startswith("FAIL f: n, p, float") for note in notes[1:])
    assert _row(verdicts[:2])[7] == "pass"
    assert _row(verdicts[2:])[7] == "FAIL"
    assert _plain(verdicts[2])["why"]
