"""Running a plan under near lamps, whose normals and depth cannot be told one after the other."""

from collections.abc import Mapping
from typing import Any

from psstereo.capture import Capture
from psstereo.depth import Integrator, Poisson
from psstereo.errors import UnsupportedError
from psstereo.near import NearOptions, solve_near, wants_near
from psstereo.normals import LeastSquares
from psstereo.normals.exemplar import Exemplar
from psstereo.normals.strength_choice import StrengthChoice
from psstereo.plan.options import Options, Reconstruction
from psstereo.plan.plan import Plan
from psstereo.plan.steps import plan_step, preparation
from psstereo.plan.surface import meshed
from psstereo.results import Step
from psstereo.types import Map, Progress

__all__ = ["refuse_for_near", "run_near", "takes_near"]


def takes_near(capture: Capture, options: Options) -> bool:
    """Return whether a capture is solved as under near lamps: it has some, and no solver for distant lights was named.

    Parameters
    ----------
    capture : Capture
        The capture.
    options : Options
        What was asked for; the solver exemplar serves near lamps too.
    """
    return wants_near(capture) and (options.solver is None or isinstance(options.solver, Exemplar))


def run_near(
    plan: Plan, capture: Capture, options: Options, *, light_steps: tuple[Step, ...], over: Map, progress: Progress
) -> Reconstruction:
    """Find normals and depth together.

    Parameters
    ----------
    plan : Plan
        The plan.
    capture : Capture
        Under lamps at places.
    options : Options
        Settled ones.
    light_steps : tuple of Step
        What was done about the lights before.
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
        If something was asked for that the method does not know; see :func:`psstereo.near.solve_near`.
    """
    refuse_for_near(options)
    integrator = options.integrator if isinstance(options.integrator, Integrator) else None
    reflectance, exemplars = _reflectance(plan, options)
    found = solve_near(
        capture,
        NearOptions(
            distance=options.distance,
            integrator=integrator or Poisson(),
            gray=options.gray,
            saturation=options.gate is None or options.gate.saturation,
            valid_range=options.valid_range,
            reflectance=reflectance,
            exemplars=exemplars,
            max_memory=options.max_memory,
            workers=options.workers,
        ),
        over=over,
        progress=progress,
    )
    facts, seconds = found.normals.facts, found.normals.seconds
    lamps = f"{facts['pixels']} pixels under {facts['lights']} lamps, {facts['rounds']} rounds of normals and depth."
    steps = [
        *preparation(capture, found.normals),
        *light_steps,
        plan_step(plan, "near lamps"),
        Step(name="reading", done=True, reason=f"{len(capture.stack)} images.", seconds=seconds["read"]),
        Step(name="shadow gate", done=True, reason="Lamps behind the surface were left out."),
        _materials(facts),
        Step(name="normals (near-lamps)", done=True, reason=lamps, seconds=seconds["solve"]),
        plan_step(plan, "perspective"),
    ]
    if integrator is None:
        steps.append(Step(name="depth and mesh", done=False, reason="Only normals were asked for."))
        return Reconstruction(normals=found.normals, depth=None, mesh=None, steps=tuple(steps), plan=plan)
    reason = "It came with the normals, and its scale from the fall-off of the lamps' light."
    steps.append(Step(name=f"depth ({integrator.name})", done=True, reason=reason))
    return meshed(plan, capture, found.normals, found.depth, steps)


def _reflectance(plan: Plan, options: Options) -> tuple[str, Exemplar]:
    """Return what the surface is to be taken for, and the numbers of the exemplars' fit."""
    if isinstance(options.solver, Exemplar):
        return "exemplar", options.solver
    return str(plan["near lamps"].options.get("reflectance", "auto")), Exemplar()


def _materials(facts: Mapping[str, Any]) -> Step:
    """Say whether exemplar materials were fitted, and why."""
    reason = str(facts["reflectance_reason"])
    if facts["reflectance"] == "exemplar":
        count = facts["materials"]
        object_s = f"{count} materials were found and stand for the lobes in every pixel."
        own = "Every pixel has materials of its own."
        reason += f" {object_s if count else own} {facts['pixels_glossy']:.0%} of the normals are mostly theirs."
    return Step(name="non-Lambertian solving", done=facts["reflectance"] == "exemplar", reason=reason)


def refuse_for_near(options: Options) -> None:
    """Refuse what the fit under near lamps does not know.

    Parameters
    ----------
    options : Options
        What was asked for.

    Raises
    ------
    UnsupportedError
        With the names of what it does not know.
    """
    unknown = {
        "a bound on brightness (clip)": options.clip is not None,
        "a mask of observations": options.observation_mask is not None,
        "a prior depth": options.prior is not None,
        "a verdict on each observation": options.verdicts,
        "a gate that leaves shadows in": options.gate is not None and not options.gate.shadow,
        f"{options.strengths.value} strengths": options.strengths is not StrengthChoice.GIVEN,
        f"the solver {'' if options.solver is None else options.solver.name}": not (
            options.solver is None or isinstance(options.solver, Exemplar | LeastSquares)
        ),
    }
    asked = [name for name, wanted in unknown.items() if wanted]
    if asked:
        raise UnsupportedError(
            given=f"The lamps are near, and {' and '.join(asked)} was asked for.",
            needed="The method for near lamps knows none of these.",
            remedy="Leave it out, or take the lights as distant (--lights).",
        )
