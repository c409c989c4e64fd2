"""An albedo that changes evenly from one side to the other."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from psstereo.types import FloatArray
from psstereo_synth.patterns.pattern import Pattern, albedos, require_points, require_same_channels
from psstereo_synth.shapes.checks import finite, positive

__all__ = ["Gradient"]


@dataclass(frozen=True, kw_only=True)
class Gradient(Pattern):
    """Albedo linear along a direction between two lines, and constant beyond them.

    Attributes
    ----------
    start, end : float or sequence (c,)
        Albedo πρ, 0 … 1, at −half_width and at half_width along the direction; kept as tuples [1].
    direction : float
        Where it changes to, counter-clockwise from x [rad].
    half_width : float
        Half the way between start and end, around the origin [length].

    Raises
    ------
    InputError
        If an albedo is outside 0 … 1, the channels differ, or a number means nothing.
    """

    name: ClassVar[str] = "gradient"
    summary: ClassVar[str] = "Albedo that changes evenly from one side to the other."
    start: npt.ArrayLike = 0.2
    end: npt.ArrayLike = 0.9
    direction: float = 0.0
    half_width: float = 1.0

    def __post_init__(self) -> None:
        finite("gradient", direction=self.direction)
        positive("gradient", half_width=self.half_width)
        most = max(np.size(self.start), np.size(self.end))
        start = albedos("albedo at the start of a gradient", self.start, most)
        end = albedos("albedo at the end of a gradient", self.end, most)
        require_same_channels("gradient", start, end)
        object.__setattr__(self, "start", start)
        object.__setattr__(self, "end", end)

    @property
    def channels(self) -> int:
        """See :attr:`Pattern.channels`."""
        return int(np.size(self.start))

    def evaluate(self, points: FloatArray) -> FloatArray:
        """Return the albedo at points; see :meth:`Pattern.evaluate`."""
        p = require_points(points)
        p = np.where(np.isfinite(p).all(axis=1, keepdims=True), p, np.nan)
        along = p[:, 0] * math.cos(self.direction) + p[:, 1] * math.sin(self.direction)
        share = np.clip(0.5 + 0.5 * along / self.half_width, 0.0, 1.0)[:, None]
        return np.asarray((1.0 - share) * np.asarray(self.start) + share * np.asarray(self.end))
