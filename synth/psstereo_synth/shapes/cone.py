"""A cone that stands on its base."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.types import FloatArray
from psstereo_synth.shapes.checks import places, positive
from psstereo_synth.shapes.finite import FiniteRelief
from psstereo_synth.shapes.relief import Elevation

__all__ = ["Cone"]


@dataclass(frozen=True, kw_only=True)
class Cone(FiniteRelief):
    """z = height (1 − ρ / radius) with ρ² = x² + y².

    The tip has no tangent plane. Its slopes are given as 0: the level plane is one of those that touch the cone there,
    and the mean of the slopes around it.

    Attributes
    ----------
    radius, height : float
        Of the base, and of the tip over it [length].

    Raises
    ------
    InputError
        If one of them is not positive.
    """

    name: ClassVar[str] = "cone"
    summary: ClassVar[str] = "A cone with its tip toward the camera."
    radius: float = 0.9
    height: float = 0.6

    def __post_init__(self) -> None:
        positive("cone", radius=self.radius, height=self.height)

    @property
    def convex(self) -> bool:
        """See :attr:`Relief.convex`."""
        return True

    @property
    def bounds(self) -> tuple[float, float]:
        """See :attr:`Relief.bounds`."""
        return 0.0, self.height

    @property
    def extent(self) -> tuple[float, float]:
        """See :attr:`FiniteRelief.extent`."""
        return self.radius, self.radius

    def evaluate(self, x: FloatArray, y: FloatArray) -> Elevation:
        """Return heights and slopes; see :meth:`Relief.evaluate`."""
        x, y = places(x, y)
        across = np.hypot(x, y)
        across = np.where(across <= self.radius, across, np.nan)
        steep = self.height / self.radius
        beside_tip = np.where(across == 0.0, 1.0, across)
        return Elevation(
            height=steep * (self.radius - across),
            slope_x=-steep * (x / beside_tip),
            slope_y=-steep * (y / beside_tip),
        )
