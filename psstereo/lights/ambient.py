"""Light of the same radiance from every direction."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.lights.beam import Beam
from psstereo.lights.light import Light
from psstereo.lights.motion import rigid_motion
from psstereo.lights.sphere_rule import sphere_rule
from psstereo.lights.vectors import strengths
from psstereo.types import FloatArray

__all__ = ["Ambient"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Ambient(Light):
    """Uniform light from the whole sphere, as in an overcast room with white walls: ``E = π L`` for every normal.

    It is what a dark level that grows with the albedo looks like. Concave parts of a surface get less of it, which
    only shadows cast on its beams bring out. Use :class:`~psstereo.lights.harmonics.Harmonics` for a sky that is
    brighter than the ground.

    Attributes
    ----------
    radiance : float array (c,)
        L [W m⁻² sr⁻¹], or relative.
    """

    name: ClassVar[str] = "ambient"
    positional: ClassVar[bool] = False
    extended: ClassVar[bool] = True
    radiance: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "radiance", strengths(self.radiance, "ambient radiance"))

    @property
    def channels(self) -> int:
        """See :attr:`Light.channels`."""
        return int(self.radiance.size)

    def directions(self, points: FloatArray) -> FloatArray:
        """Return NaN: it comes from no direction; see :meth:`Light.directions`."""
        return np.full(np.shape(points), np.nan)

    def irradiance(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Return π L, NaN where the normal is; see :meth:`Light.irradiance`."""
        del points  # it looks the same from everywhere
        known = np.isfinite(np.asarray(normals, np.float64)).all(axis=-1, keepdims=True)
        return np.where(known, np.pi * self.radiance, np.nan)

    def beams(self, points: FloatArray, count: int) -> Iterator[Beam]:
        """Yield 2 count beams, 32 at least, of which half are below any surface; see :meth:`Light.beams`."""
        del points
        for direction, weight in zip(*sphere_rule(2 * count), strict=True):
            yield Beam(directions=direction, irradiance=weight * self.radiance)

    def moved(self, rotation: FloatArray, translation: FloatArray) -> "Ambient":
        """Return the light itself, which looks the same in every frame; see :meth:`Light.moved`."""
        rigid_motion(rotation, translation)
        return self
