"""A cliff: a jump of height."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.types import FloatArray
from psstereo_synth.shapes.checks import places, positive
from psstereo_synth.shapes.finite import SquareRelief
from psstereo_synth.shapes.relief import Elevation

__all__ = ["Cliffs"]


@dataclass(frozen=True, kw_only=True)
class Cliffs(SquareRelief):
    """Low ground at x < 0, high ground at x ≥ 0 and a vertical wall between them.

    A tapered cliff falls smoothly to nothing along y: full height at y ≥ half_width / 2, level ground at
    y ≤ −half_width / 2. So the surface has a jump that ends inside it, which no integrator can hide at the edge.
    Slopes are those of the ground on either side; the wall has none.

    Attributes
    ----------
    height : float
        Of the full cliff [length].
    tapered : bool
        Whether it ends within the square.
    half_width : float
        Half the side of the square [length].

    Raises
    ------
    InputError
        If a length is not positive.
    """

    name: ClassVar[str] = "cliffs"
    summary: ClassVar[str] = "A vertical wall between two grounds, all along or tapered."
    height: float = 0.4
    tapered: bool = False

    def __post_init__(self) -> None:
        SquareRelief.__post_init__(self)
        positive("cliff", height=self.height)

    @property
    def bounds(self) -> tuple[float, float]:
        """See :attr:`Relief.bounds`."""
        return -0.5 * self.height, 0.5 * self.height

    def evaluate(self, x: FloatArray, y: FloatArray) -> Elevation:
        """Return heights, and slopes of the ground; see :meth:`Relief.evaluate`."""
        x, y = places(x, y)
        half = np.where(self.inside(x, y), np.where(x < 0.0, -0.5, 0.5) * self.height, np.nan)
        if not self.tapered:
            return Elevation(height=half, slope_x=0.0 * half, slope_y=0.0 * half)
        s = np.clip(y / self.half_width + 0.5, 0.0, 1.0)
        share = s * s * s * (s * (6.0 * s - 15.0) + 10.0)
        slope = 30.0 * (s * (1.0 - s)) ** 2 / self.half_width
        return Elevation(height=half * share, slope_x=0.0 * half, slope_y=half * slope)
