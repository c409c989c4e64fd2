"""What was measured: images, lights, camera, mask — and, where someone knows it, the truth."""

from dataclasses import dataclass, field

import numpy as np

from psstereo.camera import Camera, Orthographic
from psstereo.errors import InputError
from psstereo.lights import Rig
from psstereo.stack import LINEAR, FlatField, ImageStack, Response
from psstereo.stack.linear import linear_frame
from psstereo.types import BoolArray, FloatArray

__all__ = ["Capture", "Truth"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Capture:
    """Photographs of one object from one viewpoint under several lights.

    Attributes
    ----------
    stack : ImageStack
        The images, one a light.
    rig : Rig
        The lights, in the order of the images.
    camera : Camera
        Orthographic in pixels if nothing better is known.
    mask : bool array (h, w) or None
        The object; every pixel if absent.
    response : Response
        Camera response to undo.
    dark : float array (h, w, c) or None
        What the camera shows without any of the lights, as linear pixel values.
    flat : FlatField or None
        Gains that undo vignetting and unequal pixels, applied after the dark level is taken off.
    radiance_at_white : float or None
        Radiance of a pixel at full scale; with a rig of irradiances it makes albedo absolute [W m⁻² sr⁻¹].
    name : str
        For reports.
    notes : tuple of str
        What the reader assumed or warns of, as sentences.

    Raises
    ------
    InputError
        If counts or sizes disagree, or the mask is empty.
    """

    stack: ImageStack
    rig: Rig
    camera: Camera = field(default_factory=Orthographic)
    mask: BoolArray | None = None
    response: Response = LINEAR
    dark: FloatArray | None = None
    flat: FlatField | None = None
    radiance_at_white: float | None = None
    name: str = "capture"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        images, height, width, channels = self.stack.shape
        if images != len(self.rig):
            raise InputError(
                given=f"There are {images} images and {len(self.rig)} lights ({self.rig.source}).",
                needed="Each image needs its light, in the same order.",
                remedy="Check the list of files and the lights file for missing or extra rows.",
            )
        if self.mask is not None:
            _check_mask(self.mask, (height, width))
        if self.radiance_at_white is not None and not 0 < self.radiance_at_white < np.inf:
            raise InputError(
                given=f"The radiance of a pixel at full scale is {self.radiance_at_white}.",
                needed="It must be a positive number of W m⁻² sr⁻¹.",
                remedy="Correct it, or leave it out to get relative albedo.",
            )
        if self.dark is not None and self.dark.shape != (height, width, channels):
            raise InputError(
                given=f"The dark image has the shape {self.dark.shape}; the images, {(height, width, channels)}.",
                needed="It must have the images' size and channels.",
                remedy="Take it with the same camera settings, or leave it out.",
            )
        if self.flat is not None:
            self.flat.require(self.stack.shape)

    def linear(self, index: int) -> FloatArray:
        """Return one image as linear light: response undone, dark level taken off, flat field applied.

        For whoever needs a whole image; solvers gather samples of all images at once.

        Parameters
        ----------
        index : int
            Which image, from 0.

        Returns
        -------
        float32 array (h, w, c), float64 if the images are
            Light in the images' own scale; saturated values are not marked.
        """
        return linear_frame(self.stack, index, response=self.response, dark=self.dark, flat=self.flat)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the images."""
        return self.stack.shape[1], self.stack.shape[2]

    @property
    def effective_mask(self) -> BoolArray:
        """The mask, or every pixel."""
        return np.ones(self.shape, np.bool_) if self.mask is None else self.mask


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """What is known independently of the images; any part may be absent.

    Attributes
    ----------
    normals : float array (h, w, 3) or None
        Unit normals, x right, y up, z toward the camera; zero or NaN where unknown [1].
    depth : float array (h, w) or None
        Depth of the kind and unit of the capture's camera, NaN where unknown.
    albedo : float array (h, w) or (h, w, c) or None
        Albedo.
    visibility : float array (m, h, w) or None
        Share of each light that gets past shadow casters to the pixel: 0 in full cast shadow, 1 where nothing is in
        the way [1].
    source : str
        Where it came from.
    """

    normals: FloatArray | None = None
    depth: FloatArray | None = None
    albedo: FloatArray | None = None
    visibility: FloatArray | None = None
    source: str = "given"


def _check_mask(mask: BoolArray, shape: tuple[int, int]) -> None:
    if mask.dtype != np.bool_ or mask.shape != shape:
        raise InputError(
            given=f"The mask has the shape {mask.shape} and type {mask.dtype}; the images, {shape}.",
            needed="A mask is an array of booleans of the images' size.",
            remedy="Use the mask that belongs to these images, uncropped and not resized.",
        )
    if not mask.any():
        raise InputError(
            given="The mask is empty: no pixel is selected.",
            needed="At least one pixel of the object must be marked.",
            remedy="Check that the object is white in the mask, not black, or work without a mask.",
        )
