"""The upper half of a sphere."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.types import FloatArray
from psstereo_synth.shapes.checks import places, positive
from psstereo_synth.shapes.finite import FiniteRelief
from psstereo_synth.shapes.relief import Elevation

__all__ = ["Sphere"]


@dataclass(frozen=True, kw_only=True)
class Sphere(FiniteRelief):
    """x² + y² + z² = radius² with z > 0; the rim, where it is vertical, does not belong to it.

    Attributes
    ----------
    radius : float
        Radius [length].

    Raises
    ------
    InputError
        If the radius is not positive.
    """

    name: ClassVar[str] = "sphere"
    summary: ClassVar[str] = "The upper half of a sphere."
    radius: float = 0.9

    def __post_init__(self) -> None:
        positive("sphere", radius=self.radius)

    @property
    def convex(self) -> bool:
        """See :attr:`Relief.convex`."""
        return True

    @property
    def bounds(self) -> tuple[float, float]:
        """See :attr:`Relief.bounds`."""
        return 0.0, self.radius

    @property
    def extent(self) -> tuple[float, float]:
        """See :attr:`FiniteRelief.extent`."""
        return self.radius, self.radius

    def evaluate(self, x: FloatArray, y: FloatArray) -> Elevation:
        """Return z, −x/z and −y/z; see :meth:`Relief.evaluate`."""
        x, y = places(x, y)
        across = np.hypot(x, y)
        across = np.where(across < self.radius, across, np.nan)
        # As a product, so that nothing is lost close to the rim.
        height = np.sqrt((self.radius - across) * (self.radius + across))
        return Elevation(height=height, slope_x=-x / height, slope_y=-y / height)
