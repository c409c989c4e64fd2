"""The interface of lights."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from psstereo.types import FloatArray

__all__ = ["Light"]


@dataclass(frozen=True, eq=False)
class Light(ABC):
    """A source of light, in the frame x right, y up, z toward the camera.

    Attributes
    ----------
    distant : bool
        Whether direction and strength are the same everywhere, so that :attr:`direction` exists.
    """

    name: ClassVar[str]
    distant: ClassVar[bool]

    @abstractmethod
    def directions(self, points: FloatArray) -> FloatArray:
        """Return unit vectors from surface points to the light.

        Parameters
        ----------
        points : float array (..., 3)
            Surface points, in the unit of the light's own position if it has one.

        Returns
        -------
        float64 array (..., 3)
            Unit vectors [1].
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
