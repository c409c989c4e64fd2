"""Microfacets of the GGX distribution, over a matte body."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.brdf.brdf import Brdf
from psstereo.brdf.checks import common_shape, parameter, reflectance
from psstereo.brdf.directions import Directions
from psstereo.types import FloatArray

__all__ = ["Ggx"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Ggx(Brdf):
    """Tiny mirrors that face many ways, over a matte body: metals, paints, plastics, glazes.

    ρ = D G F / (4 n·l n·v) + (1 − F(n·l)) (1 − F(n·v)) albedo / π, with α = roughness² and

    * D = α² / (π ((n·h)² (α² − 1) + 1)²), the distribution of Trowbridge and Reitz, called GGX [1]_;
    * G, Smith's masking and shadowing, correlated by height [2]_;
    * F(x) = F₀ + (1 − F₀)(1 − x)⁵, Schlick's fit of Fresnel's reflectance, at x = l·h in the mirrors [3]_.

    The body gets what the surface lets through on the way in and on the way out, which keeps the sum reciprocal. The
    form is that of Shirley and others [4]_ without their factor 21 / (20 (1 − F₀)), which suits smooth surfaces only;
    so it reflects no more than it receives for any roughness, F₀ and albedo. Light that meets several mirrors is lost:
    of light along the normal a metal with F₀ = 1 reflects 92 % at roughness 0.5 and 31 % at roughness 1; not for rough
    metals where absolute radiance counts. Schlick's fit knows no dip before grazing incidence, as real metals have.

    D is computed from the unnormalised half vector H, height n·H and extent t (`directions.py`), as
    α² |H|⁴ / (π (α² (n·H)² + t²)²), in which nothing cancels.

    Attributes
    ----------
    albedo : float array (c,) or (..., c)
        Albedo of the matte body, 0 (a metal) … 1 [1].
    f0 : float array (c,) or (..., c)
        Reflectance of the mirrors at normal incidence, 0 … 1: about 0.04 for plastics, above 0.5 for metals [1].
    roughness : float array (c,) or (..., c)
        Roughness, 0.001 … 1; a perfect mirror has no BRDF [1].

    References
    ----------
    .. [1] B. Walter, S. R. Marschner, H. Li, K. E. Torrance, "Microfacet models for refraction through rough surfaces",
       Eurographics Symposium on Rendering, 2007
    .. [2] E. Heitz, "Understanding the masking-shadowing function in microfacet-based BRDFs", J. Computer Graphics
       Techniques 3(2), 2014
    .. [3] C. Schlick, "An inexpensive BRDF model for physically-based rendering", Computer Graphics Forum 13, 1994.
       doi:10.1111/1467-8659.1330233
    .. [4] P. Shirley, B. Smits, H. Hu, E. Lafortune, "A practitioners' assessment of light reflection models", Pacific
       Graphics, 1997
    """

    name: ClassVar[str] = "ggx"
    albedo: FloatArray
    f0: FloatArray
    roughness: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "albedo", reflectance(self.albedo, "albedo"))
        object.__setattr__(self, "f0", reflectance(self.f0, "reflectance F₀"))
        remedy = "α is roughness²; take 0.001 for what is nearly a mirror, and trace rays for a perfect one."
        roughness = parameter(self.roughness, "roughness", low=1e-3, high=1.0, unit="1", remedy=remedy)
        object.__setattr__(self, "roughness", roughness)
        self._shape()

    def _shape(self) -> tuple[int, ...]:
        """Return the shape of the values over the surface."""
        return common_shape(albedo=self.albedo, f0=self.f0, roughness=self.roughness)

    @property
    def channels(self) -> int:
        """See :attr:`Brdf.channels`."""
        return self._shape()[-1]

    @property
    def diffuse_albedo(self) -> FloatArray:
        """πρ of the body under light and eye on the normal, (1 − F₀)² albedo; see :attr:`Brdf.diffuse_albedo`."""
        return np.broadcast_to((1.0 - self.f0) ** 2 * self.albedo, self._shape())

    def evaluate(self, normals: FloatArray, to_light: FloatArray, to_eye: FloatArray) -> FloatArray:
        """Return mirrors and body; see :meth:`Brdf.evaluate`."""
        at = Directions.of(normals, to_light, to_eye)
        height, extent = at.half()
        square = self.roughness**4  # α²
        length = height**2 + extent
        facets = square * length**2 / (np.pi * (square * height**2 + extent) ** 2)
        sine, cosine = at.half_chords()
        mirrored = self.f0 + (1.0 - self.f0) * (sine**2 / (1.0 + cosine)) ** 5
        body = (1.0 - self.f0) ** 2 * (1.0 - (1.0 - at.light) ** 5) * (1.0 - (1.0 - at.eye) ** 5)
        return at.where_above(facets * _visibility(at.light, at.eye, square) * mirrored + body * self.albedo / np.pi)


def _visibility(light: FloatArray, eye: FloatArray, square: FloatArray) -> FloatArray:
    """Return G / (4 n·l n·v) of Smith's height-correlated form for the cosines and α²."""

    def root(cosine: FloatArray) -> FloatArray:
        return np.asarray(np.sqrt(cosine**2 + square * np.maximum(1.0 - cosine**2, 0.0)))

    return np.asarray(0.5 / (light * root(eye) + eye * root(light)))
