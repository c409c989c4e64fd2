"""McEwen's mixture of a lunar and a matte surface."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.brdf.brdf import Brdf
from psstereo.brdf.checks import common_shape, parameter, reflectance
from psstereo.brdf.directions import Directions
from psstereo.radiometry.checks import in_range
from psstereo.types import FloatArray

__all__ = ["LunarLambert", "lunar_weight"]

_COEFFICIENTS = (1.0, -0.019, 2.42e-4, -1.46e-6)
"""Of L in powers of the phase angle in degrees [deg⁻ⁿ]."""


def lunar_weight(phase: FloatArray) -> FloatArray:
    """Return the weight of the lunar part for the Moon, 1 − 0.019 a + 2.42e-4 a² − 1.46e-6 a³ with a in degrees.

    The cubic that is in use for the Moon with McEwen's mixture [1]_. It falls from 1 at opposition to 0 at 103.9°;
    beyond, where the cubic is negative, the weight stays 0 (Lambert). Not for other bodies, whose weights differ.

    Parameters
    ----------
    phase : float array (...)
        Angle between the directions to light and eye, 0 … π [rad].

    Returns
    -------
    float64 array (...)
        Weight L, 0 … 1 [1].

    Raises
    ------
    InputError
        If a phase angle lies outside 0 … π.

    References
    ----------
    .. [1] A. S. McEwen, "Photometric functions for photoclinometry and other applications", Icarus 92, 1991.
       doi:10.1016/0019-1035(91)90053-V
    """
    degrees = np.degrees(in_range("phase angle", phase, unit="rad", high=np.pi))
    return np.asarray(np.maximum(np.polynomial.polynomial.polyval(degrees, _COEFFICIENTS), 0.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class LunarLambert(Brdf):
    """Dusty ground of planets and moons, ρ = albedo / π (2L / (n·l + n·v) + 1 − L) [1]_.

    L mixes Lommel and Seeliger's law for dark dust, which scatters once, with Lambert's. Radiance is ρ n·l, so the
    lunar part makes a disc without limb darkening at full phase.

    It does not conserve energy for every albedo: from incidence i it reflects
    albedo (1 − L + 4L (1 − cos i log(1 + 1/cos i))) for a constant L, which grows to albedo (1 + 3L) at grazing
    incidence; albedo ≤ 1/(1 + 3L), or 1/4 whatever L, is safe at all angles. The ground that it was made for is darker
    than that. With L of the phase angle, the share grows from 1.09 albedo on the normal to 1.71 albedo at grazing
    incidence.

    Attributes
    ----------
    albedo : float array (c,) or (..., c)
        πρ where light and eye are on the normal, 0 … 1 [1].
    weight : float array (c,) or (..., c), or None
        L, 0 (Lambert) … 1 (Lommel and Seeliger); None: `lunar_weight` of the angle between light and eye [1].

    References
    ----------
    .. [1] A. S. McEwen, "Photometric functions for photoclinometry and other applications", Icarus 92, 1991.
       doi:10.1016/0019-1035(91)90053-V
    """

    name: ClassVar[str] = "lunar-lambert"
    conserving: ClassVar[bool] = False
    albedo: FloatArray
    weight: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "albedo", reflectance(self.albedo, "albedo"))
        if self.weight is not None:
            remedy = "Take 0 for a matte, 1 for a lunar surface, or None for the Moon's by phase angle."
            weight = parameter(self.weight, "weight L", low=0.0, high=1.0, unit="1", remedy=remedy)
            object.__setattr__(self, "weight", weight)
        self._shape()

    def _shape(self) -> tuple[int, ...]:
        """Return the shape of the values over the surface."""
        return common_shape(albedo=self.albedo, weight=self.albedo if self.weight is None else self.weight)

    @property
    def channels(self) -> int:
        """See :attr:`Brdf.channels`."""
        return self._shape()[-1]

    @property
    def diffuse_albedo(self) -> FloatArray:
        """πρ under light and eye on the normal, the albedo; see :attr:`Brdf.diffuse_albedo`."""
        return np.broadcast_to(self.albedo, self._shape())

    def evaluate(self, normals: FloatArray, to_light: FloatArray, to_eye: FloatArray) -> FloatArray:
        """Return the mixture; see :meth:`Brdf.evaluate`."""
        at = Directions.of(normals, to_light, to_eye)
        weight = self.weight
        if weight is None:
            weight = lunar_weight(2.0 * np.arctan2(*at.half_chords()))
        return at.where_above(self.albedo / np.pi * (2.0 * weight / (at.light + at.eye) + 1.0 - weight))
