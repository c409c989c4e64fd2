"""The upper half of an ellipsoid."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.types import FloatArray
from psstereo_synth.shapes.checks import places, positive
from psstereo_synth.shapes.finite import FiniteRelief
from psstereo_synth.shapes.relief import Elevation

__all__ = ["Ellipsoid"]


@dataclass(frozen=True, kw_only=True)
class Ellipsoid(FiniteRelief):
    """(x/a)² + (y/b)² + (z/c)² = 1 with z > 0; the rim, where it is vertical, does not belong to it.

    Attributes
    ----------
    radius_x, radius_y, radius_z : float
        Its three half axes a, b and c [length].

    Raises
    ------
    InputError
        If a half axis is not positive.
    """

    name: ClassVar[str] = "ellipsoid"
    summary: ClassVar[str] = "The upper half of an ellipsoid."
    radius_x: float = 0.9
    radius_y: float = 0.7
    radius_z: float = 0.5

    def __post_init__(self) -> None:
        positive("ellipsoid", radius_x=self.radius_x, radius_y=self.radius_y, radius_z=self.radius_z)

    @property
    def convex(self) -> bool:
        """See :attr:`Relief.convex`."""
        return True

    @property
    def bounds(self) -> tuple[float, float]:
        """See :attr:`Relief.bounds`."""
        return 0.0, self.radius_z

    @property
    def extent(self) -> tuple[float, float]:
        """See :attr:`FiniteRelief.extent`."""
        return self.radius_x, self.radius_y

    def evaluate(self, x: FloatArray, y: FloatArray) -> Elevation:
        """Return heights and slopes; see :meth:`Relief.evaluate`."""
        x, y = places(x, y)
        u, v = x / self.radius_x, y / self.radius_y
        across = np.hypot(u, v)
        across = np.where(across < 1.0, across, np.nan)
        # As a product, so that nothing is lost close to the rim.
        share = np.sqrt((1.0 - across) * (1.0 + across))
        return Elevation(
            height=self.radius_z * share,
            slope_x=-(self.radius_z / self.radius_x) * u / share,
            slope_y=-(self.radius_z / self.radius_y) * v / share,
        )
