"""Photographs of an evenly lit white surface, and the gains that they tell."""

from pathlib import Path

import numpy as np

from psstereo.errors import InputError
from psstereo.stack import LINEAR, FlatField, ImageStack, Response
from psstereo.stack.decode import decode_image
from psstereo.stack.flat import flat_gain
from psstereo.types import Array, FloatArray

__all__ = ["flat_light", "is_flat_light", "read_flat", "require_unsaturated"]

_NEARLY_WHITE = 0.98
"""Share of full scale from which a value counts as saturated; sensors bend before they clip."""
_MOST_SATURATED = 0.001
"""Share of saturated pixels that hot ones explain."""


def read_flat(
    paths: tuple[Path, ...], stack: ImageStack, *, response: Response = LINEAR, dark: FloatArray | None = None
) -> FlatField:
    """Read one flat frame for all images, or one a light.

    A frame is a photograph of a white card through the same lens and response, at any exposure, with the images' dark
    level; or floats (``.npy``, TIFF) that are linear light already, such as ``psstereo calibrate flat`` writes.

    Parameters
    ----------
    paths : tuple of Path
        One file, or as many as there are images.
    stack : ImageStack
        The images that it is for.
    response : Response
        Camera response to undo in photographs.
    dark : float array (h, w, c), optional
        Level without light, in linear pixel values, taken off photographs.

    Returns
    -------
    FlatField
        The gains.

    Raises
    ------
    InputError
        If size, channels or type differ from those of the images, a frame is saturated or mostly black, or there are
        neither one nor as many as images.
    MissingFileError, UnreadableFileError
        If a file is not there or damaged.
    """
    if len(paths) not in (1, len(stack)):
        raise InputError(
            given=f"There are {len(paths)} flat frames for {len(stack)} images.",
            needed="One for all, or one a light in the same order.",
            remedy="Correct the list.",
        )
    gains = [flat_gain(flat_light(path, stack, response=response, dark=dark)) for path in paths]
    found = FlatField(gains[0] if len(gains) == 1 else np.stack(gains))
    found.require(stack.shape)
    return found


def flat_light(
    path: Path, stack: ImageStack, *, response: Response = LINEAR, dark: FloatArray | None = None
) -> FloatArray:
    """Return one flat frame as linear light, float (h, w, c); see :func:`read_flat`."""
    image = decode_image(path)
    image = image[..., None] if image.ndim == 2 else image[..., : 3 if image.shape[2] >= 3 else 1]
    whole = image.dtype.kind == "u"
    wrong = image.shape[:2] != stack.shape[1:3] or image.shape[2] not in (1, stack.shape[3])
    if wrong or (whole and (image.shape != stack.shape[1:] or image.dtype != stack.dtype)):
        raise InputError(
            given=f"The flat frame {path.name} has the shape {image.shape} and type {image.dtype}; "
            f"the images, {stack.shape[1:]} and {stack.dtype}.",
            needed="It must have the images' size, channels and bit depth, or be floating-point light.",
            remedy="Take it with the same camera and lens and convert it like the images, or leave it out.",
        )
    if not whole:
        return np.broadcast_to(image, stack.shape[1:])
    require_unsaturated(image, stack.white, path.name)
    light = np.asarray(response.linearise(image, stack.white), np.float64)
    return light if dark is None else np.asarray(light - dark)


def is_flat_light(path: Path) -> bool:
    """Return whether a file is light over its median, as ``psstereo calibrate flat`` writes it; never raises."""
    try:
        light = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError):
        return False
    if not isinstance(light, np.ndarray) or light.dtype.kind != "f" or light.ndim != 3:
        return False
    seen = light[np.isfinite(light)]
    # The gains' median is 1 channel by channel, or over all.
    return bool(seen.size and (seen > 0).all() and 0.5 < float(np.median(seen)) < 2.0)


def require_unsaturated(image: Array, white: float, name: str) -> None:
    """Refuse a flat frame with more saturated pixels than hot ones explain: its gains would stop where it clips.

    Parameters
    ----------
    image : array (h, w, c)
        The frame in its own numbers.
    white : float
        Value of full scale.
    name : str
        For the message.

    Raises
    ------
    InputError
        If it is saturated.
    """
    share = float((image >= _NEARLY_WHITE * white).any(axis=2).mean())
    if share > _MOST_SATURATED:
        raise InputError(
            given=f"{share:.1%} of the pixels of the flat frame {name} are saturated.",
            needed="A frame whose brightest part stays below full scale.",
            remedy="Expose it less; half of full scale in the middle is right.",
        )
