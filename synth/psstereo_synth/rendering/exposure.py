"""The exposure of a scene: which radiance reaches full scale."""

from collections.abc import Sequence

import numpy as np

from psstereo.errors import InputError
from psstereo.forward import Geometry, shade
from psstereo.lights import Light
from psstereo.types import Map
from psstereo_synth.rendering.stage import Stage
from psstereo_synth.scenes import Scene

__all__ = ["white_radiance"]

_BRIGHTEST = 0.9
"""Share of full scale at which the brightest value of a scene is put when nothing else is asked for."""
_PROBES = 20_000
"""Points, spread over the picture, at which the exposure is measured."""


def white_radiance(scene: Scene, stages: Sequence[Stage], over: Map) -> float:
    """Return the radiance at full scale that puts the brightest value of a scene at 0.9, the same for all views.

    Shadows are left out: they would only make it darker.

    Parameters
    ----------
    scene : Scene
        What is photographed.
    stages : sequence of Stage
        Its views.
    over : map-like
        Executes the lights.

    Returns
    -------
    float
        Radiance [W m⁻² sr⁻¹].

    Raises
    ------
    InputError
        If it is black.
    """
    brightest = max(_brightest(scene, stage, over) for stage in stages)
    if not brightest > 0:
        raise InputError(
            given=f"The scene {scene.name} is black under every light.",
            needed="An exposure needs some light.",
            remedy="Check that the albedo is above zero and that the lights stand before the surface.",
        )
    return brightest / _BRIGHTEST


def _brightest(scene: Scene, stage: Stage, over: Map) -> float:
    """Return the greatest radiance at some points of a view under any light."""
    seen = stage.geometry
    some = slice(None, None, max(1, len(seen.points) // _PROBES))
    mask = np.zeros((1, len(seen.points)), np.bool_)
    mask[0, some] = True
    probes = Geometry(
        points=seen.points[some],
        normals=seen.normals[some],
        to_eye=seen.to_eye if seen.to_eye.ndim == 1 else seen.to_eye[some],
        mask=mask,
        eye_distances=None if seen.eye_distances is None else seen.eye_distances[some],
    )
    brdf = stage.brdf.at(some)
    always = 0.0 if stage.always is None else stage.always[some]

    def measure(light: Light) -> float:
        direct = shade(probes, brdf, light, beams=scene.beams, extinction=scene.extinction).radiance
        bounced = stage.bounced(light)
        return float((direct + always + (0.0 if bounced is None else bounced[some])).max(initial=0.0))

    return max(over(measure, scene.lights))
