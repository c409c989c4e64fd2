"""From a capture to everything: survey, plan, run — and a word on each stage that was done or left out."""

from dataclasses import replace

from psstereo.capture import Capture
from psstereo.depth import Integrator
from psstereo.errors import OptionError, UnsupportedError
from psstereo.plan.options import Options, Reconstruction
from psstereo.plan.plan import Plan, make_plan
from psstereo.plan.predict import predict
from psstereo.plan.run import run_plan, survey_and_run, survey_capture
from psstereo.types import Map, Progress, no_progress

__all__ = ["Options", "Reconstruction", "plan_capture", "reconstruct"]


def reconstruct(
    capture: Capture,
    options: Options | None = None,
    *,
    plan: Plan | None = None,
    over: Map = map,
    progress: Progress = no_progress,
) -> Reconstruction:
    """Recover normals, albedo, depth and mesh from a capture.

    A sample of its pixels is looked at while the images are read, and what the scene does not need is left out. What
    the options set explicitly stays as set.

    Parameters
    ----------
    capture : Capture
        Images, lights, camera, mask.
    options : Options, optional
        How; all is left to the plan if absent.
    plan : Plan, optional
        What to do, instead of a plan made here. Of the options, only prior, mask of observations and number of workers
        may then be given.
    over : map-like
        Executes independent pieces, such as the ``map`` of a thread pool.
    progress : callable
        Told how far the steps are.

    Returns
    -------
    Reconstruction
        The answer.

    Raises
    ------
    PsstereoError
        If the capture cannot be used; see :func:`psstereo.normals.estimate_normals`, and for unknown strengths
        :func:`psstereo.normals.strength_choice.choose_strengths`.
    """
    chosen = options or Options()
    _require_use_of_prior(chosen)
    if plan is None:
        return survey_and_run(capture, chosen, over=over, progress=progress)
    _require_plan_alone(chosen)
    return run_plan(plan, capture, chosen, over=over, progress=progress)


def plan_capture(
    capture: Capture, options: Options | None = None, *, over: Map = map, progress: Progress = no_progress
) -> Plan:
    """Say what a reconstruction would do, without solving; every image is decoded once.

    Parameters
    ----------
    capture : Capture
        Images, lights, camera, mask.
    options : Options, optional
        What is set explicitly.
    over : map-like
        Executes independent pieces.
    progress : callable
        Told how far the steps are.

    Returns
    -------
    Plan
        Facts, decisions, and what they will cost.

    Raises
    ------
    PsstereoError
        If the capture cannot be used.
    """
    chosen = options or Options()
    _require_use_of_prior(chosen)
    facts = survey_capture(capture, replace(chosen, diagnose=True), over=over, progress=progress)
    plan = make_plan(facts, chosen)
    return replace(plan, prediction=predict(plan, chosen))


def _require_plan_alone(options: Options) -> None:
    """Refuse options beside a plan that has them."""
    usual = Options()
    beside = ("observation_mask", "prior", "workers", "views")
    names = [name for name in vars(usual) if name not in beside]
    more = [name for name in names if getattr(options, name) != getattr(usual, name)]
    if more:
        raise OptionError(
            given=f"A plan is given, and the option {more[0]}.",
            needed="A plan says all that is to be done.",
            remedy="Leave the option out, or write it into the plan.",
        )


def _require_use_of_prior(options: Options) -> None:
    """Refuse a prior that nobody would look at, before the work."""
    if options.prior is None:
        return
    if options.integrator is None:
        raise OptionError(
            given="A prior depth is given, and only normals were asked for.",
            needed="A prior is fused with the normals when they are integrated.",
            remedy="Leave the prior out, or let the depth be found.",
        )
    if isinstance(options.integrator, Integrator) and not options.integrator.takes_prior:
        raise UnsupportedError(
            given=f"The integrator {options.integrator.name} was given a prior depth.",
            needed="It can work from normals alone only.",
            remedy="Use the integrator poisson, or leave the prior out.",
        )
