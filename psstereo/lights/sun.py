"""A distant light with a disc: the sun as it is, with soft shadows."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from psstereo.errors import RigError
from psstereo.lights.beam import Beam
from psstereo.lights.directional import Directional
from psstereo.lights.light import Distant
from psstereo.lights.motion import rigid_motion
from psstereo.lights.vectors import strengths, unit_vector
from psstereo.radiometry import SUN_ANGULAR_RADIUS, sphere_irradiance
from psstereo.radiometry.quadrature import disc_rule
from psstereo.types import FloatArray

__all__ = ["Sun"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Sun(Distant):
    """A distant disc of even radiance; its irradiance is π L sin²a · n·l while it is wholly above the horizon.

    Where shadows are sharp enough and no surface is within a of grazing,
    :class:`~psstereo.lights.directional.Directional` gives the same for less. The sun's own disc is darker toward its
    rim, which is left out here. The disc is the same for every point: use :class:`~psstereo.lights.disc.Disc` for a
    near one.

    Attributes
    ----------
    direction : float array (3,)
        Toward the disc's middle, x right, y up, z toward the camera; normalised on entry [1].
    radiance : float array (c,)
        L [W m⁻² sr⁻¹], or relative.
    angular_radius : float
        Angle a between middle and rim, greater than 0, at most π/2 [rad].
    strength : float array (c,)
        Irradiance of a surface that faces the light, π L sin²a; not to be given [W m⁻²], or relative.
    """

    name: ClassVar[str] = "sun"
    extended: ClassVar[bool] = True
    direction: FloatArray
    strength: FloatArray = field(init=False)
    radiance: FloatArray
    angular_radius: float = SUN_ANGULAR_RADIUS

    def __post_init__(self) -> None:
        object.__setattr__(self, "direction", unit_vector(self.direction, "sun direction"))
        object.__setattr__(self, "radiance", strengths(self.radiance, "sun radiance"))
        object.__setattr__(self, "angular_radius", _angle(self.angular_radius))
        facing = np.pi * np.sin(self.angular_radius) ** 2
        object.__setattr__(self, "strength", strengths(facing * self.radiance, "sun strength"))

    @classmethod
    def of_irradiance(
        cls, direction: npt.ArrayLike, irradiance: npt.ArrayLike, angular_radius: float = SUN_ANGULAR_RADIUS
    ) -> "Sun":
        """Build the sun that gives a surface facing it a known irradiance, L = E / (π sin²a).

        Parameters
        ----------
        direction : float array (3,)
            Toward the disc's middle [1].
        irradiance : float or float array (c,)
            E of a surface that faces the sun, without skylight [W m⁻²].
        angular_radius : float
            Angle a between middle and rim, greater than 0, at most π/2 [rad].

        Returns
        -------
        Sun
            The light.

        Raises
        ------
        RigError
            If a value is zero, negative or not finite.
        """
        facing = np.pi * np.sin(_angle(angular_radius)) ** 2
        radiance = strengths(irradiance, "sun irradiance") / facing
        return cls(direction=np.asarray(direction), radiance=radiance, angular_radius=angular_radius)

    def irradiance(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Return the irradiance, also where the horizon cuts the disc; see :meth:`Light.irradiance`."""
        del points  # a distant light looks the same from everywhere
        cosine = np.asarray(normals, np.float64)[None] @ self.direction
        factor = sphere_irradiance(1.0, np.sin(self.angular_radius), 1.0, cosine)
        return np.asarray(factor[0, ..., None] * self.radiance)

    def beams(self, points: FloatArray, count: int) -> Iterator[Beam]:
        """Yield a Gauss rule over the disc, exact for n·l while all of it is above the horizon.

        Fewer than three beams are one, toward the middle; see :meth:`Light.beams`.
        """
        del points
        if count < 3:
            yield Beam(directions=self.direction, irradiance=self.strength)
            return
        side = np.cross(self.direction, np.eye(3)[np.argmin(np.abs(self.direction))])
        side /= np.sqrt(side @ side)
        up = np.cross(self.direction, side)
        depth = 2.0 * np.sin(0.5 * self.angular_radius) ** 2  # 1 − cos a, without its loss of digits
        for share, turn, weight in zip(*disc_rule(count), strict=True):
            lower = depth * share  # 1 − z, even in which the cap's area is
            across = np.sqrt(lower * (2.0 - lower))
            toward = (1.0 - lower) * self.direction + across * (np.cos(turn) * side + np.sin(turn) * up)
            toward /= np.sqrt(toward @ toward)
            yield Beam(directions=toward, irradiance=2.0 * np.pi * depth * weight * self.radiance)

    def moved(self, rotation: FloatArray, translation: FloatArray) -> "Sun":
        """Turn the direction, by a proper rotation only; see :meth:`Light.moved`."""
        turn, _ = rigid_motion(rotation, translation)
        return Sun(direction=turn @ self.direction, radiance=self.radiance, angular_radius=self.angular_radius)

    def idealised(self) -> Directional:
        """Return the light without extent that gives the same irradiance; see :meth:`Light.idealised`."""
        return Directional(direction=self.direction, strength=self.strength)


def _angle(value: float) -> float:
    """Return an angular radius, or refuse it."""
    if np.ndim(value) != 0 or not 0.0 < value <= 0.5 * np.pi:
        raise RigError(
            given=f"The sun's angular radius is {value} rad.",
            needed="It must be a number greater than 0 and at most π/2.",
            remedy="Give radians, 4.65e-3 for the sun; use a directional light for a sun without a disc.",
        )
    return float(value)
