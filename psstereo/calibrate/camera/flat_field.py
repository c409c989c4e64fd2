"""The flat field from photographs of a white card."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psstereo.errors import InputError, OptionError
from psstereo.io.flat_file import require_unsaturated
from psstereo.io.rig_file import RigQuality
from psstereo.stack import LINEAR, FlatField, Response
from psstereo.stack.flat import flat_gain
from psstereo.stack.stack import full_scale
from psstereo.types import Array, FloatArray, Progress, no_progress

__all__ = ["FlatFit", "flat_from_frames"]

_NOISY = 0.01
"""Noise of the gains from which more frames are advised: a hundredth of brightness is about half a degree."""
_STRONG = 0.5
"""Light in a corner over that in the middle below which gains lift noise a lot."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FlatFit:
    """A flat field, and how well it is known.

    Attributes
    ----------
    light : float32 array (h, w, c)
        Light of the card over its median, NaN where a pixel is dead: what flat-field files hold [1].
    flat : FlatField
        The gains.
    corners : float
        Mean light in the four corners, an eighth of each side, over that in the middle [1].
    noise : float
        Standard error of a gain, as a share of it; NaN if one frame alone cannot tell [1].
    dead : int
        Values of pixels and channels that see next to nothing.
    quality : RigQuality
        The same in words.
    """

    light: FloatArray
    flat: FlatField
    corners: float
    noise: float
    dead: int
    quality: RigQuality


def flat_from_frames(
    frames: Sequence[Array],
    *,
    response: Response = LINEAR,
    dark: FloatArray | None = None,
    white: float | None = None,
    smooth: float = 0.0,
    progress: Progress = no_progress,
) -> FlatFit:
    """Average photographs of an evenly lit white surface.

    Vignetting, dust and unequal pixels are in it, and so is whatever is uneven in the card and its light: turn the card
    by a quarter between photographs, out of focus, in the light of a cloudy sky. Not under the lights of the rig, which
    would be divided out of the photographs too, unless there is one flat field a light and the object is where the card
    was.

    Parameters
    ----------
    frames : sequence of array (h, w) or (h, w, c)
        Photographs in their own numbers.
    response : Response
        Camera response to undo.
    dark : float array (h, w, c), optional
        Level without light at the card's exposure, in linear pixel values.
    white : float, optional
        Value of full scale; from the type if absent.
    smooth : float
        Standard deviation of a Gaussian over the light, which takes noise out, and dust and unequal pixels
        with it [px].
    progress : callable
        Told how many photographs have been added up.

    Returns
    -------
    FlatFit
        Light and gains.

    Raises
    ------
    InputError
        If frames differ, one is saturated, or they are mostly black.
    OptionError
        If `smooth` is negative, or wider than the photographs.
    """
    if not 0 <= smooth < np.inf:
        raise OptionError(
            given=f"The flat field is to be smoothed over {smooth} px.", needed="0 or more.", remedy="Correct it."
        )
    pictures = [one[..., None] if one.ndim == 2 else one for one in (np.asarray(frame) for frame in frames)]
    if not pictures or len({(one.shape, one.dtype) for one in pictures}) > 1 or pictures[0].ndim != 3:
        raise InputError(
            given=f"The white card's photographs have the shapes {sorted({one.shape for one in pictures})}.",
            needed="One or more of one size and type.",
            remedy="Take all with the same camera and convert them alike.",
        )
    if smooth > max(pictures[0].shape[:2]):
        raise OptionError(
            given=f"The flat field is to be smoothed over {smooth:g} px, and has {max(pictures[0].shape[:2])}.",
            needed="Less than the photographs are wide or high.",
            remedy="Some pixels take out noise; a hundred leave vignetting alone.",
        )
    top = full_scale(pictures[0].dtype) if white is None else white
    mean, square = np.zeros(pictures[0].shape), np.zeros(pictures[0].shape)
    for number, one in enumerate(pictures, start=1):
        if one.dtype.kind == "u" or white is not None:
            require_unsaturated(one, top, f"number {number}")
        light = np.asarray(response.linearise(one, top), np.float64) - (0.0 if dark is None else dark)
        light = light / max(float(np.nanmedian(light)), 1e-12 * top)  # a lamp's drift is not noise of the pixels
        change = light - mean
        mean += change / number
        square += change * (light - mean)
        progress("white card", number, len(pictures))
    count = len(pictures)
    gain = flat_gain(_smoothed(mean, smooth))
    shares = 1.0 / gain
    noise = float("nan")
    if count > 1:
        variance = square / (count - 1) / count / np.where(mean > 0, mean, np.nan) ** 2
        noise = float(np.sqrt(np.nanmean(variance))) / max(1.0, np.sqrt(4 * np.pi) * smooth)
    corners = _corners(shares)
    dead = int(np.count_nonzero(np.isnan(gain)))
    return FlatFit(
        light=np.asarray(shares, np.float32),
        flat=FlatField(gain),
        corners=corners,
        noise=noise,
        dead=dead,
        quality=_quality(corners, noise, dead, count),
    )


def _smoothed(light: FloatArray, smooth: float) -> FloatArray:
    """Return the light, averaged over neighbours that see."""
    if smooth == 0:
        return light
    import cv2

    seen = np.isfinite(light) & (light > 0)
    shape = light.shape
    total = cv2.GaussianBlur(np.where(seen, light, 0.0), (0, 0), smooth, borderType=cv2.BORDER_REPLICATE)
    weight = cv2.GaussianBlur(seen.astype(np.float64), (0, 0), smooth, borderType=cv2.BORDER_REPLICATE)
    quotient = np.asarray(total).reshape(shape) / np.maximum(np.asarray(weight).reshape(shape), 1e-12)
    return np.where(seen, quotient, np.nan)


def _corners(shares: FloatArray) -> float:
    rows, columns = (max(1, size // 8) for size in shares.shape[:2])
    middle = shares[
        (shares.shape[0] - rows) // 2 : (shares.shape[0] + rows + 1) // 2,
        (shares.shape[1] - columns) // 2 : (shares.shape[1] + columns + 1) // 2,
    ]
    four = [shares[r, c] for r in (slice(rows), slice(-rows, None)) for c in (slice(columns), slice(-columns, None))]
    return float(np.nanmean(np.stack([np.nanmean(one) for one in four])) / np.nanmean(middle))


def _quality(corners: float, noise: float, dead: int, count: int) -> RigQuality:
    advice = []
    if not noise < _NOISY:
        what = "One photograph does not tell its noise" if count == 1 else f"The gains have {noise:.1%} of noise"
        advice.append(f"{what}: average several, or smooth.")
    if corners < _STRONG:
        advice.append(f"Corners get {corners:.0%} of the light, so that their noise is lifted: close the aperture.")
    known = "" if count == 1 else f", known to {noise:.2%} a pixel"
    return RigQuality(
        residual_brightness=None if np.isnan(noise) else noise,
        verdict=f"Corners get {corners:.1%} of the light of the middle{known}; {dead} dead values.",
        advice=tuple(advice),
    )
