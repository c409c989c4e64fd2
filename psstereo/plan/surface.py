"""The end of a run: depth and mesh."""

import time
from dataclasses import replace

from psstereo.capture import Capture
from psstereo.depth import Integrator, triangulate
from psstereo.depth.given_normals import mark_missing_depth, prior_step
from psstereo.plan.options import Options, Reconstruction
from psstereo.plan.plan import Plan
from psstereo.plan.steps import plan_step
from psstereo.results import DepthResult, NormalsResult, Step
from psstereo.types import Progress

__all__ = ["integrated", "meshed"]


def integrated(
    plan: Plan, capture: Capture, options: Options, normals: NormalsResult, steps: list[Step], *, progress: Progress
) -> Reconstruction:
    """Add depth and mesh to normals, as far as the plan has them.

    Parameters
    ----------
    plan : Plan
        The plan.
    capture : Capture
        For its camera and mask.
    options : Options
        Settled ones.
    normals : NormalsResult
        The normals.
    steps : list of Step
        What was done before.
    progress : callable
        Told how far it is.

    Returns
    -------
    Reconstruction
        The answer.
    """
    if not isinstance(options.integrator, Integrator):
        steps.append(Step(name="depth and mesh", done=False, reason="Only normals were asked for."))
        return Reconstruction(normals=normals, depth=None, mesh=None, steps=tuple(steps), plan=plan)
    started = time.perf_counter()
    depth = options.integrator.integrate(
        normals.normals, capture.camera, mask=capture.mask, prior=options.prior, progress=progress
    )
    seconds = time.perf_counter() - started
    steps += [plan_step(plan, "perspective"), plan_step(plan, "discontinuities")]
    camera = f"The camera is {capture.camera.name}."
    if options.prior is not None:
        steps.append(prior_step(options.prior, depth))
        normals = replace(normals, flags=mark_missing_depth(normals.flags, depth.depth))
    steps.append(Step(name=f"depth ({options.integrator.name})", done=True, reason=camera, seconds=seconds))
    return meshed(plan, capture, normals, depth, steps)


def meshed(
    plan: Plan, capture: Capture, normals: NormalsResult, depth: DepthResult, steps: list[Step]
) -> Reconstruction:
    """Add the mesh, if the plan has one.

    Parameters
    ----------
    plan : Plan
        The plan.
    capture : Capture
        For its camera.
    normals : NormalsResult
        The normals.
    depth : DepthResult
        The depth.
    steps : list of Step
        What was done before.

    Returns
    -------
    Reconstruction
        The answer.
    """
    if not plan["mesh"].use:
        steps = [*steps, plan_step(plan, "mesh")]
        return Reconstruction(normals=normals, depth=depth, mesh=None, steps=tuple(steps), plan=plan)
    started = time.perf_counter()
    mesh = triangulate(
        depth.depth,
        capture.camera,
        normals=normals.normals,
        albedo=normals.albedo,
        components=depth.components,
        texture=True,
    )
    reason = f"{len(mesh.vertices)} vertices, {len(mesh.faces)} triangles."
    steps = [*steps, Step(name="mesh", done=True, reason=reason, seconds=time.perf_counter() - started)]
    return Reconstruction(normals=normals, depth=depth, mesh=mesh, steps=tuple(steps), plan=plan)
