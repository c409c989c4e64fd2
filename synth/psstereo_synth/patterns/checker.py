"""A checkerboard."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from psstereo.types import FloatArray
from psstereo_synth.patterns.pattern import Pattern, albedos, require_points, require_same_channels
from psstereo_synth.shapes.checks import positive, whole

__all__ = ["Checker"]


@dataclass(frozen=True, kw_only=True)
class Checker(Pattern):
    """Squares of two albedos in turn, projected along z, with sharp edges; it goes on beyond the square.

    Attributes
    ----------
    cells : int
        Squares along the side of −half_width ≤ x, y ≤ half_width.
    low, high : float or sequence (c,)
        The two albedos πρ, 0 … 1; the square at the lower left has `low`. Kept as tuples [1].
    half_width : float
        Half the side that holds `cells` squares [length].

    Raises
    ------
    InputError
        If an albedo is outside 0 … 1, the channels differ, or a number means nothing.
    """

    name: ClassVar[str] = "checker"
    summary: ClassVar[str] = "A checkerboard of two albedos."
    cells: int = 8
    low: npt.ArrayLike = 0.25
    high: npt.ArrayLike = 0.75
    half_width: float = 1.0

    def __post_init__(self) -> None:
        whole("checkerboard", least=1, cells=self.cells)
        positive("checkerboard", half_width=self.half_width)
        most = max(np.size(self.low), np.size(self.high))
        low = albedos("low albedo of a checkerboard", self.low, most)
        high = albedos("high albedo of a checkerboard", self.high, most)
        require_same_channels("checkerboard", low, high)
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)

    @property
    def channels(self) -> int:
        """See :attr:`Pattern.channels`."""
        return int(np.size(self.low))

    def evaluate(self, points: FloatArray) -> FloatArray:
        """Return the albedo at points; see :meth:`Pattern.evaluate`."""
        p = require_points(points)
        known = np.isfinite(p).all(axis=1, keepdims=True)
        p = np.where(known, p, 0.0)
        square = np.floor((p[:, :2] + self.half_width) * (0.5 * self.cells / self.half_width)).sum(
            axis=1, keepdims=True
        )
        odd = np.mod(square, 2.0) == 1.0
        return np.where(known, np.where(odd, np.asarray(self.high), np.asarray(self.low)), np.nan)
