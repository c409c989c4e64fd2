"""What stands in the light of a scene, and the cheapest way to find it."""

from collections.abc import Sequence
from functools import cached_property
from threading import Lock
from typing import ClassVar

import numpy as np

from psstereo.forward import ReliefShadows, Shadows
from psstereo.lights import Beam, Light
from psstereo.results import Step
from psstereo.types import BoolArray, FloatArray
from psstereo_synth.meshes import RayCaster, RayShadows, TriangleMesh
from psstereo_synth.rendering.field import HeightField, coarser_field, field_of_views
from psstereo_synth.scenes import Scene
from psstereo_synth.shapes import Relief
from psstereo_synth.view import View

__all__ = ["Occlusion", "shadow_steps"]

_PATCHES = 128
"""Nodes along the longer side of the coarser mesh that sends bounced light out: that light varies slowly."""


class Occlusion(Shadows):
    """Shadows by the sweep for parallel light on height fields, by rays for the rest; prepared when first needed.

    Parameters
    ----------
    scene : Scene
        Surface and lights.
    views : sequence of View
        What is seen of it; all share what is prepared.
    """

    name: ClassVar[str] = "shadows"

    def __init__(self, scene: Scene, views: Sequence[View]) -> None:
        self._scene = scene
        self._views = tuple(views)
        self._lock = Lock()  # or threads would prepare the same thing side by side
        self._last: tuple[FloatArray, FloatArray] | None = None

    @property
    def surface(self) -> Relief | TriangleMesh:
        """What throws shadows."""
        return self._scene.surface

    @cached_property
    def field(self) -> HeightField | None:
        """The height field sampled, None for a mesh."""
        if isinstance(self.surface, TriangleMesh):
            return None
        return field_of_views(self.surface, self._scene, self._views)

    @cached_property
    def sweep(self) -> ReliefShadows | None:
        """What finds the shadows of parallel light on a height field, None for a mesh."""
        if self.field is None:
            return None
        return ReliefShadows(self.field.heights, self.field.spacing, self.field.origin)

    @cached_property
    def caster(self) -> RayCaster:
        """The surface as triangles, for rays."""
        return RayCaster(self.surface if isinstance(self.surface, TriangleMesh) else self._field().mesh())

    @cached_property
    def patches(self) -> tuple[RayCaster, HeightField | None]:
        """The surface whose triangles send bounced light out, and the field that it is made of if it is one."""
        if isinstance(self.surface, TriangleMesh):
            return self.caster, None
        field = coarser_field(self.surface, self._field(), _PATCHES)
        return RayCaster(field.mesh()), field

    @cached_property
    def _rays(self) -> RayShadows:
        return RayShadows(self.caster)

    def _field(self) -> HeightField:
        assert self.field is not None
        return self.field

    def lit(self, points: FloatArray, normals: FloatArray, beam: Beam) -> BoolArray:
        """Return where a beam arrives; see :meth:`Shadows.lit`."""
        with self._lock:
            way = self.sweep if beam.parallel and self.sweep is not None else self._rays
        return way.lit(self._raised(points), normals, beam)

    def _raised(self, points: FloatArray) -> FloatArray:
        """Return points that are not below the field's triangles; the same ones mostly come again."""
        if self.field is None:
            return points
        last = self._last
        if last is None or last[0] is not points:
            last = self._last = points, self.field.raised(points)
        return last[1]

    def may_block(self, light: Light, beams: int) -> bool:
        """Return whether the surface can stand in the way of a light; False only if it is sure not to.

        Parameters
        ----------
        light : Light
            The light.
        beams : int
            How many directions stand for it.
        """
        if light.positional or self.sweep is None:
            return True
        return any(self.sweep.may_block(beam.directions) for beam in light.beams(np.zeros((1, 3)), beams))


def shadow_steps(scene: Scene, occlusion: Occlusion) -> tuple[bool, list[Step]]:
    """Decide whether shadows are looked for, and say how or why not.

    Parameters
    ----------
    scene : Scene
        Surface and lights.
    occlusion : Occlusion
        What may be in the way.

    Returns
    -------
    needed : bool
        Whether anything can be in cast shadow.
    steps : list of Step
        What is done or left out, and why.
    """
    surface = scene.surface
    lights = [*scene.lights, *([] if scene.ambient is None else [scene.ambient])]
    if not scene.cast_shadows:
        reason = "The scene asks for none: only attached shadows are rendered."
    elif isinstance(surface, Relief) and surface.convex:
        reason = f"The {surface.name} is convex: it cannot stand in its own light."
    elif not any(occlusion.may_block(light, scene.beams) for light in lights):
        reason = f"Every light stands higher than the steepest slope.{_cut(scene, occlusion)}"
    else:
        return True, [Step(name="cast shadows", done=True, reason=_way(scene, occlusion)), _penumbra(lights, scene)]
    return False, [Step(name="cast shadows", done=False, reason=reason)]


def _way(scene: Scene, occlusion: Occlusion) -> str:
    """Return how shadows are found."""
    if isinstance(scene.surface, TriangleMesh):
        return "Rays are cast at the mesh."
    near = [light for light in scene.lights if light.positional]
    if not near:
        how = "A sweep along the horizon finds the shadows of parallel light."
    elif len(near) == len(scene.lights):
        how = "Rays are cast at a mesh of the height field, since lamps are near."
    else:
        how = "A sweep along the horizon finds the shadows of parallel light, rays at a mesh those of near lamps."
    return f"{how}{_cut(scene, occlusion)}"


def _cut(scene: Scene, occlusion: Occlusion) -> str:
    """Return a sentence about ground that is not looked at, or nothing if all is."""
    cut = np.inf if occlusion.field is None else occlusion.field.cut
    return "" if np.isinf(cut) else f" Ground farther than {cut:.3g} {scene.unit} from what is seen throws none."


def _penumbra(lights: Sequence[Light], scene: Scene) -> Step:
    wide = sorted({light.name for light in lights if light.extended})
    if wide:
        reason = f"About {scene.beams} directions stand for each {' and '.join(wide)}."
        return Step(name="penumbra", done=True, reason=reason)
    return Step(name="penumbra", done=False, reason="Every light is a point or parallel: shadows have sharp edges.")
