"""A light so far away that its direction and strength are the same everywhere."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.lights.beam import Beam
from psstereo.lights.light import Distant
from psstereo.lights.vectors import strengths, unit_vector
from psstereo.types import FloatArray

__all__ = ["Directional"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Directional(Distant):
    """A distant light: one direction, one strength a channel.

    Use :class:`~psstereo.lights.led.Led` for a lamp whose distance is less than about fifty times the object's size:
    the direction then changes by more than a degree across the object.

    Attributes
    ----------
    direction : float array (3,)
        Toward the light, x right, y up, z toward the camera; normalised on entry [1].
    strength : float array (c,)
        Irradiance of a surface that faces the light, L_sun Ω_sun for the sun [W m⁻²], or relative.
    """

    name: ClassVar[str] = "directional"
    direction: FloatArray
    strength: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "direction", unit_vector(self.direction, "light direction"))
        object.__setattr__(self, "strength", strengths(self.strength, "light strength"))

    @classmethod
    def sun(cls, direction: FloatArray, *, radiance: float, solid_angle: float) -> "Directional":
        """Build a narrow sun, whose irradiance is ``E = L_sun Ω_sun max(0, n·l)``.

        Parameters
        ----------
        direction : float array (3,)
            Toward the sun [1].
        radiance : float
            L_sun [W m⁻² sr⁻¹].
        solid_angle : float
            Ω_sun [sr].

        Returns
        -------
        Directional
            The light.
        """
        return cls(direction=direction, strength=np.array([radiance * solid_angle]))

    def irradiance(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Return strength · max(0, n·l); see :meth:`Light.irradiance`."""
        del points  # a distant light looks the same from everywhere
        cosine = np.maximum(np.asarray(normals, np.float64) @ self.direction, 0.0)
        return np.asarray(cosine[..., None] * self.strength)

    def beams(self, points: FloatArray, count: int) -> Iterator[Beam]:
        """Yield the one beam; see :meth:`Light.beams`."""
        del points, count
        yield Beam(directions=self.direction, irradiance=self.strength)

    def moved(self, rotation: FloatArray, translation: FloatArray) -> "Directional":
        """Turn the direction; see :meth:`Light.moved`."""
        del translation  # nothing is far enough from here to matter
        return Directional(direction=rotation @ self.direction, strength=self.strength)

    def idealised(self) -> "Directional":
        """Return the light itself; see :meth:`Light.idealised`."""
        return self
