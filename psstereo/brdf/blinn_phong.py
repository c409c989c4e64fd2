"""Blinn's highlight around the half vector, over a matte surface."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.brdf.brdf import Brdf
from psstereo.brdf.checks import common_shape, in_total, parameter, reflectance
from psstereo.brdf.directions import Directions
from psstereo.types import FloatArray

__all__ = ["BlinnPhong"]


@dataclass(frozen=True, kw_only=True, eq=False)
class BlinnPhong(Brdf):
    """A matte surface with a highlight that grows long near grazing, ρ = diffuse / π + specular N(e) (n·h)^e [1]_.

    The usual factor (e + 8) / (8π) is an approximation that reflects up to 7.5 % more than it receives (at normal
    incidence, e = 8.8). Here N is the exact one for normal incidence,

        N(e) = (e + 2) (e + 4) / (8π (e + 2^(−e/2))),

    the inverse of ∫ cos^e(θ/2) cos θ dΩ. At oblique incidence the lobe reflects less, down to about specular cos² of
    the incidence for sharp ones, so that it never exceeds diffuse + specular. That loss is what real surfaces do not
    show: they shine more at grazing incidence. There use `Ggx`.

    Attributes
    ----------
    diffuse : float array (c,) or (..., c)
        Albedo of the matte part, 0 … 1 [1].
    specular : float array (c,) or (..., c)
        Share of light along the normal that the highlight reflects; with ``diffuse`` at most 1 [1].
    exponent : float array (c,) or (..., c)
        Exponent e, 0 … 1e12; that of a `Phong` lobe of the same width is about a quarter of it [1].

    References
    ----------
    .. [1] J. F. Blinn, "Models of light reflection for computer synthesized pictures", SIGGRAPH 1977.
       doi:10.1145/563858.563893
    """

    name: ClassVar[str] = "blinn-phong"
    diffuse: FloatArray
    specular: FloatArray
    exponent: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "diffuse", reflectance(self.diffuse, "diffuse albedo"))
        object.__setattr__(self, "specular", reflectance(self.specular, "specular share"))
        remedy = "A greater exponent makes a sharper highlight; 40 to 4000 is usual."
        exponent = parameter(self.exponent, "exponent", low=0.0, high=1e12, unit="1", remedy=remedy)
        object.__setattr__(self, "exponent", exponent)
        self._shape()
        in_total(self.diffuse, self.specular)

    def _shape(self) -> tuple[int, ...]:
        """Return the shape of the values over the surface."""
        return common_shape(diffuse=self.diffuse, specular=self.specular, exponent=self.exponent)

    @property
    def channels(self) -> int:
        """See :attr:`Brdf.channels`."""
        return self._shape()[-1]

    @property
    def diffuse_albedo(self) -> FloatArray:
        """The albedo of the matte part; see :attr:`Brdf.diffuse_albedo`."""
        return np.broadcast_to(self.diffuse, self._shape())

    def evaluate(self, normals: FloatArray, to_light: FloatArray, to_eye: FloatArray) -> FloatArray:
        """Return the matte part and the lobe; see :meth:`Brdf.evaluate`."""
        at = Directions.of(normals, to_light, to_eye)
        height, extent = at.half()
        e = self.exponent
        # (n·h)² = 1 / (1 + tan²), so that the power keeps its digits for sharp lobes.
        lobe = np.exp(-0.5 * e * np.log1p(extent / height**2))
        factor = (e + 2.0) * (e + 4.0) / (8.0 * np.pi * (e + np.exp2(-0.5 * e)))
        return at.where_above(self.diffuse / np.pi + self.specular * factor * lobe)
