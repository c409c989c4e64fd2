"""The scene of ``psstereo demo``: painted hills under twelve suns."""

from psstereo.capture import Capture, Truth
from psstereo_synth.albedo import checker
from psstereo_synth.capture import lambertian_capture
from psstereo_synth.hills import hills
from psstereo_synth.rigs import spiral

__all__ = ["demo_capture"]


def demo_capture(size: int = 256, *, lights: int = 12, noise: float = 0.002, seed: int = 0) -> tuple[Capture, Truth]:
    """Make a 16-bit capture of painted hills.

    Parameters
    ----------
    size : int
        Width and height [px].
    lights : int
        Number of suns.
    noise : float
        Standard deviation of the sensor's noise, as a share of full scale [1].
    seed : int
        The same seed gives the same bytes.

    Returns
    -------
    capture : Capture
        The images.
    truth : Truth
        What the images show.
    """
    surface = hills(size, size, seed=seed)
    return lambertian_capture(
        surface, checker((size, size)), spiral(lights), bits=16, noise=noise, seed=seed, name="demo hills"
    )
