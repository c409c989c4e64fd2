"""Ripples: sine waves in rings or in rows."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.types import FloatArray
from psstereo_synth.shapes.checks import finite, places, positive
from psstereo_synth.shapes.finite import SquareRelief
from psstereo_synth.shapes.relief import Elevation

__all__ = ["Ripples"]


@dataclass(frozen=True, kw_only=True)
class Ripples(SquareRelief):
    """z = amplitude cos(2π s / wavelength), with s the distance from the origin, or along a direction.

    Attributes
    ----------
    amplitude, wavelength : float
        Height of a crest over the mean, and distance from crest to crest [length].
    direction : float or None
        For waves in straight rows: where they travel, counter-clockwise from x. None for rings around the origin [rad].
    half_width : float
        Half the side of the square [length].

    Raises
    ------
    InputError
        If a length is not positive, or the direction not finite.
    """

    name: ClassVar[str] = "ripples"
    summary: ClassVar[str] = "Sine waves, in rings or in rows."
    amplitude: float = 0.05
    wavelength: float = 0.5
    direction: float | None = None

    def __post_init__(self) -> None:
        SquareRelief.__post_init__(self)
        positive("relief of ripples", amplitude=self.amplitude, wavelength=self.wavelength)
        if self.direction is not None:
            finite("relief of ripples", direction=self.direction)

    @property
    def _farthest(self) -> float:
        """The largest distance from the crest in the middle that there is in the square [length]."""
        if self.direction is None:
            return math.hypot(*self.extent)
        return self.half_width * (abs(math.cos(self.direction)) + abs(math.sin(self.direction)))

    @property
    def convex(self) -> bool:
        """See :attr:`Relief.convex`; so is the crest in the middle alone, of a wave much longer than the square."""
        return 4.0 * self._farthest <= self.wavelength

    @property
    def bounds(self) -> tuple[float, float]:
        """See :attr:`Relief.bounds`; waves much longer than the square do not reach their trough."""
        return self.amplitude * math.cos(min(2 * math.pi * self._farthest / self.wavelength, math.pi)), self.amplitude

    def evaluate(self, x: FloatArray, y: FloatArray) -> Elevation:
        """Return heights and slopes; see :meth:`Relief.evaluate`."""
        x, y = places(x, y)
        inside = self.inside(x, y)
        x, y = np.where(inside, x, np.nan), np.where(inside, y, np.nan)
        k = 2 * np.pi / self.wavelength
        if self.direction is None:
            phase = k * np.hypot(x, y)
            # sin(phase) / phase has no hole in the middle, where the direction outward has one.
            pull = -self.amplitude * k * k * np.sinc(phase / np.pi)
            return Elevation(height=self.amplitude * np.cos(phase), slope_x=pull * x, slope_y=pull * y)
        kx, ky = k * math.cos(self.direction), k * math.sin(self.direction)
        phase = kx * x + ky * y
        steep = -self.amplitude * np.sin(phase)
        return Elevation(height=self.amplitude * np.cos(phase), slope_x=kx * steep, slope_y=ky * steep)
