"""What a camera sees of a surface, pixel by pixel."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from psstereo.errors import InputError
from psstereo.types import BoolArray, FloatArray, IntArray

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

    @cached_property
    def faces_eye(self) -> BoolArray:
        """Where the surface faces the camera, (p,); interpolated normals near an outline may not."""
        if self.to_eye.ndim == 1:
            return np.asarray(self.normals @ self.to_eye > 0)
        return np.asarray(np.einsum("pi,pi->p", self.normals, self.to_eye) > 0)

    @cached_property
    def all_face_eye(self) -> bool:
        """Whether every point faces the camera."""
        return bool(self.faces_eye.all())

    @cached_property
    def _pixels(self) -> IntArray | None:
        """Indices of the pixels, None if they are all of the image."""
        return None if self.mask.all() else np.flatnonzero(self.mask)

    def scatter(self, values: FloatArray, outside: float = 0.0) -> FloatArray:
        """Return values (p, …) as an image (h, w, …), with one value outside the mask.

        Where the mask is the whole image this is a view of the values.
        """
        shape = (*self.mask.shape, *values.shape[1:])
        if self._pixels is None:
            return values.reshape(shape)
        image = np.full((self.mask.size, *values.shape[1:]), outside, values.dtype)
        image[self._pixels] = values
        return image.reshape(shape)
