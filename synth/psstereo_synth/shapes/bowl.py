"""The lower half of a sphere, seen from inside."""

from dataclasses import dataclass
from typing import ClassVar

from psstereo.types import FloatArray
from psstereo_synth.shapes.checks import positive
from psstereo_synth.shapes.finite import FiniteRelief
from psstereo_synth.shapes.relief import Elevation
from psstereo_synth.shapes.sphere import Sphere

__all__ = ["Bowl"]


@dataclass(frozen=True, kw_only=True)
class Bowl(FiniteRelief):
    """x² + y² + z² = radius² with z < 0: its rim shadows its floor. The rim itself does not belong to it.

    Attributes
    ----------
    radius : float
        Radius [length].

    Raises
    ------
    InputError
        If the radius is not positive.
    """

    name: ClassVar[str] = "bowl"
    summary: ClassVar[str] = "The lower half of a sphere, from inside."
    radius: float = 0.9

    def __post_init__(self) -> None:
        positive("bowl", radius=self.radius)

    @property
    def bounds(self) -> tuple[float, float]:
        """See :attr:`Relief.bounds`."""
        return -self.radius, 0.0

    @property
    def extent(self) -> tuple[float, float]:
        """See :attr:`FiniteRelief.extent`."""
        return self.radius, self.radius

    def evaluate(self, x: FloatArray, y: FloatArray) -> Elevation:
        """Return the sphere's heights and slopes with the other sign; see :meth:`Relief.evaluate`."""
        upper = Sphere(radius=self.radius).evaluate(x, y)
        return Elevation(height=-upper.height, slope_x=-upper.slope_x, slope_y=-upper.slope_y)
