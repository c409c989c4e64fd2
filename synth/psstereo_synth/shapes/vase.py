"""Half of a vase that lies along y."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.errors import InputError
from psstereo.types import FloatArray
from psstereo_synth.shapes.checks import places, positive
from psstereo_synth.shapes.finite import FiniteRelief
from psstereo_synth.shapes.relief import Elevation

__all__ = ["Vase"]


@dataclass(frozen=True, kw_only=True)
class Vase(FiniteRelief):
    """x² + z² = r(y)² with z > 0: a surface of revolution around y with a belly below and a neck above.

    r(y) = radius (1 − swell sin(π y / half_length)). The sides, where it is vertical, do not belong to it; its two ends
    are open.

    Attributes
    ----------
    radius, half_length : float
        Mean radius, and half the length along y [length].
    swell : float
        How much thicker the belly and thinner the neck are; 0 is half a cylinder, less than 1 [1].

    Raises
    ------
    InputError
        If a length is not positive, or the neck would close.
    """

    name: ClassVar[str] = "vase"
    summary: ClassVar[str] = "Half of a lying vase with belly and neck."
    radius: float = 0.5
    half_length: float = 0.9
    swell: float = 0.4

    def __post_init__(self) -> None:
        positive("vase", radius=self.radius, half_length=self.half_length)
        if not 0.0 <= self.swell < 1.0:
            raise InputError(
                given=f"The swell of a vase is {self.swell}.",
                needed="It is a share of the radius: 0 or more, and less than 1, which would close the neck.",
                remedy="Give another value, or leave it out to take the default.",
            )

    @property
    def convex(self) -> bool:
        """See :attr:`Relief.convex`; only half a cylinder is."""
        return self.swell == 0.0

    @property
    def bounds(self) -> tuple[float, float]:
        """See :attr:`Relief.bounds`."""
        return 0.0, self.radius * (1.0 + self.swell)

    @property
    def extent(self) -> tuple[float, float]:
        """See :attr:`FiniteRelief.extent`."""
        return self.radius * (1.0 + self.swell), self.half_length

    def evaluate(self, x: FloatArray, y: FloatArray) -> Elevation:
        """Return heights and slopes; see :meth:`Relief.evaluate`."""
        x, y = places(x, y)
        y = np.where(np.abs(y) <= self.half_length, y, np.nan)
        turn = np.pi / self.half_length
        r = self.radius * (1.0 - self.swell * np.sin(turn * y))
        r_slope = -self.radius * self.swell * turn * np.cos(turn * y)
        x = np.where(np.abs(x) < r, x, np.nan)
        height = np.sqrt((r - x) * (r + x))
        return Elevation(height=height, slope_x=-x / height, slope_y=r * r_slope / height)
