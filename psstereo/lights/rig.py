"""The lights of a capture, in the order of its images."""

from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np
import numpy.typing as npt

from psstereo.errors import RigError, UnsupportedError
from psstereo.lights.directional import Directional
from psstereo.lights.light import Distant, Light
from psstereo.types import FloatArray

__all__ = ["Rig", "StrengthUnit"]

_COPLANAR = 1e-9
"""Smallest ratio of singular values of the directions that still spans space; text files hold 4 to 10 digits."""


class StrengthUnit(Enum):
    """What the numbers of light strengths mean."""

    RELATIVE = "relative"
    IRRADIANCE = "W m⁻²"


@dataclass(frozen=True, eq=False)
class Rig:
    """An ordered set of lights, one an image.

    Attributes
    ----------
    lights : tuple of Light
        The lights, in the order of the images.
    strength_unit : StrengthUnit
        Whether strengths are irradiances or relative.
    source : str
        Where they came from, for the record.
    """

    lights: tuple[Light, ...]
    strength_unit: StrengthUnit = StrengthUnit.RELATIVE
    source: str = "given"

    def __len__(self) -> int:
        return len(self.lights)

    @classmethod
    def distant(
        cls,
        directions: npt.ArrayLike,
        strengths: npt.ArrayLike | None = None,
        *,
        strength_unit: StrengthUnit = StrengthUnit.RELATIVE,
        source: str = "given",
    ) -> "Rig":
        """Build a rig of distant lights from arrays.

        Parameters
        ----------
        directions : array (m, 3)
            Toward the lights, x right, y up, z toward the camera; any positive length [1].
        strengths : array (m,) or (m, c), optional
            Irradiance of a surface that faces the light, all 1 if absent [W m⁻²], or relative.
        strength_unit : StrengthUnit
            Which of the two.
        source : str
            Where they came from.

        Returns
        -------
        Rig
            The lights.

        Raises
        ------
        RigError
            If shapes disagree, or a light is zero or not finite; the message names its row.
        """
        d = np.asarray(directions, np.float64)
        if d.ndim != 2 or d.shape[1:] != (3,):
            raise RigError(
                given=f"Light directions have the shape {d.shape}.",
                needed="They must be an array of m rows with three numbers each.",
                remedy="Give one row x y z for each image.",
            )
        s = np.ones((len(d), 1)) if strengths is None else np.asarray(strengths, np.float64)
        s = s[:, None] if s.ndim == 1 else s
        if s.ndim != 2 or len(s) != len(d):
            raise RigError(
                given=f"There are {len(d)} light directions and strengths of the shape {s.shape}.",
                needed="Each light needs one strength, or one a channel.",
                remedy="Give as many rows of strengths as of directions, in the same order.",
            )
        return cls(tuple(_light(i, d[i], s[i]) for i in range(len(d))), strength_unit, source)

    @property
    def all_distant(self) -> bool:
        """Whether every light is distant, so that one matrix serves all pixels."""
        return all(light.distant for light in self.lights)

    @cached_property
    def directions(self) -> FloatArray:
        """Light matrix L of a distant rig, float64 (m, 3), unit rows [1].

        Raises
        ------
        UnsupportedError
            If a light is not distant.
        """
        matrix = np.array([light.direction for light in self._distant_lights()]).reshape(-1, 3)
        matrix.flags.writeable = False  # it is kept
        return matrix

    def strengths(self, channels: int) -> FloatArray:
        """Return strengths, float64 (m, channels); a single strength serves all channels.

        Raises
        ------
        RigError
            If a light has another number of channels.
        """
        rows = []
        for i, light in enumerate(self._distant_lights()):
            if light.strength.size not in (1, channels):
                raise RigError(
                    given=f"Light {i + 1} has strengths for {light.strength.size} channels; the images, {channels}.",
                    needed="A light has one strength, or one for each channel of the images.",
                    remedy="Correct the intensities file, or convert the images to the same number of channels.",
                )
            rows.append(np.broadcast_to(light.strength, channels))
        return np.array(rows).reshape(-1, channels)

    def select(self, indices: npt.ArrayLike) -> "Rig":
        """Return the rig of some of the lights: those at some indices, in that order, or where a mask (m,) is true."""
        chosen = np.arange(len(self))[np.asarray(indices)]
        return Rig(tuple(self.lights[i] for i in chosen), self.strength_unit, self.source)

    def condition(self) -> float:
        """Return the condition number of the light matrix, infinite if the lights are coplanar [1]."""
        values = np.linalg.svd(self.directions, compute_uv=False)
        return float(values[0] / values[-1]) if len(values) == 3 and values[-1] > 0 else float("inf")

    def require_spanning(self) -> None:
        """Refuse a rig whose directions cannot give normals.

        Raises
        ------
        RigError
            If there are fewer than three lights, or all directions lie in one plane.
        """
        if len(self) < 3:
            raise RigError(
                given=f"There {'is 1 light' if len(self) == 1 else f'are {len(self)} lights'}.",
                needed="Three or more, not all in one plane, are needed to tell normals.",
                remedy="Take more images under other lights; five or more also tell how sure the result is.",
            )
        if self.condition() > 1 / _COPLANAR:
            raise RigError(
                given=f"The {len(self)} light directions lie in one plane (condition {self.condition():.3g}).",
                needed="At least one direction must leave the plane of the others, which tell a normal's part in it, "
                f"and nothing of its part along ({self._untold()}).",
                remedy="Check the lights file for repeated rows; else add an image with the light elsewhere.",
            )

    def _untold(self) -> str:
        """Return the direction across all lights, as words; of one direction alone it is one of many."""
        across = np.linalg.svd(self.directions)[2][-1]
        across = across * np.sign(across[np.argmax(np.abs(across))])
        return ", ".join(f"{x:.2f}" for x in across + 0.0)

    def _distant_lights(self) -> tuple[Distant, ...]:
        near = [f"{i + 1} ({light.name})" for i, light in enumerate(self.lights) if not isinstance(light, Distant)]
        if near:
            raise UnsupportedError(
                given=f"Light {', '.join(near[:4])}{' …' if len(near) > 4 else ''} is not a distant light.",
                needed="This computation takes one direction for the whole image.",
                remedy="Use a method for near lights, or give distant directions with --lights.",
            )
        return tuple(light for light in self.lights if isinstance(light, Distant))


def _light(index: int, direction: FloatArray, strength: FloatArray) -> Directional:
    """Build one light and name its row if it is bad."""
    try:
        return Directional(direction=direction, strength=strength)
    except RigError as error:
        raise RigError(given=f"Light {index + 1}: {error.given}", needed=error.needed, remedy=error.remedy) from None
