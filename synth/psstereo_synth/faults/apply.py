"""Several faults at once, in the order in which they are given.

A renderer goes through the exposures like this; exposure k is made under light k of the true rig::

    order = apply_order(faults, len(rig), seed)
    for i, k in enumerate(order):  # in any order, on any threads
        radiance = apply_radiance(faults, render(rig.lights[k]), k, seed)
        image[i] = apply_values(faults, sensor.expose(radiance, k), k, sensor.white_value, seed)
    written = apply_rig(faults, rig, seed)

Everything random goes by the exposure, so an image that is written twice has the same noise twice.
"""

from collections.abc import Iterator, Sequence

from psstereo.lights import Rig
from psstereo.types import Array, FloatArray
from psstereo_synth.faults.fault import Draws, Fault

__all__ = ["apply_order", "apply_radiance", "apply_rig", "apply_values"]


def apply_rig(faults: Sequence[Fault], rig: Rig, seed: int) -> Rig:
    """Return the lights as they are written down.

    Parameters
    ----------
    faults : sequence of Fault
        What goes wrong.
    rig : Rig
        The true lights.
    seed : int
        Of the capture, zero or more.

    Returns
    -------
    Rig
        As many lights.

    Raises
    ------
    PsstereoError
        If a fault cannot befall this rig.
    """
    for fault, draws in _with_draws(faults, seed):
        rig = fault.rig(rig, draws)
    return rig


def apply_order(faults: Sequence[Fault], count: int, seed: int) -> tuple[int, ...]:
    """Return which exposure each written image holds.

    Parameters
    ----------
    faults : sequence of Fault
        What goes wrong.
    count : int
        Number of exposures.
    seed : int
        Of the capture, zero or more.

    Returns
    -------
    tuple of int
        `count` indices from 0 to count − 1.

    Raises
    ------
    PsstereoError
        If a fault cannot befall so few images.
    """
    order: Sequence[int] = range(count)
    for fault, draws in _with_draws(faults, seed):
        order = fault.order(order, draws)
    return tuple(order)


def apply_radiance(faults: Sequence[Fault], image: FloatArray, index: int, seed: int) -> FloatArray:
    """Return the radiance that reaches the sensor.

    Parameters
    ----------
    faults : sequence of Fault
        What goes wrong.
    image : float array (h, w, c)
        What the scene sends to the camera [W m⁻² sr⁻¹].
    index : int
        Of the exposure.
    seed : int
        Of the capture, zero or more.

    Returns
    -------
    float array (h, w, c)
        The image itself if nothing befalls it [W m⁻² sr⁻¹].

    Raises
    ------
    PsstereoError
        If a fault cannot befall this image.
    """
    for fault, draws in _with_draws(faults, seed):
        image = fault.radiance(image, index, draws)
    return image


def apply_values(faults: Sequence[Fault], image: Array, index: int, white: float, seed: int) -> Array:
    """Return the numbers that the sensor delivers.

    Parameters
    ----------
    faults : sequence of Fault
        What goes wrong.
    image : array (h, w, c)
        Values.
    index : int
        Of the exposure.
    white : float
        Value at full scale, `Sensor.white_value`.
    seed : int
        Of the capture, zero or more.

    Returns
    -------
    array (h, w, c)
        The image itself if nothing befalls it.

    Raises
    ------
    PsstereoError
        If a fault cannot befall this image.
    """
    for fault, draws in _with_draws(faults, seed):
        image = fault.values(image, index, white, draws)
    return image


def _with_draws(faults: Sequence[Fault], seed: int) -> Iterator[tuple[Fault, Draws]]:
    """Yield each fault with random numbers of its own."""
    for place, fault in enumerate(faults):
        yield fault, Draws(seed, place)
