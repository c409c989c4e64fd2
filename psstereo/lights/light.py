"""The interface of lights."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.errors import UnsupportedError
from psstereo.lights.beam import Beam
from psstereo.types import FloatArray

__all__ = ["Distant", "Light"]


@dataclass(frozen=True, eq=False)
class Light(ABC):
    """A source of light, in the frame x right, y up, z toward the camera.

    Attributes
    ----------
    distant : bool
        Whether it is a :class:`Distant` light, with one direction and strength for the whole scene.
    positional : bool
        Whether its irradiance depends on where the surface is.
    extended : bool
        Whether it has an extent: its shadows have a penumbra, and a glossy surface shows it smeared. Its beams are a
        quadrature, while :meth:`irradiance` is exact.
    """

    name: ClassVar[str]
    distant: ClassVar[bool] = False
    positional: ClassVar[bool]
    extended: ClassVar[bool] = False

    @property
    @abstractmethod
    def channels(self) -> int:
        """Number of channels c of its irradiance; 1 serves all channels of a surface."""

    @abstractmethod
    def directions(self, points: FloatArray) -> FloatArray:
        """Return unit vectors from surface points to the light, to the middle of one that has an extent.

        Parameters
        ----------
        points : float array (..., 3)
            Surface points, in the unit of the light's own position if it has one.

        Returns
        -------
        float64 array (..., 3)
            Unit vectors; NaN where the light has no direction [1].
        """

    @abstractmethod
    def irradiance(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Return the irradiance of surface elements, without any shadow cast by something else.

        Parameters
        ----------
        points : float array (..., 3)
            Surface points.
        normals : float array (..., 3)
            Unit normals.

        Returns
        -------
        float64 array (..., c)
            Irradiance per channel, zero where the surface faces away [W m⁻²], or relative if the strength is.
        """

    @abstractmethod
    def beams(self, points: FloatArray, count: int) -> Iterator[Beam]:
        """Split the light into beams, whose sum over max(0, n·l) is the irradiance.

        Parameters
        ----------
        points : float array (..., 3)
            Surface points.
        count : int
            About how many beams an extended light is split into; other lights give one. Light from all around gives
            twice as many, since half of them are below any surface. The same count gives the same beams.

        Yields
        ------
        Beam
            One after the other, so that only one is held.
        """

    @abstractmethod
    def moved(self, rotation: FloatArray, translation: FloatArray) -> "Light":
        """Return the same light in another frame, in which the point x is R x + t.

        Parameters
        ----------
        rotation : float array (3, 3)
            R, a proper rotation [1].
        translation : float array (3,)
            t [length].

        Returns
        -------
        Light
            The light.
        """

    def idealised(self) -> "Light":
        """Return the distant light or lamp that this one looks like from afar, which light files can hold.

        Raises
        ------
        UnsupportedError
            If there is none, as for light from everywhere.
        """
        raise UnsupportedError(
            given=f"The light is of the kind {self.name}.",
            needed="A light file holds suns and lamps: a direction or a position each.",
            remedy="Give this light as the ambient part of a scene, or write the scene file instead.",
        )


@dataclass(frozen=True, eq=False)
class Distant(Light):
    """A light so far away that it is the same for every point of the scene.

    Attributes
    ----------
    direction : float array (3,)
        Unit vector toward (the middle of) the light [1].
    strength : float array (c,)
        Irradiance of a surface that faces it [W m⁻²], or relative.
    """

    distant: ClassVar[bool] = True
    positional: ClassVar[bool] = False
    direction: FloatArray
    strength: FloatArray

    @property
    def channels(self) -> int:
        """See :attr:`Light.channels`."""
        return int(self.strength.size)

    def directions(self, points: FloatArray) -> FloatArray:
        """Return the one direction for every point; see :meth:`Light.directions`."""
        return np.broadcast_to(self.direction, np.shape(points))
