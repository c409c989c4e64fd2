"""Lights that are not where, or not as strong as, they are said to be."""

from dataclasses import dataclass, fields, replace
from typing import ClassVar

import numpy as np

from psstereo.errors import UnsupportedError
from psstereo.lights import Light, Rig
from psstereo.types import FloatArray
from psstereo_synth.faults.checks import require_size
from psstereo_synth.faults.fault import Draws, Fault
from psstereo_synth.faults.spread import factor

__all__ = ["LightError"]

_STRENGTHS = ("strength", "flux", "radiance", "coefficients")
"""What lights call the numbers to which their irradiance is proportional."""


@dataclass(frozen=True, kw_only=True)
class LightError(Fault):
    """The rig that is written down has errors of calibration; the images are right.

    Attributes
    ----------
    direction : float
        Root-mean-square angle by which lights that have no position are turned, about a random axis square to the
        light [rad].
    position : float
        Root-mean-square distance by which lights with a position are displaced, in a random direction [length].
    strength : float
        Standard deviation of the relative error of strengths, log-normal with mean 1 and the same for all channels [1].

    Raises
    ------
    OptionError
        If a size is negative or not finite, or the angle π or more.
    """

    name: ClassVar[str] = "light-error"
    summary: ClassVar[str] = "The directions, positions or strengths of the lights are not quite what is written down."
    direction: float = 0.0
    position: float = 0.0
    strength: float = 0.0

    def __post_init__(self) -> None:
        require_size("error of directions", self.direction, below=np.pi)
        require_size("error of positions", self.position)
        require_size("error of strengths", self.strength)

    def rig(self, rig: Rig, draws: Draws) -> Rig:
        """Return the lights with their errors.

        Parameters
        ----------
        rig : Rig
            The lights as they are.
        draws : Draws
            Random numbers; each light has its own.

        Returns
        -------
        Rig
            The lights as they are written down.

        Raises
        ------
        UnsupportedError
            If an error of directions or positions meets no light that has one, or a light's strength is unknown.
        """
        if self.direction == self.position == self.strength == 0:
            return rig
        positional = [light.positional for light in rig.lights]
        if (self.direction > 0 and all(positional)) or (self.position > 0 and not any(positional)):
            raise UnsupportedError(
                given=f"The rig has {sum(positional)} lights with a position and {positional.count(False)} without.",
                needed="An error of positions needs lights with one, an error of directions lights without.",
                remedy="Give `position` for lamps near by and `direction` for distant lights.",
            )
        lights = tuple(self._disturbed(light, draws.image(i)) for i, light in enumerate(rig.lights))
        return Rig(lights, rig.strength_unit, rig.source)

    def _disturbed(self, light: Light, rng: np.random.Generator) -> Light:
        """Return one light with its errors; as many numbers are drawn whatever they are."""
        offset, scale = rng.standard_normal(3), factor(self.strength, rng)
        if light.positional:
            if self.position > 0:
                light = light.moved(np.eye(3), offset * (self.position / np.sqrt(3)))
        elif self.direction > 0:
            toward = light.directions(np.zeros(3))
            light = light.moved(_turn(toward, offset[:2] * (self.direction / np.sqrt(2))), np.zeros(3))
        return light if self.strength == 0 else _scaled(light, scale)


def _turn(toward: FloatArray, offset: FloatArray) -> FloatArray:
    """Return the rotation that tilts a unit vector by the length of an offset (2,) in its tangent plane [rad]."""
    from scipy.spatial.transform import Rotation

    if not np.isfinite(toward).all():  # light from everywhere has no direction; any axis will do
        toward = np.array([0.0, 0.0, 1.0])
    side = np.cross(toward, np.eye(3)[np.abs(toward).argmin()])
    side /= np.sqrt(side @ side)
    axis = offset[0] * side + offset[1] * np.cross(toward, side)
    return np.asarray(Rotation.from_rotvec(axis).as_matrix())


def _scaled(light: Light, scale: float) -> Light:
    """Return a light with its strength, whatever it is called, times a factor."""
    found = [f.name for f in fields(light) if f.init and f.name in _STRENGTHS]
    if len(found) != 1:
        raise UnsupportedError(
            given=f"A light of the kind {light.name} has {len(found)} strengths.",
            needed="An error of strengths needs lights with one.",
            remedy="Leave the error of strengths out for this rig.",
        )
    return replace(light, **{found[0]: getattr(light, found[0]) * scale})
