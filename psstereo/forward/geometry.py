"""What a camera sees of a surface, pixel by pixel."""

from dataclasses import dataclass

import numpy as np

from psstereo.errors import InputError
from psstereo.types import BoolArray, FloatArray

__all__ = ["Geometry"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Geometry:
    """Points of a surface, one a pixel of the mask in row-major order, all in one frame.

    Attributes
    ----------
    points : float64 array (p, 3)
        Where the surface is [length].
    normals : float64 array (p, 3)
        Unit normals [1].
    to_eye : float64 array (3,) or (p, 3)
        Unit vectors to the camera; one for all points of a parallel projection [1].
    mask : bool array (h, w)
        The pixels that see the surface.
    eye_distances : float64 array (p,) or None
        To the camera; None for a parallel projection [length].

    Raises
    ------
    InputError
        If the sizes disagree, or a vector of the surface is not finite.
    """

    points: FloatArray
    normals: FloatArray
    to_eye: FloatArray
    mask: BoolArray
    eye_distances: FloatArray | None = None

    def __post_init__(self) -> None:
        count = np.count_nonzero(self.mask)
        shapes = self.points.shape, self.normals.shape, self.to_eye.shape
        if shapes[:2] != ((count, 3), (count, 3)) or shapes[2] not in ((3,), (count, 3)):
            raise InputError(
                given=f"The mask has {count} pixels; points, normals and directions have the shapes {shapes}.",
                needed="One point, one normal and one direction (or one for all) for each pixel of the mask.",
                remedy="Take the rows of the full images where the mask is true.",
            )
        if not (np.isfinite(self.points).all() and np.isfinite(self.normals).all()):
            raise InputError(
                given="A point or normal under the mask is not finite.",
                needed="A surface wherever the mask is true.",
                remedy="Take pixels without a surface out of the mask.",
            )

    def scatter(self, values: FloatArray, outside: float = 0.0) -> FloatArray:
        """Return values (p, …) as an image (h, w, …), with one value outside the mask."""
        image = np.full((*self.mask.shape, *values.shape[1:]), outside, values.dtype)
        image[self.mask] = values
        return image
