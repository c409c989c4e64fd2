"""Where normal, light and eye stand to each other, in forms that no cancellation spoils.

Half vectors are left unnormalised, H = l + v: n·H = n·l + n·v is its height, t = H − (n·H) n lies in the surface, and
tan of the angle between half vector and normal is |t| / n·H, good to the last digits where 1 − (n·h)² has none left.
All of it is the same when light and eye change places, also in its rounding.
"""

from dataclasses import dataclass

import numpy as np

from psstereo.types import FloatArray

__all__ = ["Directions", "dot"]


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the products of vectors (..., 3), broadcast against each other, as (..., 1) [any unit]."""
    return np.asarray(np.einsum("...i,...i->...", a, b))[..., None]


@dataclass(frozen=True, kw_only=True, eq=False)
class Directions:
    """Normal, light and eye.

    Attributes
    ----------
    normals, to_light, to_eye : float64 array (..., 3)
        Unit vectors [1].
    light, eye : float64 array (..., 1)
        Cosines to the normal; 1 wherever one of the two is not above the surface, so that nothing divides by 0 [1].
    above : float64 array (..., 1)
        1 where light and eye are above the surface, 0 where they are not, NaN where that is not known [1].
    """

    normals: FloatArray
    to_light: FloatArray
    to_eye: FloatArray
    light: FloatArray
    eye: FloatArray
    above: FloatArray

    @classmethod
    def of(cls, normals: FloatArray, to_light: FloatArray, to_eye: FloatArray) -> "Directions":
        """Return them for unit vectors (..., 3), broadcast against each other."""
        n, to_l, to_e = (np.asarray(a, np.float64) for a in (normals, to_light, to_eye))
        light, eye = np.broadcast_arrays(dot(n, to_l), dot(n, to_e))
        up = (light > 0.0) & (eye > 0.0)
        return cls(
            normals=n,
            to_light=to_l,
            to_eye=to_e,
            light=np.where(up, light, 1.0),
            eye=np.where(up, eye, 1.0),
            above=np.where(np.isnan(light + eye), np.nan, up),
        )

    def half(self) -> tuple[FloatArray, FloatArray]:
        """Return height n·H and squared extent |t|² of the unnormalised half vector, (..., 1) each [1]."""
        height = self.light + self.eye
        flat = (self.to_light + self.to_eye) - height * self.normals
        return height, dot(flat, flat)

    def half_chords(self) -> tuple[FloatArray, FloatArray]:
        """Return sine and cosine of half the angle between light and eye, (..., 1) each [1]."""
        across, along = self.to_light - self.to_eye, self.to_light + self.to_eye
        return 0.5 * np.sqrt(dot(across, across)), 0.5 * np.sqrt(dot(along, along))

    def where_above(self, values: FloatArray) -> FloatArray:
        """Return values (..., c) where light and eye are above the surface, 0 or NaN elsewhere."""
        return np.asarray(np.where(self.above > 0.0, values, self.above))
