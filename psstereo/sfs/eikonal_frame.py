"""What the sweeps of shape from shading need of a light and a camera, and what their values mean."""

from dataclasses import dataclass

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.errors import UnsupportedError
from psstereo.flags import Flag
from psstereo.lights import Directional, Led
from psstereo.results import DepthKind
from psstereo.sfs.image import ShadedImage
from psstereo.types import BoolArray, FlagArray, FloatArray

__all__ = ["Shading", "lamp_shading", "sun_shading"]

_FARTHEST = 0.02
"""Least cosine between the line of sight and a surface that faces the light, about 89 degrees."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Shading:
    """The image as an equation for the values of the sweeps.

    Attributes
    ----------
    bright : float64 array (h, w)
        Cosine to the sun; or flux over irradiance, for a lamp.
    frame : float64 array (11,)
        See :func:`psstereo.kernels.sweeping.first_order`.
    flags : uint16 array (h, w)
        ``OVER_BRIGHT`` and ``UNLIT``.
    camera : Camera
        The camera.
    """

    bright: FloatArray
    frame: FloatArray
    flags: FlagArray
    camera: Camera

    @property
    def fine(self) -> float:
        """What a pixel is in the unit of the values where a surface faces a camera [1 / px]."""
        return 1.0 / max(float(self.frame[0]), float(self.frame[1]))

    def values(self, depth: FloatArray) -> FloatArray:
        """Return the values of known depths; NaN stays."""
        sign = self.frame[8]
        if isinstance(self.camera, Orthographic):
            return np.asarray(-sign * np.asarray(depth, np.float64) / self.camera.pixel_size)
        logarithm: FloatArray = np.log(np.asarray(depth, np.float64))
        if self.frame[10] > 0:
            logarithm += np.log(np.linalg.norm(self.camera.rays(depth.shape), axis=-1))
        return np.asarray(sign * logarithm)

    def depth(self, values: FloatArray) -> FloatArray:
        """Return the depths of values; NaN stays."""
        sign = self.frame[8]
        if isinstance(self.camera, Orthographic):
            return np.asarray(-sign * self.camera.pixel_size * values)
        found = np.exp(sign * values)
        if self.frame[10] > 0:
            found /= np.linalg.norm(self.camera.rays(values.shape), axis=-1)
        return np.asarray(found)


def _camera_part(camera: Camera) -> tuple[float, float, float, float, float]:
    if isinstance(camera, Pinhole):
        return camera.fx, camera.fy, camera.cx, camera.cy, camera.skew
    return 1.0, 1.0, 0.0, 0.0, 0.0


def sun_shading(image: ShadedImage, light: Directional, *, hollow: bool, darkest: float) -> Shading:
    """Return the equation under a sun.

    Parameters
    ----------
    image : ShadedImage
        The image.
    light : Directional
        The sun.
    hollow : bool
        Whether the values grow toward the camera from the singular points.
    darkest : float
        Least cosine that is believed; darker pixels count as unlit [1].

    Returns
    -------
    Shading
        The equation.

    Raises
    ------
    UnsupportedError
        If a surface that faces the light could not be seen somewhere.
    """
    x, y, z = light.direction
    central = image.camera.depth_kind is DepthKind.DISTANCE
    rays = image.camera.rays(image.image.shape)[image.inside] if central else np.array([[0.0, 0.0, -1.0]])
    seen = -(rays @ light.direction) / np.linalg.norm(rays, axis=-1)
    if seen.min() < _FARTHEST:
        raise UnsupportedError(
            given=f"The light comes from the direction ({x:.3g}, {y:.3g}, {z:.3g}).",
            needed="The sweeps start where the surface faces the light, so that it must come from the camera's side, "
            "at most 88.8 degrees from the line of sight of each pixel.",
            remedy="Use another method, or an image with the light nearer to the camera.",
        )
    cosine = image.irradiance / float(light.strength[0])
    frame = np.array([*_camera_part(image.camera), x, -y, z, -1.0 if hollow else 1.0, float(central), 0.0])
    flags = _flags(image.inside, cosine > 1.0 + 1e-9, cosine < darkest)
    bright = np.where(image.inside, np.clip(cosine, darkest, 1.0), 1.0)
    return Shading(bright=bright, frame=frame, flags=flags, camera=image.camera)


def lamp_shading(image: ShadedImage, light: Led, *, darkest: float) -> Shading:
    """Return the equation under a lamp at the optical centre.

    Parameters
    ----------
    image : ShadedImage
        The image, of a pinhole camera.
    light : Led
        The lamp.
    darkest : float
        Least irradiance that is believed, as a share of the largest; darker pixels count as unlit [1].

    Returns
    -------
    Shading
        The equation.

    Raises
    ------
    UnsupportedError
        If the lamp is somewhere else, or the camera is not a pinhole.
    """
    if not isinstance(image.camera, Pinhole) or np.any(light.position != 0.0):
        raise UnsupportedError(
            given=f"A lamp at {light.position.tolist()} and a camera of the kind {image.camera.name}.",
            needed="A lamp must be at the optical centre of a pinhole camera, position (0, 0, 0).",
            remedy="Give a distant light instead, if the lamp is far away for its size.",
        )
    rays = image.camera.rays(image.image.shape)
    lobe = rays @ light.axis / np.linalg.norm(rays, axis=-1)
    flux = float(light.flux[0]) * (np.maximum(lobe, 0.0) ** light.mu)
    with np.errstate(invalid="ignore"):
        share = np.where(image.inside & (flux > 0), image.irradiance / np.where(flux > 0, flux, 1.0), 0.0)
    brightest = float(share.max())
    # Without any light all is as dark as the flux at one unit of length; every pixel is flagged.
    least = darkest * brightest if brightest > 0 else 1.0
    bright = 1.0 / np.maximum(share, least)
    frame = np.array([*_camera_part(image.camera), 0.0, 0.0, 1.0, 1.0, 1.0, 1.0])
    flags = _flags(image.inside, np.zeros(share.shape, np.bool_), (share < least) | (brightest <= 0))
    return Shading(bright=bright, frame=frame, flags=flags, camera=image.camera)


def _flags(inside: BoolArray, over: BoolArray, unlit: BoolArray) -> FlagArray:
    flags = np.zeros(inside.shape, np.uint16)
    flags[inside & over] |= np.uint16(Flag.OVER_BRIGHT)
    flags[inside & unlit] |= np.uint16(Flag.UNLIT)
    return flags
