"""The matte surface."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.brdf.brdf import Brdf
from psstereo.brdf.checks import reflectance
from psstereo.types import FloatArray

__all__ = ["Lambert"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Lambert(Brdf):
    """A matte surface, ρ = albedo / π: equally bright from every viewpoint [1]_.

    Attributes
    ----------
    albedo : float array (c,) or (..., c)
        πρ, 0 … 1 [1].

    References
    ----------
    .. [1] J. H. Lambert, "Photometria", 1760.
    """

    name: ClassVar[str] = "lambert"
    constant: ClassVar[bool] = True
    albedo: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "albedo", reflectance(self.albedo, "albedo"))

    @property
    def channels(self) -> int:
        """See :attr:`Brdf.channels`."""
        return int(self.albedo.shape[-1])

    @property
    def diffuse_albedo(self) -> FloatArray:
        """The albedo; see :attr:`Brdf.diffuse_albedo`."""
        return self.albedo

    def evaluate(self, normals: FloatArray, to_light: FloatArray, to_eye: FloatArray) -> FloatArray:
        """Return albedo / π where light and eye are above the surface; see :meth:`Brdf.evaluate`."""
        light = np.einsum("...i,...i->...", normals, to_light)
        eye = np.einsum("...i,...i->...", normals, to_eye)
        above = np.where(np.isnan(light + eye), np.nan, (light > 0) & (eye > 0))
        return np.asarray(above[..., None] * self.albedo / np.pi)
