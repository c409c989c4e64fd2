"""Rolling hills: a sum of Gaussians."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from psstereo.types import FloatArray
from psstereo_synth.shapes.checks import places, positive, whole
from psstereo_synth.shapes.extremes import smooth_bounds
from psstereo_synth.shapes.finite import SquareRelief
from psstereo_synth.shapes.relief import Elevation

__all__ = ["GaussianHills"]


@dataclass(frozen=True, kw_only=True)
class GaussianHills(SquareRelief):
    """A smooth relief of Gaussian hills and hollows over a square.

    Attributes
    ----------
    count : int
        Number of Gaussians.
    steepness : float
        Greatest height of a Gaussian over its standard deviation; its steepest slope is 0.61 times that [1].
    seed : int
        The same seed gives the same surface.
    half_width : float
        Half the side of the square [length].

    Raises
    ------
    InputError
        If there are no hills, or one of the numbers is not positive.
    """

    name: ClassVar[str] = "hills"
    summary: ClassVar[str] = "Smooth hills and hollows, a sum of Gaussians."
    count: int = 16
    steepness: float = 0.6
    seed: int = 0

    def __post_init__(self) -> None:
        SquareRelief.__post_init__(self)
        whole("relief of hills", least=1, count=self.count)
        whole("relief of hills", least=0, seed=self.seed)
        positive("relief of hills", steepness=self.steepness)

    @cached_property
    def _hills(self) -> FloatArray:
        """Rows of x, y, standard deviation and height, (count, 4)."""
        rng = np.random.default_rng(self.seed)
        rows = np.zeros((self.count, 4))
        for row in rows:  # one by one, so that more hills leave the first ones as they are
            row[:2] = self.half_width * rng.uniform(-0.9, 0.9, 2)
            row[2] = self.half_width * rng.uniform(0.12, 0.3)
            row[3] = self.steepness * row[2] * rng.uniform(0.5, 1.0) * rng.choice([-1.0, 1.0])
        return rows

    @cached_property
    def _bounds(self) -> tuple[float, float]:
        x, y, sigma, height = self._hills.T

        def heights(axis: FloatArray) -> FloatArray:
            along_x = np.exp(-0.5 * ((axis[:, None] - x) / sigma) ** 2)
            along_y = np.exp(-0.5 * ((axis[:, None] - y) / sigma) ** 2)
            return np.asarray((along_y * height) @ along_x.T)

        return smooth_bounds(heights, self.half_width, float((np.abs(height) / sigma**2).sum()))

    @property
    def bounds(self) -> tuple[float, float]:
        """See :attr:`Relief.bounds`."""
        return self._bounds

    def evaluate(self, x: FloatArray, y: FloatArray) -> Elevation:
        """Return heights and slopes; see :meth:`Relief.evaluate`."""
        x, y = places(x, y)
        inside = self.inside(x, y)
        x, y = np.where(inside, x, np.nan), np.where(inside, y, np.nan)
        z, zx, zy = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
        for x0, y0, sigma, height in self._hills:
            u, v = (x - x0) / sigma, (y - y0) / sigma
            bump = height * np.exp(-0.5 * (u * u + v * v))
            z, zx, zy = z + bump, zx - bump * u / sigma, zy - bump * v / sigma
        return Elevation(height=z, slope_x=zx, slope_y=zy)
