"""Everything that a synthetic capture is made of."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from psstereo.camera import Camera, Pose
from psstereo.errors import InputError, OptionError, UnsupportedError
from psstereo.lights import Light
from psstereo_synth.faults import Fault
from psstereo_synth.meshes import TriangleMesh
from psstereo_synth.scenes.material import Material
from psstereo_synth.sensor import Sensor
from psstereo_synth.shapes import Relief

__all__ = ["Scene", "Viewpoint"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Viewpoint:
    """A camera and where it stands.

    Attributes
    ----------
    camera : Camera
        What it projects.
    pose : Pose
        From its frame to the scene's.
    """

    camera: Camera
    pose: Pose


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """A surface, what it is made of, who looks at it, what shines on it, and what the camera makes of it.

    All is in the scene's frame: x right, y up, z toward a viewer above.

    Attributes
    ----------
    name : str
        For file names and reports.
    summary : str
        What it tests, as one sentence.
    surface : Relief or TriangleMesh
        What is photographed.
    material : Material
        Its reflectance.
    viewpoints : tuple of Viewpoint
        Each gives a capture of its own; all have the same exposure.
    size : (int, int)
        Rows and columns of the images.
    lights : tuple of Light
        One an image.
    ambient : Light or None
        Light that is there in every image, and that light files do not mention.
    dark_frame : bool
        Whether the capture comes with an image of the ambient light alone.
    cast_shadows : bool
        Whether the surface may stand in its own light.
    beams : int
        About how many directions stand for an extended light where it has to be split.
    bounce : int
        Directions a point in which light that is reflected once more is looked for; 0 leaves it out.
    extinction : float
        Of a homogeneous medium between near lamps, surface and a camera at a finite distance [unit⁻¹].
    sensor : Sensor
        The camera's sensor; without a radiance at full scale the brightest value of the scene is put at 0.9.
    faults : tuple of Fault
        What goes wrong, in this order.
    unit : str
        Of all lengths.
    seed : int
        Of the faults; the sensor has one of its own.

    Raises
    ------
    InputError
        If there is no viewpoint, no light, or no pixel, or a number means nothing.
    OptionError
        If there is a dark frame of nothing.
    UnsupportedError
        If bounced light is asked for in a medium.
    """

    name: str = "scene"
    summary: str = ""
    surface: Relief | TriangleMesh
    material: Material = field(default_factory=Material)
    viewpoints: tuple[Viewpoint, ...]
    size: tuple[int, int]
    lights: tuple[Light, ...]
    ambient: Light | None = None
    dark_frame: bool = False
    cast_shadows: bool = True
    beams: int = 64
    bounce: int = 0
    extinction: float = 0.0
    sensor: Sensor = field(default_factory=Sensor)
    faults: tuple[Fault, ...] = ()
    unit: str = "mm"
    seed: int = 0

    def __post_init__(self) -> None:
        if min(self.size) < 1 or not self.viewpoints or not self.lights:
            raise InputError(
                given=f"The scene {self.name} has images of {self.size[1]} × {self.size[0]} pixels, "
                f"{len(self.viewpoints)} viewpoints and {len(self.lights)} lights.",
                needed="At least one pixel, one viewpoint and one light.",
                remedy="Ask for a larger size, or add what is missing.",
            )
        if self.beams < 1 or self.bounce < 0 or not 0 <= self.extinction < np.inf or self.seed < 0:
            raise InputError(
                given=f"The scene {self.name} asks for {self.beams} beams, {self.bounce} directions of bounced light, "
                f"an extinction of {self.extinction} and the seed {self.seed}.",
                needed="One beam or more, and no negative numbers.",
                remedy="Correct [render] or the seed.",
            )
        if self.dark_frame and self.ambient is None and not self.sensor.dark_level > 0:
            raise OptionError(
                given=f"The scene {self.name} has a dark frame, no ambient light and no dark level.",
                needed="A dark frame shows what is left when the lamps are off.",
                remedy="Add ambient light or a dark level, or leave the dark frame out.",
            )

        if self.bounce > 0 and self.extinction > 0:
            raise UnsupportedError(
                given=f"The scene {self.name} has bounced light and a medium that takes light away.",
                needed="Light that goes from one part of the surface to another is rendered in clear air only.",
                remedy="Leave out either bounce or extinction.",
            )

    def changed(self, **changes: Any) -> "Scene":
        """Return the scene with some attributes replaced."""
        return replace(self, **changes)
