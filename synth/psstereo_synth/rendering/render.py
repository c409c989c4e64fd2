"""From a scene to captures: images, lights, camera and mask, and the truth about them."""

from dataclasses import dataclass
from typing import get_args

from psstereo.capture import Capture, Truth
from psstereo.catalogue import choose
from psstereo.errors import UnsupportedError
from psstereo.lights import Light, Rig, StrengthUnit
from psstereo.results import DepthKind, Step
from psstereo.types import Map, Progress, no_progress
from psstereo_synth.faults import apply_rig
from psstereo_synth.meshes import Engine, TriangleMesh, view_mesh
from psstereo_synth.rendering.bounce import Bounce, Radiosity
from psstereo_synth.rendering.exposure import white_radiance
from psstereo_synth.rendering.field import is_straight
from psstereo_synth.rendering.inside import require_lights_outside
from psstereo_synth.rendering.memory import require_memory
from psstereo_synth.rendering.occlusion import Occlusion, shadow_steps
from psstereo_synth.rendering.stage import Stage
from psstereo_synth.scenes import Scene, Viewpoint
from psstereo_synth.shapes import Relief
from psstereo_synth.view import View, view_relief

__all__ = ["Rendering", "render"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Rendering:
    """What one viewpoint of a scene gives.

    Attributes
    ----------
    capture : Capture
        As a camera would deliver it, with the lights as they would be written down.
    truth : Truth
        Normals, depth, albedo of the diffuse part, and visibility of each light.
    view : View
        Where the surface is.
    steps : tuple of Step
        What was done and what was left out, and why.
    """

    capture: Capture
    truth: Truth
    view: View
    steps: tuple[Step, ...]


def render(
    scene: Scene, *, engine: Engine = "auto", over: Map = map, progress: Progress = no_progress
) -> tuple[Rendering, ...]:
    """Render a scene from each of its viewpoints.

    Radiance is that at the centres of pixels. What the scene does not need is left out and said in `steps`: shadows
    of convex surfaces, sweeps for lights that stand high, quadrature for light that reaches matte surfaces unblocked,
    OpenGL for height fields. The same scene gives the same bytes on any number of threads.

    Parameters
    ----------
    scene : Scene
        What is rendered.
    engine : {"auto", "opengl", "rays"}
        How it is found what the camera sees of a mesh.
    over : map-like
        Executes the images.
    progress : callable
        Told how many images are done.

    Returns
    -------
    tuple of Rendering
        One a viewpoint.

    Raises
    ------
    PsstereoError
        If the scene shows nothing, a lamp is inside the surface, or channels disagree.
    """
    choose(dict.fromkeys(get_args(Engine)), engine, "engine")
    require_memory(scene)
    rig = Rig(tuple(_as_recorded(light) for light in scene.lights), StrengthUnit.IRRADIANCE, "the scene's own lights")
    rig = apply_rig(scene.faults, rig, scene.seed)
    looks = [_look(scene, viewpoint, engine) for viewpoint in scene.viewpoints]
    stages, steps = _stages(scene, [view for view, _ in looks])
    sensor = scene.sensor
    if sensor.white is None:
        sensor = sensor.with_white(white_radiance(scene, stages, over))
    made = []
    for stage, (_, look), after in zip(stages, looks, steps, strict=True):
        capture, truth = stage.shoot(sensor, rig, over, progress)
        made.append(Rendering(capture=capture, truth=truth, view=stage.view, steps=(look, *after)))
    return tuple(made)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Common:
    """What views share: it does not depend on who looks."""

    occlusion: Occlusion
    needed: bool
    radiosity: Radiosity | None
    steps: list[Step]

    @classmethod
    def prepare(cls, scene: Scene, occlusion: Occlusion) -> "_Common":
        needed, steps = shadow_steps(scene, occlusion)
        radiosity = None
        if _bounces(scene):
            radiosity = Radiosity(scene, occlusion.patches, occlusion if needed else None)
        steps = [*steps, _bounce_step(scene), _quadrature_step(scene, needed), *_medium_steps(scene)]
        return cls(occlusion=occlusion, needed=needed, radiosity=radiosity, steps=steps)


def _stages(scene: Scene, views: list[View]) -> tuple[list[Stage], list[list[Step]]]:
    """Prepare the views, and what is common to them only once; say what was left out."""
    # A view from straight above samples the surface at its own pixels; all others share a grid or the mesh.
    own = [not isinstance(scene.surface, TriangleMesh) and is_straight(view) for view in views]
    oblique = Occlusion(scene, [view for view, alone in zip(views, own, strict=True) if not alone])
    occlusions = [Occlusion(scene, [view]) if alone else oblique for view, alone in zip(views, own, strict=True)]
    require_lights_outside(scene, occlusions[0])
    common: dict[int, _Common] = {}
    stages, steps = [], []
    for number, (view, occlusion) in enumerate(zip(views, occlusions, strict=True)):
        if id(occlusion) not in common:
            common[id(occlusion)] = _Common.prepare(scene, occlusion)
        use = common[id(occlusion)]
        bounce = None
        if use.radiosity is not None:
            bounce = Bounce(use.radiosity, view.geometry, samples=scene.bounce, seed=scene.seed)
        stages.append(Stage.prepare(scene, number, view, use.occlusion if use.needed else None, bounce))
        steps.append(use.steps)
    return stages, steps


def _look(scene: Scene, viewpoint: Viewpoint, engine: Engine) -> tuple[View, Step]:
    """Find what the camera sees."""
    if isinstance(scene.surface, TriangleMesh):
        view, reason = view_mesh(scene.surface, viewpoint.camera, viewpoint.pose, scene.size, engine=engine)
        return view, Step(name="view of the mesh", done=True, reason=reason)
    view = view_relief(scene.surface, viewpoint.camera, viewpoint.pose, scene.size)
    return view, Step(name="OpenGL", done=False, reason="A height field is evaluated at every pixel.")


def _as_recorded(light: Light) -> Light:
    """Return a light as light files can hold it, or itself if none can: then the writers say so."""
    try:
        return light.idealised()
    except UnsupportedError:
        return light


def _bounces(scene: Scene) -> bool:
    return scene.bounce > 0 and not (isinstance(scene.surface, Relief) and scene.surface.convex)


def _bounce_step(scene: Scene) -> Step:
    name = "interreflection"
    if scene.bounce == 0:
        return Step(name=name, done=False, reason="The scene does not ask for it.")
    if not _bounces(scene):
        return Step(name=name, done=False, reason="No part of a convex surface sees another.")
    reason = f"Light that is reflected once more is looked for in {scene.bounce} directions a point."
    return Step(name=name, done=True, reason=reason)


def _quadrature_step(scene: Scene, shadows: bool) -> Step:
    lights = [*scene.lights, *([] if scene.ambient is None else [scene.ambient])]
    wide = " and ".join(sorted({light.name for light in lights if light.extended}))
    name = "quadrature over lights"
    if not wide:
        return Step(name=name, done=False, reason="Every light is a point or parallel.")
    exact = scene.material.constant and not (scene.extinction > 0 and any(light.positional for light in lights))
    if exact and not shadows:
        return Step(name=name, done=False, reason=f"The irradiance of {wide} light on a matte surface is exact.")
    what = "its unblocked share" if exact else "it"
    return Step(name=name, done=True, reason=f"{scene.beams} directions stand for {wide} light, to find {what}.")


def _medium_steps(scene: Scene) -> list[Step]:
    if scene.extinction == 0:
        return []
    finite = [light for light in scene.lights if light.positional]
    eyes = [one for one in scene.viewpoints if one.camera.depth_kind is DepthKind.DISTANCE]
    if not finite and not eyes:
        return [Step(name="medium", done=False, reason="Light and eye are infinitely far away: no way has a length.")]
    ways = [way for way, there in (("from the lamps", finite), ("to the eye", eyes)) if there]
    return [Step(name="medium", done=True, reason=f"It takes light away on the way {' and '.join(ways)}.")]
