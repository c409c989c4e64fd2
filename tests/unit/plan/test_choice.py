"""What a plan decides follows from the facts alone."""

from dataclasses import replace

import pytest

from psstereo.normals import (
    NORMAL_SOLVERS,
    LeastSquares,
    Robust,
    bipolynomial,
    bivariate,
    exemplar,
    response_bend,
    robust,
    sparse_bayesian,
)
from psstereo.plan.choice import choose_by_facts
from psstereo.plan.contestants import CONTESTANTS
from psstereo.plan.costs import COSTS
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.plan import make_plan
from psstereo.plan.stages.catalogue import STAGES
from psstereo.plan.trials import Trial

MATTE = Facts(
    images=24, height=100, width=120, channels=1, bits=16, floating=False, saturates=True, pixels=9000, components=1,
    perspective=False, linear=True, response="linear", dark_frame=False, lamps=False, surveyed=8000, unusable=0.0,
    saturated=0.0, shadowed=0.1, dark_outliers=0.0, bright_outliers=0.0, noise=0.01, residual=0.01, misfit=0.002,
    turning=0.0, sample_bytes=864_000,
)  # fmt: skip


def tried(**changes):
    trials = tuple(
        Trial(solver=name.replace("_", "-"), change_deg=change, apart_deg=change, pixels=100, seconds=0.01)
        for name, change in changes.items()
    )
    return replace(MATTE, misfit=0.5, trials=trials)


def test_noise_alone_needs_no_rival_of_least_squares():
    assert choose_by_facts(MATTE).solver == LeastSquares.name
    assert choose_by_facts(replace(MATTE, misfit=0.5)).solver == Robust.name
    assert choose_by_facts(replace(MATTE, bright_outliers=0.02)).solver == Robust.name


def test_few_lights_need_none_either():
    facts = replace(tried(robust=0.1), images=7)
    assert choose_by_facts(facts).solver == LeastSquares.name


@pytest.mark.parametrize(
    ("changes", "solver"),
    [
        ({"least_squares": 3.0, "robust": 1.0, "response_bend": 2.0}, "robust"),
        ({"least_squares": 3.0, "robust": 1.0, "response_bend": 0.5}, "response-bend"),
        ({"robust": 1.03, "bivariate": 1.0}, "bivariate"),
        ({"robust": 0.0012, "bivariate": 0.0006}, "robust"),
        # exemplars stay unless another one seems twice as good
        ({"robust": 0.6, "exemplar": 1.0}, "exemplar"),
        ({"robust": 0.4, "exemplar": 1.0}, "robust"),
        # where Lambert's law is broken, least squares moves less than it errs
        ({"least_squares": 0.8, "robust": 1.0}, "robust"),
        ({"least_squares": 0.6, "robust": 1.0}, "least-squares"),
        ({"ambient": 0.6, "robust": 1.0}, "ambient"),
        ({"trimmed": 0.9, "robust": 1.0}, "trimmed"),
    ],
)
def test_the_least_doubtful_is_taken(changes, solver):
    assert choose_by_facts(tried(**changes)).solver == solver


def beside(angles, last="exemplar"):
    """Return facts of trials in which solvers are so far from the last one, whose doubt is 1°."""
    facts = tried(**dict.fromkeys(angles, 3.0), **{last: 1.0})
    trials = [replace(one, beside_deg=angles.get(one.solver.replace("-", "_"))) for one in facts.trials]
    return replace(facts, trials=tuple(trials))


@pytest.mark.parametrize(
    ("angles", "solver"),
    [
        ({"least_squares": 0.5, "robust": 0.5}, "exemplar"),
        ({"least_squares": 0.5, "robust": 0.3}, "robust"),
        ({"least_squares": 0.2, "robust": 0.1}, "least-squares"),
    ],
)
def test_a_quicker_solver_with_nearly_the_same_normals_is_as_good(angles, solver):
    choice = choose_by_facts(beside(angles))
    assert choice.solver == solver
    assert ("nearly the same" in choice.reason) == (solver != "exemplar")


def test_only_normals_of_the_best_make_another_as_good():
    facts = beside({"least_squares": 0.2, "robust": 0.3})
    better = replace(facts.trials[1], change_deg=0.1, apart_deg=0.1)
    assert choose_by_facts(replace(facts, trials=(facts.trials[0], better, facts.trials[2]))).solver == "robust"


def test_exemplars_have_no_start_over_those_that_are_near():
    facts = beside({"least_squares": 2.0, "robust": 0.5})
    least, robust, exemplar = facts.trials
    assert choose_by_facts(facts).solver == "exemplar"
    better = replace(robust, change_deg=0.8, apart_deg=0.8)
    assert choose_by_facts(replace(facts, trials=(least, better, exemplar))).solver == "robust"
    far = replace(better, beside_deg=0.7)
    assert choose_by_facts(replace(facts, trials=(least, far, exemplar))).solver == "exemplar"


def test_the_reason_says_what_the_figures_say():
    first = choose_by_facts(tried(robust=2.0, exemplar=1.0))
    assert "exemplar is the steadiest" in first.reason
    second = choose_by_facts(tried(robust=0.9, exemplar=1.0))
    assert second.solver == "exemplar"
    assert "none outdoes exemplar" in second.reason


def test_a_level_alone_is_a_choice_of_its_own():
    choice = choose_by_facts(replace(tried(ambient=1.0), ambient=0.07))
    assert choice.solver == "ambient"
    assert "level" in choice.reason
    assert choice.figure == "level 7.00% of the albedo"


def test_a_doubt_takes_both_angles():
    steady = {"least-squares": (0.5, 8.0), "robust": (1.0, 1.0), "bivariate": (3.0, 0.9)}
    trials = tuple(
        Trial(solver=name, change_deg=change, apart_deg=apart, pixels=100, seconds=0.01)
        for name, (change, apart) in steady.items()
    )
    assert choose_by_facts(replace(MATTE, misfit=0.5, trials=trials)).solver == "robust"
    assert trials[1].doubt_deg == pytest.approx(1.0, rel=1e-3)
    assert 0 < Trial(solver="robust", change_deg=0.0, pixels=1, seconds=0.0).doubt_deg < 1e-3


@pytest.mark.parametrize(
    ("solver", "stage"),
    [("robust", "robust solving"), ("bivariate", "non-Lambertian solving"), ("ambient", "ambient solving")],
)
def test_one_stage_at_most_chooses_a_solver(solver, stage):
    plan = make_plan(tried(**{solver: 0.1, "trimmed": 5.0}))
    used = [name for name in ("ambient solving", "robust solving", "non-Lambertian solving") if plan[name].use]
    assert used == [stage]
    assert plan[stage].options == {"solver": solver}
    asked = make_plan(MATTE, Options(solver=NORMAL_SOLVERS[solver]()))
    assert asked[stage].use
    assert asked[stage].reason == "Asked for."


def test_every_stage_has_a_reason_either_way():
    for facts in (MATTE, tried(robust=1.0), replace(MATTE, lamps=True), replace(MATTE, turning=0.2, shadowed=0.0)):
        for options in (Options(), Options(nothing_left_out=True), Options(integrator=None, verdicts=True)):
            plan = make_plan(facts, options)
            assert [one.stage for one in plan.decisions] == list(STAGES)
            assert all(one.reason.endswith(".") for one in plan.decisions)
            assert len(plan.explain()) == len(STAGES)
            assert plan == make_plan(facts, options)


@pytest.mark.parametrize(
    ("change", "stage"),
    [
        ({"linear": False, "response": "srgb"}, "linearisation"),
        ({"dark_frame": True}, "dark level"),
        ({"lamps": True}, "near lamps"),
        ({"perspective": True}, "perspective"),
        ({"masked_by_hand": True}, "observation mask"),
        ({"in_memory": False, "memory_limit": 10**6}, "tiling"),
        ({"turning": 0.05}, "discontinuities"),
    ],
)
def test_a_fact_turns_its_stage_on(change, stage):
    assert not make_plan(MATTE)[stage].use
    assert make_plan(replace(MATTE, **change))[stage].use


def test_a_line_of_cliffs_is_few_of_all_pairs():
    assert make_plan(replace(MATTE, turning=0.0025))["discontinuities"].use
    assert not make_plan(replace(MATTE, turning=0.0012))["discontinuities"].use


def test_nothing_left_out_forces_what_was_skipped_and_keeps_what_was_chosen():
    whole = Options(nothing_left_out=True)
    plain, shadowless = make_plan(MATTE, whole), make_plan(replace(MATTE, shadowed=0.0), whole)
    assert plain["non-Lambertian solving"].options == {"solver": "response-bend"}
    assert shadowless["shadow gate"].use
    assert shadowless["discontinuities"].use
    assert make_plan(replace(MATTE, images=14), whole)["robust solving"].use
    few = make_plan(replace(MATTE, images=5), whole)
    assert not any(few[name].use for name in ("ambient solving", "robust solving", "non-Lambertian solving"))
    chosen = make_plan(tried(least_squares=5.0, bivariate=0.1), whole)
    assert chosen["non-Lambertian solving"].options == {"solver": "bivariate"}
    large = replace(MATTE, pixels=10**6)
    assert make_plan(large, whole)["compiled kernels"].use
    assert not make_plan(large)["compiled kernels"].use


def test_gates_follow_what_the_sample_shows():
    assert make_plan(MATTE)["shadow gate"].use
    assert not make_plan(replace(MATTE, shadowed=0.0))["shadow gate"].use
    assert make_plan(replace(MATTE, shadowed=0.0, dark_outliers=0.01))["shadow gate"].use
    assert not make_plan(replace(MATTE, saturates=False))["saturation gate"].use


def test_the_table_of_costs_knows_when_compiled_code_is_used():
    modules = {
        "robust": robust,
        "response-bend": response_bend,
        "bivariate": bivariate,
        "exemplar": exemplar,
        "bi-polynomial": bipolynomial,
        "sparse-bayesian": sparse_bayesian,
    }
    assert {name: COSTS[name].break_even for name in modules} == {name: m._BREAK_EVEN for name, m in modules.items()}
    assert set(COSTS) == set(NORMAL_SOLVERS)
    assert {kind.name for kind in CONTESTANTS} <= set(COSTS)
