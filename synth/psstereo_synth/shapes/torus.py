"""The upper half of a torus."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.errors import InputError
from psstereo.types import FloatArray
from psstereo_synth.shapes.checks import places, positive
from psstereo_synth.shapes.finite import FiniteRelief
from psstereo_synth.shapes.relief import Elevation

__all__ = ["Torus"]


@dataclass(frozen=True, kw_only=True)
class Torus(FiniteRelief):
    """(ρ − major)² + z² = minor² with ρ² = x² + y² and z > 0: a ring with a hole in the middle.

    Its two rims, where it is vertical, do not belong to it.

    Attributes
    ----------
    major, minor : float
        From the centre to the middle of the tube, and radius of the tube [length].

    Raises
    ------
    InputError
        If a radius is not positive, or the tube so thick that it closes the hole.
    """

    name: ClassVar[str] = "torus"
    summary: ClassVar[str] = "The upper half of a ring."
    major: float = 0.6
    minor: float = 0.3

    def __post_init__(self) -> None:
        positive("torus", major=self.major, minor=self.minor)
        if self.minor >= self.major:
            raise InputError(
                given=f"A torus has a tube of radius {self.minor} around a circle of radius {self.major}.",
                needed="The tube must be thinner, so that a hole is left in the middle.",
                remedy="Give a smaller minor radius.",
            )

    @property
    def bounds(self) -> tuple[float, float]:
        """See :attr:`Relief.bounds`."""
        return 0.0, self.minor

    @property
    def extent(self) -> tuple[float, float]:
        """See :attr:`FiniteRelief.extent`."""
        return self.major + self.minor, self.major + self.minor

    def evaluate(self, x: FloatArray, y: FloatArray) -> Elevation:
        """Return heights and slopes; see :meth:`Relief.evaluate`."""
        x, y = places(x, y)
        across = np.hypot(x, y)
        across = np.where(np.abs(across - self.major) < self.minor, across, np.nan)
        off = across - self.major
        height = np.sqrt((self.minor - off) * (self.minor + off))
        outward = -off / height
        return Elevation(height=height, slope_x=outward * (x / across), slope_y=outward * (y / across))
