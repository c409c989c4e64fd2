"""The interface of cameras."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from psstereo.results import DepthKind
from psstereo.types import FloatArray

__all__ = ["Camera"]


@dataclass(frozen=True)
class Camera(ABC):
    """A central or parallel projection onto pixels; pixel (0, 0) has its centre at (0, 0), rows run down.

    Depth means something else for each camera (see :attr:`depth_kind`); :meth:`points` turns it into points in space,
    so that nobody else needs to know which camera it is.
    """

    name: ClassVar[str]
    depth_kind: ClassVar[DepthKind]

    @property
    @abstractmethod
    def unit(self) -> str:
        """Unit of depths and points that this camera can promise, ``"px"`` or ``"relative"`` if none is known."""

    @abstractmethod
    def rays(self, shape: tuple[int, int]) -> FloatArray:
        """Return the viewing rays, from the camera into the scene, with z component −1.

        Parameters
        ----------
        shape : (int, int)
            Rows and columns of the image.

        Returns
        -------
        float64 array (h, w, 3)
            Rays, x right, y up, z toward the camera [1].
        """

    @abstractmethod
    def points(self, depth: FloatArray) -> FloatArray:
        """Return the surface points of a depth map.

        Parameters
        ----------
        depth : float array (h, w)
            Depth of this camera's :attr:`depth_kind`; NaN where unknown.

        Returns
        -------
        float64 array (h, w, 3)
            Points, x right, y up, z toward the camera, in the unit of the depth.
        """
