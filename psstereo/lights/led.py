"""A lamp at a finite distance, with the emission lobe of an LED."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.errors import RigError
from psstereo.lights.beam import Beam
from psstereo.lights.light import Light
from psstereo.lights.vectors import strengths, unit_vector
from psstereo.types import FloatArray

__all__ = ["Led"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Led(Light):
    """A point source whose radiant intensity falls with the cosine to its axis to the power ``mu``.

    ``E = flux · max(0, axis·d)^mu · max(0, −d·n) / r²`` with d the unit vector from the lamp to the point [1]_.
    Within about five lamp diameters the lamp is no point any more and this falls short.

    Attributes
    ----------
    position : float array (3,)
        Where the lamp is, x right, y up, z toward the camera [length].
    axis : float array (3,)
        Main direction of emission, normalised on entry [1].
    mu : float
        Exponent of the lobe: 0 all around, 1 a Lambertian emitter [1].
    flux : float array (c,)
        Radiant intensity along the axis [W sr⁻¹], or relative.

    References
    ----------
    .. [1] Y. Quéau, B. Durix, T. Wu, D. Cremers, F. Lauze, J.-D. Durou, "LED-based Photometric Stereo: Modeling,
       Calibration and Numerical Solution", J. Math. Imaging Vis. 60, 2018. doi:10.1007/s10851-017-0761-1
    """

    name: ClassVar[str] = "led"
    positional: ClassVar[bool] = True
    position: FloatArray
    axis: FloatArray
    mu: float
    flux: FloatArray

    def __post_init__(self) -> None:
        position = np.array(self.position, np.float64)
        if position.shape != (3,) or not np.isfinite(position).all() or not (np.isfinite(self.mu) and self.mu >= 0):
            raise RigError(
                given=f"A lamp has position {position.tolist()} and exponent mu = {self.mu}.",
                needed="A position is three finite numbers and mu a number of zero or more.",
                remedy="Correct that lamp's row in the lights file.",
            )
        position.flags.writeable = False
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "axis", unit_vector(self.axis, "lamp axis"))
        object.__setattr__(self, "flux", strengths(self.flux, "lamp flux"))

    def _offset(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the unit vectors from points to the lamp and the distances, NaN at the lamp itself."""
        to_lamp = self.position - np.asarray(points, np.float64)
        distance = np.sqrt((to_lamp * to_lamp).sum(axis=-1, keepdims=True))
        distance = np.where(distance > 0, distance, np.nan)
        return to_lamp / distance, distance

    def directions(self, points: FloatArray) -> FloatArray:
        """Return unit vectors to the lamp, NaN at the lamp itself; see :meth:`Light.directions`."""
        return self._offset(points)[0]

    @property
    def channels(self) -> int:
        """See :attr:`Light.channels`."""
        return int(self.flux.size)

    def irradiance(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Return the irradiance from the lamp; see :meth:`Light.irradiance`."""
        beam = next(self.beams(points, 1))
        cosine = (beam.directions * normals).sum(axis=-1, keepdims=True)
        return np.asarray(beam.irradiance * np.maximum(cosine, 0.0))

    def beams(self, points: FloatArray, count: int) -> Iterator[Beam]:
        """Yield the one beam; see :meth:`Light.beams`."""
        del count
        direction, distance = self._offset(points)
        lobe = np.maximum(-(direction @ self.axis)[..., None], 0.0) ** self.mu
        yield Beam(
            directions=direction, irradiance=self.flux * lobe / (distance * distance), distances=distance[..., 0]
        )

    def moved(self, rotation: FloatArray, translation: FloatArray) -> "Led":
        """Move the lamp and turn its axis; see :meth:`Light.moved`."""
        return Led(
            position=rotation @ self.position + translation, axis=rotation @ self.axis, mu=self.mu, flux=self.flux
        )

    def idealised(self) -> "Led":
        """Return the lamp itself; see :meth:`Light.idealised`."""
        return self
