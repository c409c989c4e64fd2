"""The interface of what goes wrong in a capture."""

from abc import ABC
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.lights import Rig
from psstereo.types import Array, FloatArray
from psstereo_synth.streams import Stream, generator

__all__ = ["Draws", "Fault"]


@dataclass(frozen=True)
class Draws:
    """The random numbers of one fault in one capture.

    Attributes
    ----------
    seed : int
        Of the capture, zero or more.
    fault : int
        Place of the fault among those of the capture, so that two of the same kind differ.
    """

    seed: int
    fault: int = 0

    def capture(self) -> np.random.Generator:
        """Return a generator for what is the same in all images, at its beginning every time."""
        return generator(self.seed, Stream.FAULT, self.fault, 0)

    def image(self, index: int) -> np.random.Generator:
        """Return a generator for one exposure, at its beginning every time."""
        return generator(self.seed, Stream.FAULT, self.fault, 1, index)


@dataclass(frozen=True)
class Fault(ABC):
    """One thing that goes wrong; a fault overrides the one step at which it strikes.

    Exposures are counted in the order of the true lights: exposure k is made under light k. What a step does depends on
    its arguments and the seed alone, so images can be made in any order and on any number of threads. No step changes
    what it is given; one that has nothing to do returns it.
    """

    name: ClassVar[str]
    summary: ClassVar[str]

    def rig(self, rig: Rig, draws: Draws) -> Rig:
        """Return the lights as they are written down.

        Parameters
        ----------
        rig : Rig
            The lights as they are, or as earlier faults left them.
        draws : Draws
            Random numbers.

        Returns
        -------
        Rig
            As many lights.
        """
        del draws
        return rig

    def order(self, order: Sequence[int], draws: Draws) -> Sequence[int]:
        """Return which exposure each written image really holds.

        Parameters
        ----------
        order : sequence of int
            One index of an exposure for each written image: 0, 1, 2 …, or what earlier faults made of it.
        draws : Draws
            Random numbers.

        Returns
        -------
        sequence of int
            Of the same length.
        """
        del draws
        return order

    def radiance(self, image: FloatArray, index: int, draws: Draws) -> FloatArray:
        """Return the radiance that reaches the sensor.

        Parameters
        ----------
        image : float array (h, w, c)
            What the scene sends to the camera [W m⁻² sr⁻¹].
        index : int
            Of the exposure.
        draws : Draws
            Random numbers.

        Returns
        -------
        float array (h, w, c)
            Not negative [W m⁻² sr⁻¹].
        """
        del index, draws
        return image

    def values(self, image: Array, index: int, white: float, draws: Draws) -> Array:
        """Return the numbers that the sensor delivers.

        Parameters
        ----------
        image : array (h, w, c)
            Values.
        index : int
            Of the exposure.
        white : float
            Value at full scale; less than the type holds for a sensor of 10, 12 or 14 bits.
        draws : Draws
            Random numbers.

        Returns
        -------
        array (h, w, c)
            Values of the same type.
        """
        del index, white, draws
        return image
