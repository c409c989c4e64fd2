"""A virtual gonioreflectometer: lamps and cameras on a dome around a flat sample."""

import numpy as np

from psstereo.brdf import Brdf
from psstereo.camera import Pose
from psstereo.errors import InputError
from psstereo.lights import Directional
from psstereo.types import FloatArray
from psstereo_synth.rendering import render
from psstereo_synth.scenes import Material, Scene, Viewpoint
from psstereo_synth.sensor import Sensor
from psstereo_synth.shapes import Plane
from psstereo_synth.view import centred_orthographic

__all__ = ["dome", "measure", "photograph"]

_STRENGTH = 750.0
"""Irradiance of a sample that faces the lamp [W m⁻²]."""
_SHAPE, _WIDTH = (3, 3), 0.02
"""Pixels of the image, and the width that it covers of a sample 2 wide: little enough from grazing views too."""


def dome(tilt: float, azimuth: float) -> FloatArray:
    """Return the direction from the sample to a place on the dome.

    Parameters
    ----------
    tilt : float
        Angle to the sample's normal [deg].
    azimuth : float
        From x toward y [deg].

    Returns
    -------
    float64 array (3,)
        Unit vector [1].
    """
    a, b = np.deg2rad([tilt, azimuth])
    return np.array([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)])


def photograph(brdf: Brdf, lights: list[FloatArray], eyes: list[FloatArray]) -> FloatArray:
    """Render a flat sample under each light, from each eye.

    Parameters
    ----------
    brdf : Brdf
        What it is made of, the same everywhere, of one channel.
    lights, eyes : list of float array (3,)
        Unit vectors from the sample [1].

    Returns
    -------
    float64 array (lights, eyes)
        Radiance of the image's middle pixel [W m⁻² sr⁻¹].
    """
    views = []
    for eye in eyes:
        rotation = Pose.looking_at(eye, np.zeros(3)).rotation
        camera, pose = centred_orthographic(_SHAPE, width=_WIDTH, rotation=rotation)
        views.append(Viewpoint(camera=camera, pose=pose))
    scene = Scene(
        name="sample",
        surface=Plane(),
        material=Material(model=brdf),
        viewpoints=tuple(views),
        size=_SHAPE,
        lights=tuple(Directional(direction=way, strength=np.array([_STRENGTH])) for way in lights),
        sensor=Sensor(bits=None, white=1.0),
    )
    middle = _SHAPE[0] // 2, _SHAPE[1] // 2, 0
    taken = [[shot.capture.stack.frame(i)[middle] for shot in render(scene)] for i in range(len(lights))]
    return np.array(taken, np.float64)


def measure(brdf: Brdf, lights: list[FloatArray], eyes: list[FloatArray]) -> FloatArray:
    """Measure ρ for each light and each eye, as radiance over irradiance.

    Parameters
    ----------
    brdf : Brdf
        What the sample is made of, the same everywhere, of one channel.
    lights, eyes : list of float array (3,)
        Unit vectors from the sample, all above it [1].

    Returns
    -------
    float64 array (lights, eyes)
        ρ [sr⁻¹].

    Raises
    ------
    InputError
        If a light is not above the sample, or a camera is not.
    """
    irradiance = _STRENGTH * np.array([way[2] for way in lights])
    if not (irradiance > 0.0).all():
        raise InputError(
            given=f"Lamps stand at the heights {[round(float(way[2]), 6) for way in lights]} over the sample.",
            needed="A reflectance is measured with light on the sample.",
            remedy="Put every lamp above it: a tilt of less than 90°.",
        )
    return np.asarray(photograph(brdf, lights, eyes) / irradiance[:, None])
