"""Scenes that the tests of rendering share."""

import numpy as np

from psstereo.camera import Pose
from psstereo.lights import Ambient, Directional, Disc, Harmonics, Polygon, Sun
from psstereo_synth.patterns import Constant
from psstereo_synth.rendering import render
from psstereo_synth.scenes import Material, Scene, Viewpoint
from psstereo_synth.sensor import Sensor
from psstereo_synth.view import centred_orthographic, centred_pinhole

RADIANCES = Sensor(bits=None, white=1.0)
"""Delivers radiances as they are."""
ALBEDO = 0.6
OBLIQUE = np.array([0.6, 0.3, 0.5]) / np.linalg.norm([0.6, 0.3, 0.5])


def suns(directions, strength=1000.0):
    return tuple(Directional(direction=d, strength=strength) for d in np.atleast_2d(directions))


def scene(surface, lights, size=48, *, cameras=None, **others):
    shape = size if isinstance(size, tuple) else (size, size)
    viewpoints = cameras or (centred_orthographic(shape),)
    given = {"material": Material(albedo=Constant(albedo=ALBEDO)), "sensor": RADIANCES}
    return Scene(
        surface=surface,
        viewpoints=tuple(Viewpoint(camera=camera, pose=pose) for camera, pose in viewpoints),
        size=shape,
        lights=tuple(lights),
        **(given | others),
    )


def pinhole(size=48, position=(0.0, 0.0, 7.0), target=(0.0, 0.0, 0.0), focal=2.6):
    camera, _ = centred_pinhole((size, size), focal=focal * size, distance=1.0)
    return camera, Pose.looking_at(np.array(position), np.array(target))


def slanted(size=48, position=(2.0, 1.0, 4.0)):
    """A parallel camera that looks at the origin from somewhere, with the origin in the middle of its image."""
    rotation = Pose.looking_at(np.array(position), np.zeros(3)).rotation
    return centred_orthographic((size, size), rotation=rotation)


def image(rendering, i=0):
    return rendering.capture.stack.frame(i)[..., 0]


def steps(rendering):
    return {step.name: step for step in rendering.steps}


def ambient():
    return Ambient(radiance=[20.0])


def pair(made, **forced):
    return render(made)[0], render(made.changed(**forced))[0]


WIDE = [
    Sun.of_irradiance(OBLIQUE, 1000.0, angular_radius=0.3),
    Disc(centre=3 * OBLIQUE, axis=-OBLIQUE, radius=0.5, radiance=100.0),
    Polygon(vertices=np.array([[-1, -1, 3], [-1, 1, 3], [1, 1, 3], [1, -1, 3.0]]), radiance=100.0),
    Ambient(radiance=5.0),
    Harmonics(coefficients=[1, 0, 0.5, 0, 0, 0, 0, 0, 0]),
]
