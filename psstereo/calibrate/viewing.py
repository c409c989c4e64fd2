"""Viewing rays through any place of the image, and back: what balls are seen by."""

from dataclasses import dataclass

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.errors import UnsupportedError
from psstereo.types import FloatArray

__all__ = ["Homogeneous", "eye_of", "pixel_rays", "project"]


@dataclass(frozen=True, eq=False)
class Homogeneous:
    """A point that may be infinitely far away: from p it lies toward ``direction + inverse · (origin − p)``.

    With the inverse distance 0 it is a direction, the same from everywhere. Nothing is singular on the way to it, which
    is why lamps and eyes are written like this.

    Attributes
    ----------
    origin : float64 array (..., 3)
        Point from which direction and distance are told [length].
    direction : float64 array (..., 3)
        Unit vector from there [1].
    inverse : float64 array (...)
        One over the distance from there; below 0 behind infinity [1/length].
    """

    origin: FloatArray
    direction: FloatArray
    inverse: FloatArray

    def seen_from(self, points: FloatArray) -> FloatArray:
        """Return vectors from points (..., 3) toward it, of any positive length [1]."""
        return np.asarray(self.direction + self.inverse[..., None] * (self.origin - points))


def eye_of(camera: Camera) -> Homogeneous:
    """Return where the camera sees from.

    Parameters
    ----------
    camera : Camera
        A pinhole or a parallel projection.

    Returns
    -------
    Homogeneous
        The optical centre, or the direction +z [length].

    Raises
    ------
    UnsupportedError
        If it is another kind of camera.
    """
    # A pinhole is written from one unit behind itself, so that its distance from there is finite.
    pinhole = 1.0 if _is_pinhole(camera) else 0.0
    axis = np.array([0.0, 0.0, 1.0])
    return Homogeneous(-pinhole * axis, axis, np.array(pinhole))


def pixel_rays(camera: Camera, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rays by which places in the image are seen.

    Parameters
    ----------
    camera : Camera
        A pinhole or a parallel projection.
    pixels : float array (..., 2)
        Columns and rows, the centre of the first pixel at (0, 0) [px].

    Returns
    -------
    origins : float64 array (..., 3)
        A point of each ray [length].
    directions : float64 array (..., 3)
        Unit vectors into the scene [1].

    Raises
    ------
    UnsupportedError
        If it is another kind of camera.
    """
    u, v = pixels[..., 0], pixels[..., 1]
    if isinstance(camera, Pinhole):
        down = (v - camera.cy) / camera.fy
        right = (u - camera.cx - camera.skew * down) / camera.fx
        rays = np.stack([right, -down, -np.ones_like(right)], axis=-1)
        return np.zeros_like(rays), rays / np.sqrt((rays * rays).sum(axis=-1, keepdims=True))
    size = _pixel_size(camera)
    origins = np.stack([u * size, -v * size, np.zeros_like(u)], axis=-1)
    return origins, np.broadcast_to(np.array([0.0, 0.0, -1.0]), origins.shape)


def project(camera: Camera, points: FloatArray) -> FloatArray:
    """Return where points are in the image.

    Parameters
    ----------
    camera : Camera
        A pinhole or a parallel projection.
    points : float array (..., 3)
        Points, x right, y up, z toward the camera [length].

    Returns
    -------
    float64 array (..., 2)
        Columns and rows; NaN behind a pinhole [px].

    Raises
    ------
    UnsupportedError
        If it is another kind of camera.
    """
    if isinstance(camera, Pinhole):
        depth = np.where(points[..., 2] < 0, -points[..., 2], np.nan)
        right, down = points[..., 0] / depth, -points[..., 1] / depth
        return np.stack([camera.fx * right + camera.skew * down + camera.cx, camera.fy * down + camera.cy], axis=-1)
    return np.stack([points[..., 0], -points[..., 1]], axis=-1) / _pixel_size(camera)


def _is_pinhole(camera: Camera) -> bool:
    if not isinstance(camera, Pinhole):
        _pixel_size(camera)
    return isinstance(camera, Pinhole)


def _pixel_size(camera: Camera) -> float:
    if isinstance(camera, Orthographic):
        return camera.pixel_size
    raise UnsupportedError(
        given=f"The camera is of the kind {camera.name}.",
        needed="Balls are seen by a pinhole or by a parallel projection.",
        remedy="Describe the camera as one of them.",
    )
