"""Lights or shutters that are not the same every time."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.types import FloatArray
from psstereo_synth.faults.checks import require_size
from psstereo_synth.faults.fault import Draws, Fault
from psstereo_synth.faults.spread import factor

__all__ = ["Flicker"]


@dataclass(frozen=True, kw_only=True)
class Flicker(Fault):
    """Each image is brighter or darker than its light says, by a factor of its own for all pixels and channels.

    Attributes
    ----------
    rms : float
        Standard deviation of the factors, log-normal with mean 1 [1].

    Raises
    ------
    OptionError
        If it is negative or not finite.
    """

    name: ClassVar[str] = "flicker"
    summary: ClassVar[str] = "The lights flicker: each image is a little brighter or darker than written down."
    rms: float = 0.02

    def __post_init__(self) -> None:
        require_size("flicker", self.rms)

    def factors(self, count: int, draws: Draws) -> FloatArray:
        """Return the true factors of the first `count` exposures, float64 (count,) [1]."""
        return np.array([factor(self.rms, draws.image(i)) for i in range(count)])

    def radiance(self, image: FloatArray, index: int, draws: Draws) -> FloatArray:
        """Return the image times its factor; see :meth:`Fault.radiance`."""
        return image if self.rms == 0 else np.asarray(image * factor(self.rms, draws.image(index)))
