"""Light from one direction: what shading and shadow casting work with."""

from dataclasses import dataclass

import numpy as np

from psstereo.types import FloatArray

__all__ = ["Beam"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Beam:
    """What a light, or a small part of an extended one, sends to each of some points.

    A light is the sum of its beams: of one for a sun or a lamp, of a quadrature for whatever has an extent.

    Attributes
    ----------
    directions : float64 array (3,) or (..., 3)
        Unit vectors from the points to the source; one for all points if it is distant [1].
    irradiance : float64 array (c,) or (..., c)
        Of a surface that faces the beam, L dΩ; a tilted one gets max(0, n·l) of it [W m⁻²].
    distances : float64 array (...) or float
        To the source; what lies beyond casts no shadow. Infinite for a distant light [length].
    """

    directions: FloatArray
    irradiance: FloatArray
    distances: FloatArray | float = np.inf

    @property
    def parallel(self) -> bool:
        """Whether the beam comes from the same direction for every point, from infinitely far away."""
        return self.directions.ndim == 1 and np.ndim(self.distances) == 0 and bool(np.isinf(self.distances))
