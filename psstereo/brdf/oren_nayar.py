"""The rough matte surface of Oren and Nayar."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.brdf.brdf import Brdf
from psstereo.brdf.checks import common_shape, parameter, reflectance
from psstereo.brdf.directions import Directions, dot
from psstereo.types import FloatArray

__all__ = ["OrenNayar"]


@dataclass(frozen=True, kw_only=True, eq=False)
class OrenNayar(Brdf):
    """A rough matte surface of small matte facets: flatter than Lambert's, brighter towards the light [1]_.

    The qualitative model, ρ = albedo / π (A + B max(0, cos Δφ) sin α tan β) with α, β the larger and the smaller of the
    angles of light and eye to the normal, Δφ their difference in azimuth and A = 1 − σ²/2 / (σ² + 0.33),
    B = 0.45 σ² / (σ² + 0.09). Without angles it is max(0, l·v − n·l n·v) / max(n·l, n·v), defined at any incidence.

    Reciprocal. It may reflect more than it receives: near grazing incidence the share tends to albedo (A + B/2), at
    most 1.0152 albedo (at σ = 0.2), so that every albedo up to 0.985 is safe. Light that goes from facet to facet is
    left out, and with it the colour that it picks up: not for deep grooves of a bright material.

    Attributes
    ----------
    albedo : float array (c,) or (..., c)
        Albedo of the facets, 0 … 1 [1].
    roughness : float array (c,) or (..., c)
        Standard deviation σ of the facets' slope angles, 0 (Lambert) … π/2 [rad].

    References
    ----------
    .. [1] M. Oren, S. K. Nayar, "Generalization of Lambert's reflectance model", SIGGRAPH 1994.
       doi:10.1145/192161.192213
    """

    name: ClassVar[str] = "oren-nayar"
    conserving: ClassVar[bool] = False
    albedo: FloatArray
    roughness: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "albedo", reflectance(self.albedo, "albedo"))
        remedy = "Give the standard deviation of the facets' slopes in radians."
        sigma = parameter(self.roughness, "roughness", low=0.0, high=np.pi / 2, unit="rad", remedy=remedy)
        object.__setattr__(self, "roughness", sigma)
        self._shape()

    def _shape(self) -> tuple[int, ...]:
        """Return the shape of the values over the surface."""
        return common_shape(albedo=self.albedo, roughness=self.roughness)

    @property
    def channels(self) -> int:
        """See :attr:`Brdf.channels`."""
        return self._shape()[-1]

    @property
    def diffuse_albedo(self) -> FloatArray:
        """πρ where light or eye is on the normal, A albedo; see :attr:`Brdf.diffuse_albedo`."""
        return np.asarray(self.albedo * self._flat())

    def _flat(self) -> FloatArray:
        """Return A."""
        square = self.roughness**2
        return np.asarray(1.0 - 0.5 * square / (square + 0.33))

    def evaluate(self, normals: FloatArray, to_light: FloatArray, to_eye: FloatArray) -> FloatArray:
        """Return the qualitative model; see :meth:`Brdf.evaluate`."""
        at = Directions.of(normals, to_light, to_eye)
        square = self.roughness**2
        toward = np.maximum(dot(at.to_light, at.to_eye) - at.light * at.eye, 0.0) / np.maximum(at.light, at.eye)
        shape = self._flat() + 0.45 * square / (square + 0.09) * toward
        return at.where_above(self.albedo / np.pi * shape)
