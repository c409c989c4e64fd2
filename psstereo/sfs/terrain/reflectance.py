"""How bright ground of given slopes looks from above, and how that changes with the slopes."""

import math
from dataclasses import dataclass

import numpy as np

from psstereo.brdf import lunar_weight
from psstereo.types import FloatArray

__all__ = ["Ground", "GroundShading"]


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundShading:
    """Brightness and its derivatives.

    Attributes
    ----------
    value : float64 array (h, w)
        Brightness of ground of albedo 1; not clipped, so negative where the ground turns away from the sun [1].
    along_x, along_y : float64 arrays (h, w)
        Derivatives by the slopes along x and y [1].
    cosine : float64 array (h, w)
        Cosine of the angle between normal and sun [1].
    """

    value: FloatArray
    along_x: FloatArray
    along_y: FloatArray
    cosine: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """Reflectance under one sun, seen from one direction: R = μ₀ (2L / (μ₀ + μ) + 1 − L).

    μ₀ and μ are the cosines between the normal and the directions to sun and eye. L = 0 is Lambert's matte ground,
    L = 1 Lommel and Seeliger's dust, and between the two lies McEwen's mixture for the Moon (``LunarLambert``).

    Attributes
    ----------
    sun, eye : float64 arrays (3,)
        Unit vectors toward sun and eye, x east, y north, z up [1].
    lunar : float
        L, 0 … 1 [1].
    """

    sun: FloatArray
    eye: FloatArray
    lunar: float

    @classmethod
    def under(cls, sun: FloatArray, eye: FloatArray, lunar: float | None) -> "Ground":
        """Return the ground under a sun; None for the Moon's weight at the angle between sun and eye."""
        if lunar is None:
            phase = math.atan2(float(np.linalg.norm(np.cross(sun, eye))), float(sun @ eye))
            lunar = float(lunar_weight(np.asarray(phase)))
        return cls(sun=sun, eye=eye, lunar=lunar)

    def shade(self, slope_x: FloatArray, slope_y: FloatArray) -> GroundShading:
        """Return brightness and derivatives at slopes (h, w) along x and y."""
        short = 1.0 / np.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
        light, light_x, light_y = _cosine(self.sun, slope_x, slope_y, short)
        if self.lunar == 0.0:
            return GroundShading(value=light, along_x=light_x, along_y=light_y, cosine=light)
        eye, eye_x, eye_y = _cosine(self.eye, slope_x, slope_y, short)
        # Where both are near zero the pixel counts for nothing; the floor only keeps numbers finite.
        total = np.maximum(light + eye, 1e-3)
        mixture = 2.0 * self.lunar / total
        by_light = mixture * (eye / total) + (1.0 - self.lunar)
        by_eye = -mixture * (light / total)
        return GroundShading(
            value=light * (mixture + 1.0 - self.lunar),
            along_x=by_light * light_x + by_eye * eye_x,
            along_y=by_light * light_y + by_eye * eye_y,
            cosine=light,
        )


def _cosine(
    direction: FloatArray, slope_x: FloatArray, slope_y: FloatArray, short: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return normal · direction and its derivatives by the slopes; `short` is the normal's z."""
    x, y, z = (float(part) for part in direction)
    value = (z - x * slope_x - y * slope_y) * short
    square = short * short
    return value, -x * short - value * slope_x * square, -y * short - value * slope_y * square
