"""The sections [camera] and [[views]] of a scene file."""

import numpy as np

from psstereo.camera import Camera, Pose
from psstereo.io.toml_section import Section
from psstereo_synth.scenes.scene import Viewpoint
from psstereo_synth.scenes.values import positive, vector
from psstereo_synth.view import centred_orthographic, centred_pinhole

__all__ = ["read_viewpoints"]


def read_viewpoints(top: Section, size: tuple[int, int], reach: float) -> tuple[Viewpoint, ...]:
    """Return the cameras of a scene and where they stand.

    Parameters
    ----------
    top : Section
        The whole file.
    size : (int, int)
        Rows and columns of the images.
    reach : float
        How far the surface reaches from the origin; pictures show as much [length].

    Returns
    -------
    tuple of Viewpoint
        One, over the origin, if the file names no views.

    Raises
    ------
    PsstereoError
        If a word or key is unknown, or a value means nothing.
    """
    section = top.section("camera")
    kind = section.choice("type", ("orthographic", "pinhole")) or "orthographic"
    section.allow(("type", *(("width",) if kind == "orthographic" else ("focal", "distance"))))
    camera: Camera
    if kind == "orthographic":
        width = positive(section, "width", 2 * reach)
        camera, pose = centred_orthographic(size, width=width, length_unit=top.text("unit") or "mm")
    else:
        focal, distance = positive(section, "focal", 4.0), positive(section, "distance", 8.0 * reach)
        camera, pose = centred_pinhole(size, focal=focal * size[1], distance=distance)
    views = top.values.get("views")
    if views is None:
        return (Viewpoint(camera=camera, pose=pose),)
    if not (isinstance(views, list) and views and all(isinstance(view, dict) for view in views)):
        raise top.wrong("views", "one or more tables [[views]], each with a position")
    return tuple(_view(Section(view, "views", top.file), camera, pose, kind) for view in views)


def _view(section: Section, camera: Camera, pose: Pose, kind: str) -> Viewpoint:
    section.allow(("position", "target", "up"))
    position, target = vector(section, "position", None), vector(section, "target", (0.0, 0.0, 0.0))
    looking = Pose.looking_at(position, target, vector(section, "up", (0.0, 1.0, 0.0)))
    if kind == "pinhole":
        return Viewpoint(camera=camera, pose=looking)
    # A parallel camera's origin is the centre of its pixel (0, 0), not of its image.
    corner = looking.to_scene(np.array([pose.position[0], pose.position[1], 0.0]))
    return Viewpoint(camera=camera, pose=Pose(rotation=looking.rotation, position=corner))
