"""The photographs of one viewpoint, as linear values with their noise."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError
from psstereo.matching.noise import Noise
from psstereo.stack import LINEAR, MemoryStack, Response
from psstereo.stack.stack import full_scale
from psstereo.types import Array, BoolArray, FloatArray

__all__ = ["ViewImages", "require_comparable"]


@dataclass(frozen=True, kw_only=True, eq=False)
class ViewImages:
    """Linear values of all photographs from one viewpoint.

    Attributes
    ----------
    values : float32 or float64 array (m, c, h, w)
        Images under m lights, c colours [share of full scale].
    saturated : bool array (m, c, h, w)
        Where a value only says that there was at least so much light.
    mask : bool array (h, w)
        The object.
    noise : Noise
        Of the values.
    white : float or None
        Radiance at full scale, if known [W m⁻² sr⁻¹].
    name : str
        For messages.

    Raises
    ------
    InputError
        If shapes disagree, a value is not finite, or the mask is empty.
    """

    values: FloatArray
    saturated: BoolArray
    mask: BoolArray
    noise: Noise
    white: float | None = None
    name: str = "view"

    def __post_init__(self) -> None:
        shape = self.values.shape
        if len(shape) != 4 or 0 in shape or self.saturated.shape != shape or self.mask.shape != shape[2:]:
            raise InputError(
                given=f"{self.name}: values {shape}, saturation {self.saturated.shape} and mask {self.mask.shape}.",
                needed="Values and saturation (lights, colours, rows, columns), and a mask of rows and columns.",
                remedy="Build them with ViewImages.from_capture or from_arrays.",
            )
        if not np.isfinite(self.values).all():
            raise InputError(
                given=f"{self.name} has a value that is not a finite number.",
                needed="Numbers everywhere; a mask says where they mean nothing.",
                remedy="Put 0 there and take it out of the mask.",
            )
        if not self.mask.any():
            raise InputError(
                given=f"The mask of {self.name} is empty.",
                needed="At least one pixel to match.",
                remedy="Check that the object is white in the mask, not black.",
            )

    @classmethod
    def from_capture(
        cls, capture: Capture, *, noise: Noise | None = None, lights: Sequence[int] | None = None
    ) -> "ViewImages":
        """Take the images of a capture, with response and dark level undone.

        Parameters
        ----------
        capture : Capture
            What was measured from this viewpoint.
        noise : Noise, optional
            Of the linear values; the rounding of the images alone if absent, which no real camera reaches.
        lights : sequence of int, optional
            Which images; all if absent.

        Returns
        -------
        ViewImages
            The values.

        Raises
        ------
        OptionError
            If an image is asked for that is not there.
        """
        chosen = list(range(len(capture.stack))) if lights is None else list(lights)
        if not chosen or min(chosen) < 0 or max(chosen) >= len(capture.stack):
            raise OptionError(
                given=f"The images {chosen} are asked for; {capture.name} has {len(capture.stack)}.",
                needed="Numbers of images, counted from 0, at least one.",
                remedy="Ask for fewer lights.",
            )
        white = capture.stack.white
        made, full = [], []
        for index in chosen:
            frame = capture.stack.frame(index)
            linear = capture.linear(index)
            kind = np.float64 if linear.dtype == np.float64 else np.float32
            made.append(np.divide(linear, white, dtype=kind).transpose(2, 0, 1))
            full.append(frame >= white if capture.stack.saturates else np.zeros(frame.shape, np.bool_))
        integer = np.issubdtype(capture.stack.dtype, np.integer)
        default = Noise(step=1 / white if integer else float(np.finfo(np.float32).eps))
        return cls(
            values=np.stack(made),
            saturated=np.stack(full).transpose(0, 3, 1, 2),
            mask=capture.effective_mask,
            noise=noise or default,
            white=capture.radiance_at_white,
            name=capture.name,
        )

    @classmethod
    def from_arrays(
        cls,
        images: Array | Sequence[Array],
        *,
        noise: Noise | None = None,
        response: Response = LINEAR,
        mask: BoolArray | None = None,
        name: str = "view",
    ) -> "ViewImages":
        """Take images from memory.

        Parameters
        ----------
        images : array (h, w) or (h, w, c), or a sequence of them
            One image, or several of the same size under different lights; integers of 8 or 16 bits, or floats of which
            1 is full scale.
        noise : Noise, optional
            Of the linear values; rounding alone if absent.
        response : Response
            Tone curve to undo.
        mask : bool array (h, w), optional
            The object; every pixel if absent.
        name : str
            For messages.

        Returns
        -------
        ViewImages
            The values.

        Raises
        ------
        InputError
            If an image has another shape or type than these, or the images differ in size.
        """
        frames = [np.asarray(image) for image in ([images] if isinstance(images, np.ndarray) else images)]
        frames = [frame[..., None] if frame.ndim == 2 else frame for frame in frames]
        same = len({(frame.shape, frame.dtype) for frame in frames}) == 1
        if not same or frames[0].ndim != 3 or frames[0].dtype.kind not in "uf":
            raise InputError(
                given=f"{name}: images of {sorted({(f.shape, str(f.dtype)) for f in frames})}.",
                needed="One image or more, all (h, w) or (h, w, c), of one size and one type, 8 or 16 bits or floats.",
                remedy="Check how they were read.",
            )
        white = full_scale(frames[0].dtype)
        stack = MemoryStack(np.stack(frames), white=white if frames[0].dtype.kind == "u" else None)
        linear = np.stack([response.linearise(stack.frame(i), white) for i in range(len(frames))])
        kind = np.float64 if frames[0].dtype == np.float64 else np.float32
        full = np.stack(frames) >= white if frames[0].dtype.kind == "u" else np.zeros(linear.shape, np.bool_)
        step = 1 / white if frames[0].dtype.kind == "u" else float(np.finfo(np.float32).eps)
        return cls(
            values=np.ascontiguousarray(np.divide(linear, white, dtype=kind).transpose(0, 3, 1, 2)),
            saturated=np.ascontiguousarray(full.transpose(0, 3, 1, 2)),
            mask=np.ones(linear.shape[1:3], np.bool_) if mask is None else np.asarray(mask, np.bool_),
            noise=noise or Noise(step=step),
            name=name,
        )

    @property
    def lights(self) -> int:
        """Number of images."""
        return int(self.values.shape[0])

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.values.shape[2], self.values.shape[3]

    def first_lights(self, count: int) -> "ViewImages":
        """Return the same with the first images only."""
        return replace(self, values=self.values[:count], saturated=self.saturated[:count])

    def corrected(self, gain: float, offset: float) -> "ViewImages":
        """Return the values times a gain plus an offset [share of full scale], and their noise with them."""
        values = np.asarray(self.values * self.values.dtype.type(gain) + self.values.dtype.type(offset))
        return replace(self, values=values, noise=self.noise.scaled(gain))

    def in_exposure_of(self, other: "ViewImages") -> "ViewImages":
        """Return the values on the other's scale, if both say what radiance full scale is; as they are if not."""
        if self.white is None or other.white is None or self.white == other.white:
            return self
        return replace(self.corrected(self.white / other.white, 0.0), white=other.white)


def require_comparable(one: ViewImages, other: ViewImages, *, same_size: bool) -> None:
    """Refuse views whose images do not belong together.

    Parameters
    ----------
    one, other : ViewImages
        The views.
    same_size : bool
        Whether images must have the same size, as those of a rectified pair do.

    Raises
    ------
    InputError
        If the number of lights or colours differs, or the size.
    """
    if one.values.shape[:2] != other.values.shape[:2]:
        raise InputError(
            given=f"{one.name} has {one.lights} images of {one.values.shape[1]} channels; {other.name}, "
            f"{other.lights} of {other.values.shape[1]}.",
            needed="Both views must be photographed under the same lights with the same colours.",
            remedy="Leave out the images that only one view has, or turn both to gray.",
        )
    if same_size and one.size != other.size:
        raise InputError(
            given=f"{one.name} is {one.size[1]} × {one.size[0]} pixels; {other.name}, "
            f"{other.size[1]} × {other.size[0]}.",
            needed="The images of a rectified pair have the same size, and a point is in the same row of both.",
            remedy="Rectify both with the same size, or match them as calibrated views by a plane sweep.",
        )
