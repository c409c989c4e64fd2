"""From a capture to everything: normals, albedo, depth, mesh — and a word on each step that was done or left out."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from psstereo.capture import Capture
from psstereo.depth import Integrator, Poisson, Prior, triangulate
from psstereo.depth.given_normals import mark_missing_depth, prior_step
from psstereo.errors import OptionError, UnsupportedError
from psstereo.near import NearOptions, solve_near, wants_near
from psstereo.normals import Gate, NormalSolver, default_solver, estimate_normals
from psstereo.normals.light_choice import LightChoice, choose_lights
from psstereo.normals.strength_choice import StrengthChoice, choose_strengths
from psstereo.results import DepthResult, NormalsResult, Outcome, Step
from psstereo.surface_mesh import SurfaceMesh
from psstereo.types import BoolArray, Map, Progress, no_progress
from psstereo.verdict import VerdictArray

__all__ = ["Options", "Reconstruction", "reconstruct"]


@dataclass(frozen=True, kw_only=True)
class Options:
    """How a capture is reconstructed.

    Attributes
    ----------
    solver : NormalSolver or None
        Method for the normals; :func:`psstereo.normals.default_solver` chooses if absent.
    gate : Gate or None
        Which observations are left out, instead of what the solver has for its gate.
    integrator : Integrator or None
        Method for the depth; None leaves depth and mesh out.
    lights : LightChoice
        Whose directions of the lights are taken: those given, refined ones, or those that the images tell.
    strengths : StrengthChoice
        Whose strengths of the lights are taken.
    distance : float or None
        Where the search for the object's distance begins, under near lamps; anywhere if absent [length of the lamps'
        positions].
    prior : Prior or None
        Depth known beforehand, to be fused with the normals.
    gray, clip, valid_range, observation_mask, verdicts, max_memory, workers
        As in :func:`psstereo.normals.estimate_normals`.
    """

    solver: NormalSolver[Any] | None = None
    gate: Gate | None = None
    integrator: Integrator | None = field(default_factory=Poisson)
    lights: LightChoice = field(default_factory=LightChoice)
    strengths: StrengthChoice = StrengthChoice.GIVEN
    gray: str | Sequence[float] = "mean"
    clip: float | None = None
    valid_range: tuple[float, float] | None = None
    observation_mask: BoolArray | VerdictArray | None = None
    verdicts: bool = False
    distance: float | None = None
    prior: Prior | None = None
    max_memory: int | None = None
    workers: int = 1


@dataclass(frozen=True, kw_only=True, eq=False)
class Reconstruction:
    """The whole answer.

    Attributes
    ----------
    normals : NormalsResult
        Normals, albedo, uncertainty, flags.
    depth : DepthResult or None
        Depth, if it was wanted.
    mesh : SurfaceMesh or None
        Its triangles.
    steps : tuple of Step
        What was done and what was left out.
    """

    normals: NormalsResult
    depth: DepthResult | None
    mesh: SurfaceMesh | None
    steps: tuple[Step, ...]

    @property
    def converged(self) -> bool:
        """Whether every iteration met its tolerance."""
        outcomes = [self.normals.outcome] + ([self.depth.outcome] if self.depth else [])
        return Outcome.NOT_CONVERGED not in outcomes


def reconstruct(
    capture: Capture, options: Options | None = None, *, over: Map = map, progress: Progress = no_progress
) -> Reconstruction:
    """Recover normals, albedo, depth and mesh from a capture.

    Parameters
    ----------
    capture : Capture
        Images, lights, camera, mask.
    options : Options, optional
        How; the default solver and Poisson integration if absent.
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
    lights = choose_lights(
        capture, chosen.lights, gray=chosen.gray, valid_range=chosen.valid_range, over=over, progress=progress
    )
    capture = lights.capture
    if chosen.solver is None and wants_near(capture):
        return _reconstruct_near(capture, chosen, over, progress)
    if chosen.distance is not None:
        raise OptionError(
            given=f"The distance {chosen.distance:g} is given.",
            needed="Lamps near the object, whose fall-off depends on it, and no solver for distant lights.",
            remedy="Leave it out.",
        )
    strengths = choose_strengths(
        capture,
        chosen.strengths,
        gray=chosen.gray,
        valid_range=chosen.valid_range,
        observation_mask=chosen.observation_mask,
        over=over,
        progress=progress,
    )
    capture = strengths.capture
    solver, why = _solver(capture, chosen)
    normals = estimate_normals(
        capture,
        solver,
        gray=chosen.gray,
        clip=chosen.clip,
        valid_range=chosen.valid_range,
        observation_mask=chosen.observation_mask,
        verdicts=chosen.verdicts,
        max_memory=chosen.max_memory,
        workers=chosen.workers,
        over=over,
        progress=progress,
    )
    normals = replace(
        normals,
        facts={**normals.facts, **lights.facts, **strengths.facts},
        outcome=normals.outcome if strengths.settled and lights.settled else Outcome.NOT_CONVERGED,
    )
    steps = [*_preparation(capture, normals), *lights.steps, strengths.step, *_solving(capture, solver, why, normals)]
    if chosen.integrator is None:
        steps.append(Step(name="depth and mesh", done=False, reason="Only normals were asked for."))
        return Reconstruction(normals=normals, depth=None, mesh=None, steps=tuple(steps))
    started = time.perf_counter()
    depth = chosen.integrator.integrate(
        normals.normals, capture.camera, mask=capture.mask, prior=chosen.prior, progress=progress
    )
    seconds = time.perf_counter() - started
    camera = f"The camera is {capture.camera.name}."
    if chosen.prior is not None:
        steps.append(prior_step(chosen.prior, depth))
        normals = replace(normals, flags=mark_missing_depth(normals.flags, depth.depth))
    steps.append(Step(name=f"depth ({chosen.integrator.name})", done=True, reason=camera, seconds=seconds))
    return _meshed(capture, normals, depth, steps)


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
    if not options.integrator.takes_prior:
        raise UnsupportedError(
            given=f"The integrator {options.integrator.name} was given a prior depth.",
            needed="It can work from normals alone only.",
            remedy="Use the integrator poisson, or leave the prior out.",
        )


def _meshed(capture: Capture, normals: NormalsResult, depth: DepthResult, steps: list[Step]) -> Reconstruction:
    """Add the mesh."""
    started = time.perf_counter()
    mesh = triangulate(
        depth.depth, capture.camera, normals=normals.normals, albedo=normals.albedo, components=depth.components,
        texture=True,
    )
    reason = f"{len(mesh.vertices)} vertices, {len(mesh.faces)} triangles."
    steps = [*steps, Step(name="mesh", done=True, reason=reason, seconds=time.perf_counter() - started)]
    return Reconstruction(normals=normals, depth=depth, mesh=mesh, steps=tuple(steps))


def _reconstruct_near(capture: Capture, options: Options, over: Map, progress: Progress) -> Reconstruction:
    """Recover everything under near lamps, whose normals and depth cannot be told one after the other."""
    _refuse_for_near(options)
    found = solve_near(
        capture,
        NearOptions(
            distance=options.distance,
            integrator=options.integrator or Poisson(),
            gray=options.gray,
            saturation=options.gate is None or options.gate.saturation,
            valid_range=options.valid_range,
            max_memory=options.max_memory,
            workers=options.workers,
        ),
        over=over,
        progress=progress,
    )
    facts, seconds = found.normals.facts, found.normals.seconds
    lamps = f"{facts['pixels']} pixels under {facts['lights']} lamps, {facts['rounds']} rounds of normals and depth."
    steps = [
        *_preparation(capture, found.normals),
        Step(name="reading", done=True, reason=f"{len(capture.stack)} images.", seconds=seconds["read"]),
        Step(name="shadow gate", done=True, reason="Lamps behind the surface were left out."),
        Step(name="normals (near-lamps)", done=True, reason=lamps, seconds=seconds["solve"]),
    ]
    if options.integrator is None:
        steps.append(Step(name="depth and mesh", done=False, reason="Only normals were asked for."))
        return Reconstruction(normals=found.normals, depth=None, mesh=None, steps=tuple(steps))
    reason = "It came with the normals, and its scale from the fall-off of the lamps' light."
    steps.append(Step(name=f"depth ({options.integrator.name})", done=True, reason=reason))
    return _meshed(capture, found.normals, found.depth, steps)


def _refuse_for_near(options: Options) -> None:
    """Refuse what the fit under near lamps does not know."""
    unknown = {
        "a bound on brightness (clip)": options.clip is not None,
        "a mask of observations": options.observation_mask is not None,
        "a prior depth": options.prior is not None,
        "a verdict on each observation": options.verdicts,
        "a gate that leaves shadows in": options.gate is not None and not options.gate.shadow,
        f"{options.strengths.value} strengths": options.strengths is not StrengthChoice.GIVEN,
    }
    asked = [name for name, wanted in unknown.items() if wanted]
    if asked:
        raise UnsupportedError(
            given=f"The lamps are near, and {' and '.join(asked)} was asked for.",
            needed="The method for near lamps knows none of these.",
            remedy="Leave it out, or take the lights as distant (--lights).",
        )


_MANY_BELOW = 0.02
"""Share of observations below the dark level from which the dark image is in doubt."""


def _preparation(capture: Capture, normals: NormalsResult) -> list[Step]:
    """Say what had to be undone to make pixel values proportional to light."""
    linear, dark = capture.response.is_linear, capture.dark is not None
    curve = "The images are linear." if linear else f"The camera's {capture.response.name} curve was removed."
    level = "A dark image was subtracted." if dark else "There is no dark image."
    below, most = normals.facts.get("below_dark"), normals.facts.get("below_dark_most")
    if below is not None and most is not None and max(below, most[1]) > _MANY_BELOW:
        level += (
            f" It is brighter than the photographs in {below:.1%} of the observations, most in {most[0]}"
            f" ({most[1]:.1%}): was it taken with the same exposure, and without the lights?"
        )
    return [
        Step(name="linearisation", done=not linear, reason=curve),
        Step(name="dark level", done=dark, reason=level),
    ]


def _solver(capture: Capture, options: Options) -> tuple[NormalSolver[Any], str]:
    """Return the solver and, if nobody named one, why it was taken."""
    solver, why = options.solver, ""
    if solver is None:
        choice = default_solver(capture.rig)
        solver, why = choice.solver, choice.reason
    return (solver if options.gate is None else replace(solver, gate=options.gate)), why


def _solving(capture: Capture, solver: NormalSolver[Any], why: str, normals: NormalsResult) -> list[Step]:
    facts, gate = normals.facts, solver.gate
    saturation = "No valid range was given, and the gate leaves saturated values in."
    if facts["valid_range"] is not None:
        saturation = f"Values outside {facts['valid_range'][0]:.3g} to {facts['valid_range'][1]:.3g} of full scale."
    elif gate.saturation:
        saturation = "The images hold floating-point values without a full scale."
    shadow = "Observations in shadow were left out." if gate.shadow else "The gate leaves shadowed observations in."
    by_hand = facts["left_out_by_hand"]
    masked = (
        "There is no mask of observations." if by_hand is None else f"{by_hand} observations were left out by hand."
    )
    tiled = facts["samples_in"] != "memory"
    where = f"{facts['sample_bytes'] / 1e6:.0f} MB of samples were kept in {facts['samples_in']}."
    return [
        Step(name="reading", done=True, reason=f"{len(capture.stack)} images.", seconds=normals.seconds["read"]),
        Step(name="saturation gate", done=facts["valid_range"] is not None, reason=saturation),
        Step(name="shadow gate", done=gate.shadow, reason=shadow),
        Step(name="observation mask", done=by_hand is not None, reason=masked),
        Step(name="tiling", done=tiled, reason=where),
        Step(
            name=f"normals ({solver.name})",
            done=True,
            reason=" ".join(filter(None, (f"{facts['pixels']} pixels under {facts['lights']} lights.", why))),
            seconds=normals.seconds["solve"],
        ),
        *_ambient(facts),
    ]


def _ambient(facts: Mapping[str, Any]) -> list[Step]:
    """Say how much ambient light was found, if the solver looks for it."""
    shares = facts.get("ambient_share")
    if shares is None:
        return []
    low, middle, high = (f"{share:.1%}" for share in shares)
    reason = f"It is {middle} of what a surface shows that faces a light, in the median pixel ({low} to {high})."
    return [Step(name="ambient light", done=True, reason=reason)]
