"""Steps: terraces with ramps between them."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.errors import InputError
from psstereo.types import FloatArray
from psstereo_synth.shapes.checks import places, positive, whole
from psstereo_synth.shapes.finite import SquareRelief
from psstereo_synth.shapes.relief import Elevation

__all__ = ["Steps"]


@dataclass(frozen=True, kw_only=True)
class Steps(SquareRelief):
    """Level terraces of equal width that rise with x, with smooth ramps (of fifth degree, C²) between them.

    Attributes
    ----------
    count : int
        Number of ramps; there is one terrace more.
    rise, ramp : float
        Height and width of a ramp; the steepest slope is 15/8 rise/ramp. For a vertical wall take
        :class:`~psstereo_synth.shapes.cliffs.Cliffs` [length].
    half_width : float
        Half the side of the square [length].

    Raises
    ------
    InputError
        If a number is not positive, or a ramp wider than the terraces are apart.
    """

    name: ClassVar[str] = "steps"
    summary: ClassVar[str] = "Level terraces with smooth ramps between them."
    count: int = 4
    rise: float = 0.1
    ramp: float = 0.1

    def __post_init__(self) -> None:
        SquareRelief.__post_init__(self)
        whole("flight of steps", least=1, count=self.count)
        positive("flight of steps", rise=self.rise, ramp=self.ramp)
        if self.ramp > self._pitch:
            raise InputError(
                given=f"The ramps of a flight of steps are {self.ramp:g} wide and {self._pitch:g} apart.",
                needed="They must not overlap.",
                remedy="Give narrower ramps, or fewer of them.",
            )

    @property
    def _pitch(self) -> float:
        return 2.0 * self.half_width / (self.count + 1)

    @property
    def bounds(self) -> tuple[float, float]:
        """See :attr:`Relief.bounds`."""
        return 0.0, self.count * self.rise

    def evaluate(self, x: FloatArray, y: FloatArray) -> Elevation:
        """Return heights and slopes; see :meth:`Relief.evaluate`."""
        x, y = places(x, y)
        x = np.where(self.inside(x, y), x, np.nan)
        along = (x + self.half_width) / self._pitch
        nearest = np.clip(np.rint(along), 1, self.count)
        s = np.clip((along - nearest) * (self._pitch / self.ramp) + 0.5, 0.0, 1.0)
        share = s * s * s * (s * (6.0 * s - 15.0) + 10.0)
        slope = (self.rise / self.ramp) * 30.0 * (s * (1.0 - s)) ** 2
        # The slope across is nought where the surface is and NaN where it is not.
        return Elevation(height=self.rise * (nearest - 1.0 + share), slope_x=slope, slope_y=0.0 * slope)
