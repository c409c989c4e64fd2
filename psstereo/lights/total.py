"""Several lights at once."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.errors import RigError
from psstereo.lights.beam import Beam
from psstereo.lights.light import Light
from psstereo.types import FloatArray

__all__ = ["Total"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Total(Light):
    """The sum of any lights that are on at the same time, such as a lamp and the ambient light of the room.

    Use separate images, one a light, wherever they can be had: photometric stereo tells normals from lights that are
    on one at a time.

    Attributes
    ----------
    lights : tuple of Light
        The parts, at least one; sums among them are taken apart. Those of one channel serve all channels.
    positional : bool
        Whether one of the parts is.
    extended : bool
        Whether one of the parts is, or there is more than one: either way there are several beams.

    Raises
    ------
    RigError
        If there is no light, or their numbers of channels disagree.
    """

    name: ClassVar[str] = "sum"
    positional: ClassVar[bool] = True
    extended: ClassVar[bool] = True
    lights: tuple[Light, ...]

    def __post_init__(self) -> None:
        parts = tuple(self.lights)
        wrong = [type(part).__name__ for part in parts if not isinstance(part, Light)]
        if not parts or wrong:
            raise RigError(
                given=f"A sum of lights holds {', '.join(wrong) if wrong else 'nothing'}.",
                needed="At least one light is needed, and nothing but lights.",
                remedy="Give a tuple of lights.",
            )
        parts = tuple(inner for part in parts for inner in (part.lights if isinstance(part, Total) else (part,)))
        channels = {part.channels for part in parts} - {1}
        if len(channels) > 1:
            raise RigError(
                given=f"Lights of {' and '.join(str(c) for c in sorted(channels))} channels are to be added.",
                needed="All lights of a sum must have the same number of channels, or one.",
                remedy="Give their strengths for the same channels.",
            )
        object.__setattr__(self, "lights", parts)
        # A sum differs from instance to instance, where other lights differ from class to class.
        object.__setattr__(self, "positional", any(part.positional for part in parts))
        object.__setattr__(self, "extended", len(parts) > 1 or parts[0].extended)

    @property
    def channels(self) -> int:
        """See :attr:`Light.channels`."""
        return max(part.channels for part in self.lights)

    def directions(self, points: FloatArray) -> FloatArray:
        """Return those of a single part, and NaN if there are more; see :meth:`Light.directions`."""
        return self.lights[0].directions(points) if len(self.lights) == 1 else np.full(np.shape(points), np.nan)

    def irradiance(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Return the sum of the parts'; see :meth:`Light.irradiance`."""
        first, *others = (part.irradiance(points, normals) for part in self.lights)
        total = np.array(np.broadcast_to(first, (*first.shape[:-1], self.channels)))
        for other in others:
            total += other
        return total

    def beams(self, points: FloatArray, count: int) -> Iterator[Beam]:
        """Yield the parts' beams: one of each part without extent, of the others equal shares of the rest.

        Each part with an extent gets a share of one beam at least; see :meth:`Light.beams`.
        """
        extended = sum(part.extended for part in self.lights)
        share = max(1, (count - (len(self.lights) - extended)) // max(1, extended))
        for part in self.lights:
            for beam in part.beams(points, share):
                power = np.broadcast_to(beam.irradiance, (*beam.irradiance.shape[:-1], self.channels))
                yield Beam(directions=beam.directions, irradiance=power, distances=beam.distances)

    def moved(self, rotation: FloatArray, translation: FloatArray) -> "Total":
        """Move every part; see :meth:`Light.moved`."""
        return Total(lights=tuple(part.moved(rotation, translation) for part in self.lights))
