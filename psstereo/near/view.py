"""Points along the lines of sight: how one number a pixel becomes a place in space."""

from dataclasses import dataclass

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.errors import UnsupportedError
from psstereo.results import DepthKind
from psstereo.types import BoolArray, FloatArray

__all__ = ["View"]


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """Lines of sight of the pixels under a mask.

    A pixel's place is told by one number q: the logarithm of the distance along the axis of a pinhole, the height under
    parallel projection. In both a constant added to q is what normals leave free, and differences of q are what they
    tell.

    Attributes
    ----------
    camera : Camera
        Camera of the image, which may be a coarse one.
    mask : bool array (h, w)
        Pixels, in row-major order below.
    rays : float64 array (p, 3)
        Directions of sight with z component −1 [1].
    origins : float64 array (p, 3)
        Points at height zero; the camera's centre for a pinhole [length].
    """

    camera: Camera
    mask: BoolArray
    rays: FloatArray
    origins: FloatArray

    @classmethod
    def of(cls, camera: Camera, mask: BoolArray, factor: int = 1) -> "View":
        """Return the view of an image whose pixels are squares of `factor` pixels of the camera's own.

        Parameters
        ----------
        camera : Camera
            Camera of the full image.
        mask : bool array (h, w)
            Mask of the coarse image.
        factor : int
            Side of a coarse pixel [px].

        Raises
        ------
        UnsupportedError
            If the camera is of another kind than pinhole and orthographic.
        """
        if not isinstance(camera, Pinhole | Orthographic):
            raise UnsupportedError(
                given=f"The camera is of the kind {camera.name}.",
                needed="Near lamps are solved for a pinhole or an orthographic camera.",
                remedy="Rectify the images to one of the two.",
            )
        shape = (mask.shape[0] * factor, mask.shape[1] * factor)
        rays = _block_means(camera.rays(shape), factor)[mask]
        if isinstance(camera, Pinhole):
            offset = (factor - 1) / 2
            coarse: Camera = Pinhole(
                fx=camera.fx / factor,
                fy=camera.fy / factor,
                cx=(camera.cx - offset) / factor,
                cy=(camera.cy - offset) / factor,
                skew=camera.skew / factor,
            )
            return cls(camera=coarse, mask=mask, rays=rays, origins=np.zeros_like(rays))
        coarse = Orthographic(pixel_size=camera.pixel_size * factor, length_unit=camera.length_unit)
        origins = _block_means(camera.points(np.zeros(shape)), factor)[mask]
        return cls(camera=coarse, mask=mask, rays=rays, origins=origins)

    @property
    def central(self) -> bool:
        """Whether all lines of sight meet in the camera's centre."""
        return self.camera.depth_kind is DepthKind.DISTANCE

    def points(self, q: FloatArray) -> FloatArray:
        """Return the places, (p, 3) [length]."""
        if self.central:
            return np.asarray(self.rays * np.exp(q)[:, None])
        return np.asarray(self.origins - self.rays * q[:, None])

    def motion(self, points: FloatArray) -> FloatArray:
        """Return the derivative of the places by q, (p, 3) [length], or [1] for heights."""
        return points if self.central else -self.rays

    def image(self, values: FloatArray) -> FloatArray:
        """Return values (p, ...) as an image (h, w, ...), NaN outside the mask."""
        out = np.full((*self.mask.shape, *values.shape[1:]), np.nan)
        out[self.mask] = values
        return out

    def depth(self, q: FloatArray) -> FloatArray:
        """Return distances or heights, (p,) [length]."""
        return np.exp(q) if self.central else q

    def coordinate(self, depth: FloatArray) -> FloatArray:
        """Return q of distances or heights; NaN stays."""
        return np.asarray(np.log(depth)) if self.central else np.asarray(depth, np.float64)


def _block_means(image: FloatArray, factor: int) -> FloatArray:
    """Return the means of squares of pixels; (h · factor, w · factor, 3) becomes (h, w, 3)."""
    if factor == 1:
        return image
    height, width = image.shape[0] // factor, image.shape[1] // factor
    return np.asarray(image.reshape(height, factor, width, factor, 3).mean(axis=(1, 3)))
