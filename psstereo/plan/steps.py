"""The record of a run: a step a stage, with its reason and its figure."""

from collections.abc import Mapping
from typing import Any, TypeAlias

from psstereo.capture import Capture
from psstereo.normals import NormalSolver
from psstereo.plan.choice import choose_by_facts
from psstereo.plan.plan import Plan
from psstereo.results import NormalsResult, Step

__all__ = ["MODELS", "PlanSteps", "plan_step", "preparation", "solving"]

PlanSteps: TypeAlias = list[Step]
"""Some steps."""

MODELS = ("ambient solving", "robust solving", "non-Lambertian solving")
"""Stages that choose the solver."""
_MANY_BELOW = 0.02
"""Share of observations below the dark level from which the dark image is in doubt."""


def plan_step(plan: Plan, stage: str, seconds: float = 0.0) -> Step:
    """Return the step that says what was decided about a stage."""
    found = plan[stage]
    reason = " ".join(filter(None, (found.reason, _sentence(found.figure))))
    return Step(name=stage, done=found.use, reason=reason, seconds=seconds)


def _sentence(figure: str) -> str:
    return f"{figure[0].upper()}{figure[1:]}." if figure else ""


def preparation(capture: Capture, normals: NormalsResult) -> PlanSteps:
    """Say what had to be undone to make pixel values proportional to light.

    Parameters
    ----------
    capture : Capture
        The capture.
    normals : NormalsResult
        What came out, for the figures of reading.

    Returns
    -------
    list of Step
        Three steps.
    """
    linear, dark = capture.response.is_linear, capture.dark is not None
    curve = "The images are linear." if linear else f"The camera's {capture.response.name} curve was removed."
    level = "A dark image was subtracted." if dark else "There is no dark image."
    below, most = normals.facts.get("below_dark"), normals.facts.get("below_dark_most")
    if below is not None and most is not None and max(below, most[1]) > _MANY_BELOW:
        level += (
            f" It is brighter than the photographs in {below:.1%} of the observations, most in {most[0]}"
            f" ({most[1]:.1%}): was it taken with the same exposure, and without the lights?"
        )
    flat = capture.flat is not None
    even = "A flat field made lens and sensor even." if flat else "There is no flat field."
    return [
        Step(name="linearisation", done=not linear, reason=curve),
        Step(name="dark level", done=dark, reason=level),
        Step(name="flat field", done=flat, reason=even),
    ]


def solving(capture: Capture, solver: NormalSolver[Any], plan: Plan, normals: NormalsResult) -> PlanSteps:
    """Say how samples became normals.

    Parameters
    ----------
    capture : Capture
        The capture.
    solver : NormalSolver
        The method.
    plan : Plan
        What was decided.
    normals : NormalsResult
        What came out.

    Returns
    -------
    list of Step
        The steps from reading to normals.
    """
    facts = normals.facts
    by_hand = facts["left_out_by_hand"]
    masked = (
        "There is no mask of observations." if by_hand is None else f"{by_hand} observations were left out by hand."
    )
    where = f"{facts['sample_bytes'] / 1e6:.0f} MB of samples were kept in {facts['samples_in']}."
    seconds = normals.seconds
    said = " ".join(
        filter(None, (f"{facts['pixels']} pixels under {facts['lights']} lights.", _chosen(plan, solver.name)))
    )
    return [
        plan_step(plan, "near lamps"),
        Step(name="reading", done=True, reason=f"{len(capture.stack)} images.", seconds=seconds["read"]),
        *_survey(plan, seconds),
        _saturation(facts, solver, plan),
        plan_step(plan, "shadow gate"),
        Step(name="observation mask", done=by_hand is not None, reason=masked),
        Step(name="tiling", done=facts["samples_in"] != "memory", reason=where),
        *(plan_step(plan, name) for name in MODELS),
        plan_step(plan, "compiled kernels"),
        Step(name=f"normals ({solver.name})", done=True, reason=said, seconds=seconds["solve"]),
        *_ambient(facts),
    ]


def _chosen(plan: Plan, solver: str) -> str:
    """Say why this solver was taken, unless it was asked for."""
    asked = any("asked for" in plan[name].reason.lower() for name in MODELS)
    choice = choose_by_facts(plan.facts)
    return "" if asked or choice.solver != solver else choice.reason


def _survey(plan: Plan, seconds: Mapping[str, float]) -> PlanSteps:
    facts = plan.facts
    if "survey" not in seconds:
        return [Step(name="survey", done=False, reason="The plan was given.")]
    reason = f"{facts.surveyed} pixels were looked at, {len(facts.trials)} solvers tried."
    return [Step(name="survey", done=True, reason=reason, seconds=seconds["survey"])]


def _saturation(facts: Mapping[str, Any], solver: NormalSolver[Any], plan: Plan) -> Step:
    figure = _sentence(plan["saturation gate"].figure)
    reason = "No valid range was given, and the gate leaves saturated values in."
    if facts["valid_range"] is not None:
        low, high = facts["valid_range"]
        reason = f"Values outside {low:.3g} to {high:.3g} of full scale. {figure}".rstrip()
    elif solver.gate.saturation:
        reason = "The images hold floating-point values without a full scale."
    return Step(name="saturation gate", done=facts["valid_range"] is not None, reason=reason)


def _ambient(facts: Mapping[str, Any]) -> PlanSteps:
    """Say how much ambient light was found, if the solver looks for it."""
    shares = facts.get("ambient_share")
    if shares is None:
        return []
    low, middle, high = (f"{share:.1%}" for share in shares)
    reason = f"It is {middle} of what a surface shows that faces a light, in the median pixel ({low} to {high})."
    return [Step(name="ambient light", done=True, reason=reason)]
