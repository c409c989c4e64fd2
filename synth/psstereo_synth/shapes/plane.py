"""A plane."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.types import FloatArray
from psstereo_synth.shapes.checks import finite, places
from psstereo_synth.shapes.finite import SquareRelief
from psstereo_synth.shapes.relief import Elevation

__all__ = ["Plane"]


@dataclass(frozen=True, kw_only=True)
class Plane(SquareRelief):
    """z = slope_x x + slope_y y over a square.

    Attributes
    ----------
    slope_x, slope_y : float
        ∂z/∂x and ∂z/∂y [1].
    half_width : float
        Half the side of the square [length].

    Raises
    ------
    InputError
        If a slope is not finite or the width not positive.
    """

    name: ClassVar[str] = "plane"
    summary: ClassVar[str] = "A tilted plane."
    slope_x: float = 0.0
    slope_y: float = 0.0

    def __post_init__(self) -> None:
        SquareRelief.__post_init__(self)
        finite("plane", slope_x=self.slope_x, slope_y=self.slope_y)

    @property
    def convex(self) -> bool:
        """See :attr:`Relief.convex`."""
        return True

    @property
    def bounds(self) -> tuple[float, float]:
        """See :attr:`Relief.bounds`; both are 0 for a level plane."""
        top = (abs(self.slope_x) + abs(self.slope_y)) * self.half_width
        return 0.0 - top, top

    def evaluate(self, x: FloatArray, y: FloatArray) -> Elevation:
        """Return heights and the two slopes; see :meth:`Relief.evaluate`."""
        x, y = places(x, y)
        inside = self.inside(x, y)
        x, y = np.where(inside, x, np.nan), np.where(inside, y, np.nan)
        return Elevation(
            height=self.slope_x * x + self.slope_y * y,
            slope_x=np.where(inside, self.slope_x, np.nan),
            slope_y=np.where(inside, self.slope_y, np.nan),
        )
