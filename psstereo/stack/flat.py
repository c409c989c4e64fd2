"""What lens and sensor do to evenly lit white, pixel by pixel, and the gain that undoes it."""

from dataclasses import dataclass

import numpy as np

from psstereo.errors import InputError
from psstereo.types import FloatArray

__all__ = ["FlatField", "flat_gain"]

_DEAD = 0.05
"""Share of the median light from which a pixel counts as one that sees."""


@dataclass(frozen=True, eq=False)
class FlatField:
    """Gains that make an evenly lit white surface even: linear values, dark level taken off, are multiplied by them.

    One for all images undoes the lens's vignetting and unequal pixels. One a light undoes besides that a light is
    stronger on one side of the object's place; each then has a mean of its own of 1, so that lights keep their
    strengths. Not for lamps near the object whose light changes with depth; those want positions.

    Attributes
    ----------
    gain : float32 array (h, w, c) or (m, h, w, c)
        Positive; NaN where a pixel is dead, which makes its samples NaN [1].

    Raises
    ------
    InputError
        If the shape is another, or a gain is zero, negative or infinite, or all of them are NaN.
    """

    gain: FloatArray

    def __post_init__(self) -> None:
        gain = np.asarray(self.gain, np.float32)
        object.__setattr__(self, "gain", gain)
        known = gain[~np.isnan(gain)]
        if gain.ndim not in (3, 4) or not known.size or not ((known > 0) & np.isfinite(known)).all():
            low, high = (float(known.min()), float(known.max())) if known.size else (float("nan"), float("nan"))
            raise InputError(
                given=f"The flat field's gains have the shape {gain.shape} and run from {low:.3g} to {high:.3g}.",
                needed="Positive numbers, (h, w, c) for all images or (m, h, w, c) for one a light.",
                remedy="Take the flat frame again: an evenly lit white card that fills the picture, unsaturated.",
            )

    @property
    def per_light(self) -> bool:
        """Whether each image has gains of its own."""
        return self.gain.ndim == 4

    def of(self, index: int) -> FloatArray:
        """Return the gains of one image, (h, w, c)."""
        return np.asarray(self.gain[index] if self.per_light else self.gain)

    def require(self, shape: tuple[int, int, int, int]) -> None:
        """Refuse images of another size.

        Parameters
        ----------
        shape : (int, int, int, int)
            Of the stack: (m, h, w, c).

        Raises
        ------
        InputError
            If number, size or channels differ.
        """
        if self.gain.shape != (shape if self.per_light else shape[1:]):
            raise InputError(
                given=f"The flat field has the shape {self.gain.shape}; the images, {shape}.",
                needed="It must have the images' size and channels, and be one for all or one a light.",
                remedy="Take it with the same camera and lens, uncropped and not resized, or leave it out.",
            )

    def cut(self, rows: slice, columns: slice) -> "FlatField":
        """Return the gains of a rectangle of the images."""
        return FlatField(self.gain[..., rows, columns, :])


def flat_gain(light: FloatArray) -> FloatArray:
    """Return the gains that make an image of an even surface even.

    Parameters
    ----------
    light : float array (h, w, c) or (m, h, w, c)
        Linear light of an evenly lit, even surface, dark level taken off, in any unit.

    Returns
    -------
    float32 array of that shape
        Median over light, channel by channel; NaN where a pixel shows less than a twentieth of the median [1].

    Raises
    ------
    InputError
        If less than half of the pixels show anything.
    """
    given = np.asarray(light, np.float64)
    seen = np.where(np.isfinite(given) & (given > 0), given, np.nan)
    share = np.isfinite(seen).mean(axis=(-3, -2))
    if given.ndim not in (3, 4) or not share.min() >= 0.5:
        raise InputError(
            given=f"The flat frame has the shape {given.shape} and shows light in {share.min():.0%} of its pixels.",
            needed="An image of an even, evenly lit surface that fills it.",
            remedy="Photograph a white card, unsaturated, and check the dark image that is taken off it.",
        )
    level = np.nanmedian(seen, axis=(-3, -2), keepdims=True)
    return np.asarray(np.where(seen > _DEAD * level, level / seen, np.nan), np.float32)
