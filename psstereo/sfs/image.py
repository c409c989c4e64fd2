"""One image, and all that has to be assumed to see a shape in it."""

from dataclasses import dataclass, field

import numpy as np

from psstereo.camera import Camera, Orthographic
from psstereo.depth import Prior
from psstereo.errors import InputError, UnsupportedError
from psstereo.lights import Light
from psstereo.sfs.assumption import Assumption
from psstereo.types import BoolArray, FloatArray

__all__ = ["ShadedImage"]


@dataclass(frozen=True, kw_only=True, eq=False)
class ShadedImage:
    """A single image of a matte surface, ``I = albedo · E(x, n) + ambient``, with what is known beside it.

    Attributes
    ----------
    image : float array (h, w)
        Linear brightness; NaN where unknown, which is taken as outside the mask [relative].
    light : Light
        Where the light comes from: ``Directional`` for a sun, ``Led`` for a lamp (at the origin of a pinhole camera, a
        light at the optical centre), ``Harmonics`` for light from everywhere. Of one channel.
    mask : bool array (h, w), optional
        Pixels that show the surface; all if left out.
    camera : Camera
        Orthographic unless told otherwise.
    albedo : float or float array (h, w)
        Brightness of the surface under unit irradiance; NaN where unknown [1].
    ambient : float
        Brightness that is added everywhere, of haze or light from all around [relative].
    heights : float array (h, w), optional
        Depth of the camera's kind that is known exactly, on the border or at singular points; NaN elsewhere
        [camera's unit].
    prior : Prior, optional
        Depth that is known roughly.
    sources : tuple of Assumption
        How light, albedo or ambient level came about where nobody gave them; they go into the result.

    Raises
    ------
    InputError
        If shapes do not fit, a value is not what it must be, or nothing is inside the mask.
    UnsupportedError
        If the light has several channels.
    """

    image: FloatArray
    light: Light
    mask: BoolArray | None = None
    camera: Camera = field(default_factory=Orthographic)
    albedo: float | FloatArray = 1.0
    ambient: float = 0.0
    heights: FloatArray | None = None
    prior: Prior | None = None
    sources: tuple[Assumption, ...] = ()

    def __post_init__(self) -> None:
        image = np.asarray(self.image)
        if image.ndim != 2 or image.size == 0 or image.dtype.kind != "f":
            raise InputError(
                given=f"The image is an array of shape {image.shape} and type {image.dtype}.",
                needed="One linear brightness for each pixel, as floating-point numbers in an array (h, w).",
                remedy="Turn colours into one channel, and whole numbers into shares of full scale, beforehand.",
            )
        for name, array in (("mask", self.mask), ("heights", self.heights), ("albedo", self.albedo)):
            shape = image.shape if array is None else np.asarray(array).shape
            if shape != image.shape and not (name == "albedo" and shape == ()):
                raise InputError(
                    given=f"The {name} has the shape {shape}, the image {image.shape}.",
                    needed="Both must be of the same pixels.",
                    remedy=f"Crop or scale the {name} like the image.",
                )
        albedo = np.asarray(self.albedo, np.float64)
        if (albedo <= 0).any() or np.isinf(albedo).any() or np.isnan(albedo).all() or not np.isfinite(self.ambient):
            raise InputError(
                given=f"The albedo is {albedo.min():g} to {albedo.max():g}, the ambient level {self.ambient:g}.",
                needed="An albedo is above zero, and both are finite.",
                remedy="Leave the albedo out where it is not known (NaN), or give one number for the whole surface.",
            )
        if self.light.channels != 1:
            raise UnsupportedError(
                given=f"The light has {self.light.channels} channels.",
                needed="Shape from one image works on one brightness.",
                remedy="Give the light of the channel, or of the mixture of channels, that the image holds.",
            )
        if not self.inside.any():
            raise InputError(
                given=f"None of {image.size} pixels is inside the mask, has a finite brightness and an albedo.",
                needed="At least one.",
                remedy="Check mask, image and albedo.",
            )

    @property
    def inside(self) -> BoolArray:
        """Pixels of the mask whose brightness and albedo are known, bool (h, w)."""
        known: BoolArray = np.isfinite(self.image) & np.isfinite(np.broadcast_to(self.albedo, self.image.shape))
        return known if self.mask is None else known & np.asarray(self.mask, np.bool_)

    @property
    def irradiance(self) -> FloatArray:
        """What the surface must have received, (image − ambient) / albedo, float64 (h, w), NaN outside [relative]."""
        values = (np.asarray(self.image, np.float64) - self.ambient) / self.albedo
        return np.where(self.inside, values, np.nan)
