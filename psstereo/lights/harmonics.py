"""Smooth light from everywhere, by spherical harmonics up to order 2.

With x right, y up and z toward the camera, for a unit vector ω = (x, y, z), the nine functions in their order are

    (0, 0)   ½ √(1/π)
    (1,-1)   √(3/4π) y         (1, 0)   √(3/4π) z               (1, 1)   √(3/4π) x
    (2,-2)   ½ √(15/π) xy      (2,-1)   ½ √(15/π) yz            (2, 0)   ¼ √(5/π) (2z² − x² − y²)
    (2, 1)   ½ √(15/π) xz      (2, 2)   ¼ √(15/π) (x² − y²)

They are orthonormal, ∫ Y_i Y_k dω = δ_ik, real, and without the sign (−1)^m of Condon and Shortley. A radiance
L = Σ L_lm Y_lm gives the irradiance E(n) = Σ A_l L_lm Y_lm(n) with A₀ = π, A₁ = 2π/3, A₂ = π/4 [1]_, which is exact,
not an approximation, as long as L has no higher orders.

References
----------
.. [1] R. Ramamoorthi, P. Hanrahan, "An Efficient Representation for Irradiance Environment Maps", SIGGRAPH 2001,
   497-500. doi:10.1145/383259.383317
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError, OptionError, RigError
from psstereo.lights.beam import Beam
from psstereo.lights.light import Light
from psstereo.lights.motion import rigid_motion
from psstereo.lights.sphere_rule import product_rule, sphere_rule
from psstereo.types import FloatArray

__all__ = ["Harmonics", "real_harmonics"]

_ORDERS = np.array([0, 1, 1, 1, 2, 2, 2, 2, 2])
_COSINE = np.array([np.pi, 2.0 * np.pi / 3.0, np.pi / 4.0])[_ORDERS]
"""A_l, what the clamped cosine leaves of each order [sr]."""
_DARKEST = -1e-3
"""Least radiance that still counts as zero, as a share of the largest: the rounding of published coefficients [1]."""


def real_harmonics(directions: npt.ArrayLike) -> FloatArray:
    """Return the nine real spherical harmonics up to order 2, in the order and normalisation of this module.

    Parameters
    ----------
    directions : float array (..., 3)
        Unit vectors, x right, y up, z toward the camera [1].

    Returns
    -------
    float64 array (..., 9)
        Their values [sr⁻½].

    Raises
    ------
    InputError
        If the last axis has not three components.
    """
    vectors = np.asarray(directions, np.float64)
    if vectors.ndim == 0 or vectors.shape[-1] != 3:
        raise InputError(
            given=f"Directions have the shape {vectors.shape}.",
            needed="Their last axis must hold x, y, z.",
            remedy="Give an array (..., 3) of unit vectors.",
        )
    x, y, z = np.moveaxis(vectors, -1, 0)
    flat, linear, mixed = 0.5 * np.sqrt(1 / np.pi), np.sqrt(0.75 / np.pi), 0.5 * np.sqrt(15 / np.pi)
    return np.stack(
        [
            np.where(np.isfinite(x + y + z), flat, np.nan),
            linear * y,
            linear * z,
            linear * x,
            mixed * x * y,
            mixed * y * z,
            0.25 * np.sqrt(5 / np.pi) * (2.0 * z * z - x * x - y * y),
            mixed * x * z,
            0.5 * mixed * (x - y) * (x + y),
        ],
        axis=-1,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Harmonics(Light):
    """Distant light from the whole sphere whose radiance has spherical harmonics up to order 2 only.

    Right for skies, rooms and whatever else is smooth, and for what nine numbers can say of anything. Not for a sun or
    lamp: nine numbers cannot hold a narrow source, and the radiance that they give goes below zero opposite to it.

    Nothing is clamped, because only then is the irradiance linear in the coefficients and the beams add up to it. A
    field that is negative somewhere is therefore refused, unless it is allowed; then irradiances may be negative too.

    Attributes
    ----------
    coefficients : float array (9, c)
        L_lm in the order of :func:`real_harmonics`; (9,) is taken as one channel [W m⁻² sr⁻¹ sr½], or relative.
    allow_negative : bool
        Whether the radiance may be negative in some directions, as that of a fit often is. Its mean may not.

    Raises
    ------
    RigError
        If there are not nine finite coefficients, the mean radiance of a channel is not positive, or its least is
        negative (beyond 1e-3 of the largest) and that is not allowed.
    """

    name: ClassVar[str] = "harmonics"
    positional: ClassVar[bool] = False
    extended: ClassVar[bool] = True
    coefficients: FloatArray
    allow_negative: bool = False

    def __post_init__(self) -> None:
        given = np.array(self.coefficients, np.float64)
        table = given[:, None] if given.ndim == 1 else given
        if table.ndim != 2 or table.shape[0] != len(_ORDERS) or table.shape[1] == 0 or not np.isfinite(table).all():
            raise RigError(
                given=f"Coefficients of spherical harmonics have the shape {given.shape}"
                f"{'' if np.isfinite(given).all() else ' and are not all finite'}.",
                needed="Order 2 has nine finite numbers, or nine rows of one a channel.",
                remedy="Give them in the order (0,0), (1,-1), (1,0), (1,1), (2,-2) … (2,2), without higher orders.",
            )
        if (table[0] <= 0).any():
            raise RigError(
                given=f"The coefficients (0,0) are {np.array2string(table[0], precision=6)}.",
                needed="The mean radiance of each channel, ½ √(1/π) of that, must be positive.",
                remedy="Check the order and the sign of the coefficients.",
            )
        table.flags.writeable = False
        object.__setattr__(self, "coefficients", table)
        if not self.allow_negative:
            self._require_positive()

    def _require_positive(self) -> None:
        # A dense lattice: between its points, 3 degrees apart, a field of order 2 cannot hide more than the tolerance.
        around, _ = sphere_rule(1 << 12)
        field = self.radiance_from(around)
        least, most = field.min(axis=0), field.max(axis=0)
        if (least < _DARKEST * most).any():
            channel = int(np.argmin(least / most))
            raise RigError(
                given=f"The radiance of channel {channel + 1} falls to {least[channel]:.4g}; its largest is "
                f"{most[channel]:.4g}.",
                needed="Light cannot be negative.",
                remedy="Shrink the coefficients of order 1 and 2, or allow it (allow_negative) for a fitted light.",
            )

    @classmethod
    def projected(
        cls, radiance: Callable[[FloatArray], npt.ArrayLike], *, degree: int = 200, allow_negative: bool = False
    ) -> "Harmonics":
        """Return the best fit of order 2 to a radiance, L_lm = ∫ L Y_lm dω.

        Over all normals it keeps 99.2 % of the mean square of the irradiance from a narrow source, and nearly all of it
        from smooth ones.

        Parameters
        ----------
        radiance : callable
            Takes unit vectors (k, 3) and returns radiances (k,) or (k, c), such as ``Environment.radiance_from``.
        degree : int
            Degree of polynomials up to which the integral is exact, at least 4. A map needs several times its number
            of rows [1].
        allow_negative : bool
            Whether the fit may be negative in some directions, as that of a narrow source is.

        Returns
        -------
        Harmonics
            The light.

        Raises
        ------
        OptionError
            If the degree is below 4.
        RigError
            If the fit is negative where it must not, or not finite.
        """
        if degree < 4:
            raise OptionError(
                given=f"The degree of the quadrature is {degree}.",
                needed="A field of order 2 times a harmonic of order 2 needs degree 4 or more.",
                remedy="Leave it at its default.",
            )
        directions, weights = product_rule(degree)
        values = np.asarray(radiance(directions), np.float64)
        coefficients = (real_harmonics(directions) * weights[:, None]).T @ values
        return cls(coefficients=coefficients, allow_negative=allow_negative)

    @property
    def channels(self) -> int:
        """See :attr:`Light.channels`."""
        return int(self.coefficients.shape[1])

    def radiance_from(self, directions: npt.ArrayLike) -> FloatArray:
        """Return the radiance that arrives from some directions.

        Parameters
        ----------
        directions : float array (..., 3)
            Unit vectors toward where the light comes from [1].

        Returns
        -------
        float64 array (..., c)
            Radiance [W m⁻² sr⁻¹], or relative.
        """
        return np.asarray(real_harmonics(directions) @ self.coefficients)

    def directions(self, points: FloatArray) -> FloatArray:
        """Return NaN: it comes from no one direction; see :meth:`Light.directions`."""
        return np.full(np.shape(points), np.nan)

    def irradiance(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Return Σ A_l L_lm Y_lm(n), negative only where negative radiance is allowed; see :meth:`Light.irradiance`."""
        del points  # a distant light looks the same from everywhere
        return np.asarray(real_harmonics(normals) @ (_COSINE[:, None] * self.coefficients))

    def beams(self, points: FloatArray, count: int) -> Iterator[Beam]:
        """Yield 2 count beams, 32 at least, of which half are below any surface; see :meth:`Light.beams`."""
        del points
        around, weights = sphere_rule(2 * count)
        for direction, power in zip(around, weights[:, None] * self.radiance_from(around), strict=True):
            yield Beam(directions=direction, irradiance=power)

    def moved(self, rotation: FloatArray, translation: FloatArray) -> "Harmonics":
        """Turn the field, order by order; see :meth:`Light.moved`."""
        turn, _ = rigid_motion(rotation, translation)
        # The turned field at ω is the old one at Rᵀω; projecting a field of order 2 on order 2 is exact with degree 4.
        around, weights = product_rule(4)
        mixing = (real_harmonics(around) * weights[:, None]).T @ real_harmonics(around @ turn)
        turned = Harmonics(coefficients=mixing @ self.coefficients, allow_negative=True)
        # The field has been checked; on the turned lattice one at the limit could fall to the other side of it.
        object.__setattr__(turned, "allow_negative", self.allow_negative)
        return turned
