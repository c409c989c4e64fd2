"""The interface of what goes wrong in a capture."""

from abc import ABC
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.lights import Rig
from psstereo.types import Array, FloatArray

__all__ = ["Fault"]


@dataclass(frozen=True)
class Fault(ABC):
    """One thing that goes wrong; a fault overrides the one step at which it strikes.

    Every step gets a generator of its own, seeded by the capture's seed, the fault and the image, so that images can
    be made in any order and on any number of threads.
    """

    name: ClassVar[str]
    summary: ClassVar[str]

    def rig(self, rig: Rig, rng: np.random.Generator) -> Rig:
        """Return the lights as they are written down."""
        del rng
        return rig

    def order(self, order: Sequence[int], rng: np.random.Generator) -> Sequence[int]:
        """Return which light each written image really shows."""
        del rng
        return order

    def radiance(self, image: FloatArray, index: int, rng: np.random.Generator) -> FloatArray:
        """Return the radiance (h, w, c) that reaches the sensor in image `index`."""
        del index, rng
        return image

    def values(self, image: Array, index: int, rng: np.random.Generator) -> Array:
        """Return the numbers (h, w, c) that the sensor delivers for image `index`."""
        del index, rng
        return image
