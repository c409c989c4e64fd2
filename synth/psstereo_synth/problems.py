"""Problems with known answers for the benchmarks."""

from functools import partial

import numpy as np

from psstereo.bench import Problem
from psstereo.capture import Capture, Truth
from psstereo_synth.albedo import checker
from psstereo_synth.capture import lambertian_capture
from psstereo_synth.hills import hills
from psstereo_synth.rigs import ring, spiral

__all__ = ["lambertian_problems"]


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
