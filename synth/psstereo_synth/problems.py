"""Problems with known answers for the benchmarks."""

from functools import partial

import numpy as np

from psstereo.bench import Problem
from psstereo.capture import Capture, Truth
from psstereo.stack import MemoryStack
from psstereo_synth.albedo import checker
from psstereo_synth.capture import expose, lambertian_capture
from psstereo_synth.hills import hills
from psstereo_synth.rigs import ring, spiral

__all__ = ["lambertian_problems", "solver_problems"]

_EXPONENT, _STRENGTH = 60, 0.5
"""Of the highlights: Blinn and Phong's lobe over the brightness of a white surface that faces the light."""


def lambertian_problems(size: int = 256) -> list[Problem]:
    """Return matte scenes from easy to hard.

    Parameters
    ----------
    size : int
        Width and height of the images [px].

    Returns
    -------
    list of Problem
        Each is made when it is asked for.
    """
    make = partial(_hills, size)
    return [
        Problem(name="exact", summary="float64, steep hills, attached shadows", make=partial(make, 24, 2.5, None)),
        Problem(name="16 bit", summary="the same, rounded to 16 bit", make=partial(make, 24, 2.5, 16)),
        Problem(name="8 bit", summary="the same, rounded to 8 bit", make=partial(make, 24, 2.5, 8)),
        Problem(name="noise", summary="1 % noise, 16 bit", make=partial(make, 24, 2.5, 16, noise=0.01)),
        Problem(name="four lights", summary="a ring of four suns", make=partial(make, 4, 1.0, 16, on_ring=True)),
        Problem(name="narrow cone", summary="24 suns within 5° of the view", make=partial(make, 24, 1.0, 16, tilt=5.0)),
    ]


def solver_problems(width: int, height: int, lights: int) -> list[Problem]:
    """Return what tells solvers apart: a matte surface, the same with noise, and with highlights.

    Suns on a dome to 60°, attached shadows, albedo 0.2 to 0.8, 16 bit, gray.

    Parameters
    ----------
    width, height : int
        Of the images [px].
    lights : int
        How many.

    Returns
    -------
    list of Problem
        Each is made when it is asked for.
    """
    make = partial(_shiny, width, height, lights)
    return [
        Problem(name="matte", summary="nothing but attached shadows", make=partial(make, noise=0.0, strength=0.0)),
        Problem(name="noise", summary="1 % of full scale", make=partial(make, noise=0.01, strength=0.0)),
        Problem(name="highlights", summary="a narrow lobe", make=partial(make, noise=0.0, strength=_STRENGTH)),
    ]


def _shiny(width: int, height: int, lights: int, *, noise: float, strength: float) -> tuple[Capture, Truth]:
    directions = spiral(lights, max_tilt=float(np.radians(60.0)))
    surface = hills(width, height, steepness=1.5)
    albedo = 0.2 + 0.6 * checker((height, width)) / checker((height, width)).max()
    capture, truth = lambertian_capture(surface, albedo, directions, bits=None)
    images = capture.stack.read()
    if strength > 0:
        half = directions + np.array([0.0, 0.0, 1.0])
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        top = images.max() / albedo.max()
        for index, (light, middle) in enumerate(zip(directions, half, strict=True)):
            lobe = np.maximum(surface.normals @ middle, 0.0) ** _EXPONENT
            lit = surface.mask & (surface.normals @ light > 0)
            images[index] += (strength * top * np.where(lit, lobe, 0.0))[..., None]
    stack = MemoryStack(expose(0.5 * images, bits=16, noise=noise))
    return Capture(stack=stack, rig=capture.rig, mask=surface.mask, name="solvers"), truth


def _hills(
    size: int,
    lights: int,
    steepness: float,
    bits: int | None,
    *,
    noise: float = 0.0,
    tilt: float = 60.0,
    on_ring: bool = False,
) -> tuple[Capture, Truth]:
    directions = ring(lights) if on_ring else spiral(lights, max_tilt=float(np.radians(tilt)))
    surface = hills(size, size, steepness=steepness)
    return lambertian_capture(surface, checker((size, size)), directions, bits=bits, noise=noise)
