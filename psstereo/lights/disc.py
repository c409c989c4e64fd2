"""A round flat lamp or skylight."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.errors import RigError
from psstereo.lights.beam import Beam
from psstereo.lights.led import Led
from psstereo.lights.light import Light
from psstereo.lights.motion import rigid_motion
from psstereo.lights.patch import patch_beam, towards
from psstereo.lights.vectors import strengths, unit_vector
from psstereo.radiometry.disc_irradiance import disc_irradiance
from psstereo.radiometry.quadrature import disc_rule
from psstereo.types import FloatArray

__all__ = ["Disc"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Disc(Light):
    """A flat disc of even radiance that shines to one side, like a diffuse panel or a round skylight.

    On its axis a surface that faces it gets π L sin²θ, θ being the angle from the axis to the rim. From ten radii away
    :class:`~psstereo.lights.led.Led` with mu = 1 is within one per cent and much cheaper. At a height h < R over
    the disc about 10 (R / h)² beams add up to the irradiance within one per cent; :meth:`irradiance` is exact anyway.

    Attributes
    ----------
    centre : float array (3,)
        Its middle, x right, y up, z toward the camera [length].
    axis : float array (3,)
        Normal on the side to which it shines, normalised on entry [1].
    radius : float
        R, greater than 0 [length].
    radiance : float array (c,)
        L, the same in every direction [W m⁻² sr⁻¹], or relative.
    """

    name: ClassVar[str] = "disc"
    positional: ClassVar[bool] = True
    extended: ClassVar[bool] = True
    centre: FloatArray
    axis: FloatArray
    radius: float
    radiance: FloatArray

    def __post_init__(self) -> None:
        centre = np.array(self.centre, np.float64)
        size = float(self.radius) if np.ndim(self.radius) == 0 else np.nan
        if centre.shape != (3,) or not np.isfinite(centre).all() or not (np.isfinite(size) and size > 0.0):
            raise RigError(
                given=f"A disc has the centre {centre.tolist()} and the radius {self.radius}.",
                needed="A centre is three finite numbers, and a radius a finite number greater than 0.",
                remedy="Correct the disc, or use a lamp (led) for one without extent.",
            )
        centre.flags.writeable = False
        object.__setattr__(self, "centre", centre)
        object.__setattr__(self, "axis", unit_vector(self.axis, "disc axis"))
        object.__setattr__(self, "radius", size)
        object.__setattr__(self, "radiance", strengths(self.radiance, "disc radiance"))

    @property
    def channels(self) -> int:
        """See :attr:`Light.channels`."""
        return int(self.radiance.size)

    @property
    def area(self) -> float:
        """π R² [length²]."""
        return float(np.pi * self.radius**2)

    def directions(self, points: FloatArray) -> FloatArray:
        """Return unit vectors to the centre, NaN at the centre itself; see :meth:`Light.directions`."""
        return towards(points, self.centre)[0]

    def irradiance(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Return the irradiance, also where the horizon cuts it; NaN on the disc; see :meth:`Light.irradiance`."""
        factor = disc_irradiance(
            1.0, np.asarray(points)[None], np.asarray(normals)[None], self.centre, self.axis, self.radius
        )
        return np.asarray(factor[0, ..., None] * self.radiance)

    def beams(self, points: FloatArray, count: int) -> Iterator[Beam]:
        """Yield a Gauss rule over the disc's area; fewer than three beams are one; see :meth:`Light.beams`."""
        side = np.cross(self.axis, np.eye(3)[np.argmin(np.abs(self.axis))])
        side /= np.sqrt(side @ side)
        up = np.cross(self.axis, side)
        for square, turn, weight in zip(*disc_rule(count), strict=True):
            place = self.centre + self.radius * np.sqrt(square) * (np.cos(turn) * side + np.sin(turn) * up)
            yield patch_beam(points, place, self.axis, weight * self.area * self.radiance)

    def moved(self, rotation: FloatArray, translation: FloatArray) -> "Disc":
        """Move the centre and turn the axis, by a proper rotation only; see :meth:`Light.moved`."""
        turn, shift = rigid_motion(rotation, translation)
        return Disc(
            centre=turn @ self.centre + shift, axis=turn @ self.axis, radius=self.radius, radiance=self.radiance
        )

    def idealised(self) -> Led:
        """Return the Lambertian lamp of the same flux at the centre; see :meth:`Light.idealised`."""
        return Led(position=self.centre, axis=self.axis, mu=1.0, flux=self.area * self.radiance)
