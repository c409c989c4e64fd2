"""Parallel projection along z."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.camera.camera import Camera
from psstereo.errors import InputError
from psstereo.results import DepthKind
from psstereo.types import FloatArray

__all__ = ["Orthographic"]


@dataclass(frozen=True, kw_only=True)
class Orthographic(Camera):
    """Parallel projection: one pixel is the same length everywhere on the surface.

    A good approximation where the object's depth is small against its distance; for a closer camera use
    :class:`~psstereo.camera.pinhole.Pinhole`.

    Attributes
    ----------
    pixel_size : float
        Length of a pixel's side on the surface [``length_unit``].
    length_unit : str
        Unit of `pixel_size`, such as ``"mm"``; ``"px"`` when the scale is unknown.
    """

    name: ClassVar[str] = "orthographic"
    depth_kind: ClassVar[DepthKind] = DepthKind.HEIGHT
    pixel_size: float = 1.0
    length_unit: str = "px"

    def __post_init__(self) -> None:
        if not (math.isfinite(self.pixel_size) and self.pixel_size > 0):
            raise InputError(
                given=f"The pixel size is {self.pixel_size}.",
                needed="It must be a positive length.",
                remedy="Give the length of one pixel on the object, or leave it out to work in pixels.",
            )

    @property
    def unit(self) -> str:
        """Unit of heights and points."""
        return self.length_unit

    def rays(self, shape: tuple[int, int]) -> FloatArray:
        """Return (0, 0, −1) for every pixel; see :meth:`Camera.rays`."""
        rays = np.zeros((*shape, 3))
        rays[..., 2] = -1.0
        return rays

    def points(self, depth: FloatArray) -> FloatArray:
        """Return (column · size, −row · size, height); see :meth:`Camera.points`."""
        rows, columns = np.indices(depth.shape, dtype=np.float64)
        return np.stack([columns * self.pixel_size, -rows * self.pixel_size, np.asarray(depth, np.float64)], axis=-1)
