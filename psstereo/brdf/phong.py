"""Phong's highlight around the mirrored light, over a matte surface."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.brdf.brdf import Brdf
from psstereo.brdf.checks import common_shape, in_total, parameter, reflectance
from psstereo.brdf.directions import Directions
from psstereo.types import FloatArray

__all__ = ["Phong"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Phong(Brdf):
    """A matte surface with a round highlight, ρ = diffuse / π + specular (e + 2) / (2π) max(0, r·v)^e [1]_ [2]_.

    r is the light's mirror direction. The lobe is not divided by n·l as in Phong's own shading, which makes it
    reciprocal. The factor is that of a lobe on the normal, where it reflects ``specular`` in full; at oblique incidence
    a part of the lobe is under the surface and it reflects less, so that it never exceeds diffuse + specular. That loss
    is what real surfaces do not show: they shine more at grazing incidence. There use `Ggx`.

    With d = r − v the power is computed as exp(e log1p(−d²/2)) from the half vector, which keeps its digits for sharp
    lobes.

    Attributes
    ----------
    diffuse : float array (c,) or (..., c)
        Albedo of the matte part, 0 … 1 [1].
    specular : float array (c,) or (..., c)
        Share of light along the normal that the highlight reflects; with ``diffuse`` at most 1 [1].
    exponent : float array (c,) or (..., c)
        Exponent e, 0 … 1e12; the lobe's radius is about √(2/e) [1].

    References
    ----------
    .. [1] B. T. Phong, "Illumination for computer generated pictures", Commun. ACM 18, 1975. doi:10.1145/360825.360839
    .. [2] E. P. Lafortune, Y. D. Willems, "Using the modified Phong reflectance model for physically based rendering",
       report CW 197, KU Leuven, 1994
    """

    name: ClassVar[str] = "phong"
    diffuse: FloatArray
    specular: FloatArray
    exponent: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "diffuse", reflectance(self.diffuse, "diffuse albedo"))
        object.__setattr__(self, "specular", reflectance(self.specular, "specular share"))
        remedy = "A greater exponent makes a sharper highlight; 10 to 1000 is usual."
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
        _, extent = at.half()
        apart = 0.5 * (extent + (at.light - at.eye) ** 2)  # 1 − r·v
        ahead = apart < 1.0
        lobe = np.where(ahead, np.exp(self.exponent * np.log1p(-np.where(ahead, apart, 0.0))), 0.0)
        return at.where_above(self.diffuse / np.pi + self.specular * (self.exponent + 2.0) / (2.0 * np.pi) * lobe)
