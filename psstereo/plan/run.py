"""Surveying, planning and running; a run decides nothing that its plan has not decided."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from psstereo.capture import Capture
from psstereo.depth import Integrator
from psstereo.errors import OptionError
from psstereo.normals import NormalSolver
from psstereo.normals.estimate import solve_gathered
from psstereo.normals.gathered import Gathered, Reading, gathered
from psstereo.normals.light_choice import ChosenLights, choose_lights
from psstereo.normals.strength_choice import ChosenStrengths, choose_strengths
from psstereo.normals.views import views_of
from psstereo.plan.facts import Facts
from psstereo.plan.near_run import refuse_for_near, run_near, takes_near
from psstereo.plan.options import Options, Reconstruction
from psstereo.plan.plan import Plan, make_plan
from psstereo.plan.stages.catalogue import STAGES
from psstereo.plan.stages.gates import asked_gate
from psstereo.plan.steps import preparation, solving
from psstereo.plan.surface import integrated
from psstereo.plan.survey import describe, survey, watch
from psstereo.results import NormalsResult, Outcome
from psstereo.types import Map, Progress, no_progress

__all__ = ["run_plan", "survey_and_run", "survey_capture"]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Lit:
    """A capture under the lights that are wanted."""

    capture: Capture
    lights: ChosenLights
    strengths: ChosenStrengths | None = None


def survey_and_run(
    capture: Capture, options: Options, *, over: Map = map, progress: Progress = no_progress
) -> Reconstruction:
    """Look at a capture, make a plan and run it; every image is decoded once.

    Parameters
    ----------
    capture : Capture
        The capture.
    options : Options
        What was asked for.
    over : map-like
        Executes the pieces.
    progress : callable
        Told how far it is.

    Returns
    -------
    Reconstruction
        The answer.

    Raises
    ------
    PsstereoError
        If the capture cannot be used.
    """
    lit = _light(capture, options, over, progress)
    facts = describe(lit.capture, options)
    if lit.strengths is None:
        plan = make_plan(facts, options)
        settled_capture, settled = follow(plan, lit.capture, options)
        return run_near(plan, settled_capture, settled, light_steps=lit.lights.steps, over=over, progress=progress)
    with _surveyed(lit.capture, facts, options, over, progress) as (samples, found, seconds):
        plan = make_plan(found, options)
        settled_capture, settled = follow(plan, lit.capture, options)
        normals = _solve(samples, settled, lit, {"survey": seconds}, over=over, progress=progress)
        views = views_of(samples, normals) if options.views else None
    return replace(_finish(plan, settled_capture, settled, lit, normals, progress=progress), views=views)


def survey_capture(capture: Capture, options: Options, *, over: Map = map, progress: Progress = no_progress) -> Facts:
    """Look at a capture without solving it; only the sample's pixels are kept.

    Parameters
    ----------
    capture : Capture
        The capture.
    options : Options
        What was asked for.
    over : map-like
        Executes the pieces.
    progress : callable
        Told how far it is.

    Returns
    -------
    Facts
        What the capture shows.

    Raises
    ------
    PsstereoError
        If the capture cannot be used.
    """
    lit = _light(capture, options, over, progress)
    facts = describe(lit.capture, options)
    if lit.strengths is None:
        return facts
    with _surveyed(lit.capture, facts, options, over, progress, only=True) as (_, found, _seconds):
        return found


def run_plan(
    plan: Plan, capture: Capture, options: Options, *, over: Map = map, progress: Progress = no_progress
) -> Reconstruction:
    """Run a plan that was made before.

    Parameters
    ----------
    plan : Plan
        The plan.
    capture : Capture
        The capture.
    options : Options
        Prior, mask of observations and number of workers; all else is the plan's.
    over : map-like
        Executes the pieces.
    progress : callable
        Told how far it is.

    Returns
    -------
    Reconstruction
        The answer.

    Raises
    ------
    PsstereoError
        If the plan does not fit the capture, or the capture cannot be used.
    """
    capture, settled = follow(plan, capture, options)
    lit = _light(capture, settled, over, progress, near=plan["near lamps"].use)
    if lit.strengths is None:
        return run_near(plan, lit.capture, settled, light_steps=lit.lights.steps, over=over, progress=progress)
    assert settled.solver is not None
    settled.solver.prepare(lit.capture.rig)  # before anything is decoded: a bad rig is told at once
    with _gathered(lit.capture, settled, over, progress) as samples:
        normals = _solve(samples, settled, lit, {}, over=over, progress=progress)
        views = views_of(samples, normals) if options.views else None
    return replace(_finish(plan, capture, settled, lit, normals, progress=progress), views=views)


def follow(plan: Plan, capture: Capture, options: Options) -> tuple[Capture, Options]:
    """Return the capture and the options that a plan comes to.

    Parameters
    ----------
    plan : Plan
        The plan.
    capture : Capture
        What it is for.
    options : Options
        Methods that were handed over as objects, the prior, the mask of observations and the number of workers; all
        else is the plan's.

    Returns
    -------
    Capture, Options
        With nothing left to be decided.

    Raises
    ------
    InputError, OptionError
        If the plan does not fit the capture.
    """
    settled = Options(
        observation_mask=options.observation_mask, prior=options.prior, workers=options.workers, integrator=None
    )
    for decision in plan.decisions:
        capture, settled = STAGES[decision.stage].apply(decision, capture, settled)
    gate = options.gate or settled.gate
    if options.solver is not None:
        own = options.solver
        settled = replace(settled, solver=own if options.gate is None else replace(own, gate=options.gate))
    elif options.gate is not None and settled.solver is not None:
        settled = replace(settled, solver=replace(settled.solver, gate=options.gate))
    if isinstance(options.integrator, Integrator):
        settled = replace(settled, integrator=options.integrator)
    return capture, replace(settled, gate=gate)


def _light(capture: Capture, options: Options, over: Map, progress: Progress, *, near: bool | None = None) -> _Lit:
    """Return the capture under the lights that are wanted; without strengths if they are near, as a plan may say."""
    how: dict[str, Any] = {"gray": options.gray, "valid_range": options.valid_range, "over": over}
    lights = choose_lights(capture, options.lights, progress=progress, **how)
    if takes_near(lights.capture, options) if near is None else near:
        refuse_for_near(options)
        return _Lit(capture=lights.capture, lights=lights)
    if options.distance is not None:
        raise OptionError(
            given=f"The distance {options.distance:g} is given.",
            needed="Lamps near the object, whose fall-off depends on it, and no solver for distant lights.",
            remedy="Leave it out.",
        )
    strengths = choose_strengths(
        lights.capture, options.strengths, observation_mask=options.observation_mask, progress=progress, **how
    )
    return _Lit(capture=strengths.capture, lights=lights, strengths=strengths)


def _reading(options: Options) -> Reading:
    gate = asked_gate(options)
    return Reading(
        gray=options.gray,
        clip=options.clip,
        valid_range=options.valid_range,
        observation_mask=options.observation_mask,
        saturation=gate is None or gate.saturation,
    )


def _gathered(capture: Capture, options: Options, over: Map, progress: Progress) -> Any:
    return gathered(
        capture,
        _reading(options),
        verdicts=options.verdicts,
        max_memory=options.max_memory,
        workers=options.workers,
        over=over,
        progress=progress,
    )


@contextmanager
def _surveyed(
    capture: Capture, facts: Facts, options: Options, over: Map, progress: Progress, *, only: bool = False
) -> Iterator[tuple[Gathered, Facts, float]]:
    """Read a capture, all of it or the sample only, and survey it on the way."""
    _require_rig(capture, options.solver)
    watched = watch(capture, motion=options.diagnose)
    kept = watched.capture if not only else replace(watched.capture, mask=watched.where.mask(capture.shape))
    with _gathered(kept, options, over, progress) as samples:
        started = time.perf_counter()
        found = survey(samples, watched, facts, options)
        yield samples, found, time.perf_counter() - started


def _require_rig(capture: Capture, solver: NormalSolver[Any] | None) -> None:
    """Refuse a bad rig before anything is decoded."""
    if solver is None:
        capture.rig.require_spanning()
    else:
        solver.prepare(capture.rig)


def _solve(
    samples: Gathered, settled: Options, lit: _Lit, seconds: dict[str, float], *, over: Map, progress: Progress
) -> NormalsResult:
    assert settled.solver is not None
    assert lit.strengths is not None
    normals = solve_gathered(samples, settled.solver, verdicts=settled.verdicts, over=over, progress=progress)
    settled_lights = lit.strengths.settled and lit.lights.settled
    return replace(
        normals,
        facts={**normals.facts, **lit.lights.facts, **lit.strengths.facts},
        seconds={**normals.seconds, **seconds},
        outcome=normals.outcome if settled_lights else Outcome.NOT_CONVERGED,
    )


def _finish(
    plan: Plan, capture: Capture, settled: Options, lit: _Lit, normals: NormalsResult, *, progress: Progress
) -> Reconstruction:
    assert settled.solver is not None
    assert lit.strengths is not None
    steps = [
        *preparation(capture, normals),
        *lit.lights.steps,
        lit.strengths.step,
        *solving(capture, settled.solver, plan, normals),
    ]
    return integrated(plan, capture, settled, normals, steps, progress=progress)
