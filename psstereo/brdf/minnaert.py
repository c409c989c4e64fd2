"""Minnaert's law."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.brdf.brdf import Brdf
from psstereo.brdf.checks import common_shape, parameter, reflectance
from psstereo.brdf.directions import Directions
from psstereo.types import FloatArray

__all__ = ["Minnaert"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Minnaert(Brdf):
    """Darkening (k > 1) or brightening (k < 1) towards the limb, ρ = albedo (k + 1) / (2π) (n·l n·v)^(k − 1) [1]_.

    The factor makes ``albedo`` the share of light along the normal that is reflected; from incidence θ it is
    albedo cos^(k − 1) θ. For k < 1 that exceeds 1 near grazing incidence, and ρ itself grows without bound: `valid_to`
    tells from where. An empirical law for small ranges of angles, moons and dunes under a high sun; not for rendering
    limbs or terminators with k < 1.

    Attributes
    ----------
    albedo : float array (c,) or (..., c)
        Share of light along the normal that is reflected, 0 … 1 [1].
    k : float array (c,) or (..., c)
        Minnaert's exponent, 0 < k ≤ 2; 1 is Lambert [1].

    References
    ----------
    .. [1] M. Minnaert, "The reciprocity principle in lunar photometry", Astrophys. J. 93, 1941. doi:10.1086/144279
    """

    name: ClassVar[str] = "minnaert"
    conserving: ClassVar[bool] = False
    albedo: FloatArray
    k: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "albedo", reflectance(self.albedo, "albedo"))
        remedy = "Take 1 for a matte surface, about 0.5 for a flat disc as of the full moon."
        k = parameter(self.k, "exponent k", low=0.0, high=2.0, unit="1", remedy=remedy, exclude_low=True)
        object.__setattr__(self, "k", k)
        self._shape()

    def _shape(self) -> tuple[int, ...]:
        """Return the shape of the values over the surface."""
        return common_shape(albedo=self.albedo, k=self.k)

    @property
    def channels(self) -> int:
        """See :attr:`Brdf.channels`."""
        return self._shape()[-1]

    @property
    def diffuse_albedo(self) -> FloatArray:
        """πρ under light and eye on the normal, albedo (k + 1) / 2; see :attr:`Brdf.diffuse_albedo`."""
        return np.asarray(self.albedo * (self.k + 1.0) / 2.0)

    def valid_to(self) -> FloatArray:
        """Return the largest incidence at which it reflects no more than it receives.

        Returns
        -------
        float64 array (c,) or (..., c)
            Angle to the normal where albedo cos^(k − 1) = 1; π/2 for k ≥ 1, or where nothing is reflected [rad].
        """
        albedo, k = np.broadcast_arrays(self.albedo, self.k)
        bounded = (k >= 1.0) | (albedo == 0.0)
        log_cosine = np.where(
            bounded, -np.inf, np.log(np.where(bounded, 1.0, albedo)) / np.where(bounded, 1.0, 1.0 - k)
        )
        return np.asarray(np.arctan2(np.sqrt(-np.expm1(2.0 * log_cosine)), np.exp(log_cosine)))

    def evaluate(self, normals: FloatArray, to_light: FloatArray, to_eye: FloatArray) -> FloatArray:
        """Return Minnaert's law; see :meth:`Brdf.evaluate`."""
        at = Directions.of(normals, to_light, to_eye)
        # Logarithms, since the product of two cosines may be too small for a number where its power is not.
        powers = np.exp((self.k - 1.0) * (np.log(at.light) + np.log(at.eye)))
        return at.where_above(self.albedo * (self.k + 1.0) / (2.0 * np.pi) * powers)
