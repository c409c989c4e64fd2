"""Exposure and haze of each image: how brightness follows from the shading of ground of albedo 1."""

from dataclasses import dataclass

import numpy as np

from psstereo.errors import InputError
from psstereo.types import BoolArray, FloatArray

__all__ = ["Exposures", "first_exposures"]

_LEAST = 0.02
"""Least correlation of brightness and predicted shading; noise alone has 1/√pixels [1]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Exposures:
    """I = exposure · albedo · R + haze.

    Attributes
    ----------
    exposure, haze : float64 arrays (k,)
        One an image [unit of the images].
    free : bool
        Whether they may change. A level elevation predicts the same brightness everywhere and tells none of them: then
        they stay at the mean brightness, and no haze.
    """

    exposure: FloatArray
    haze: FloatArray
    free: bool = True

    def shares(self, number: int, image: FloatArray) -> FloatArray:
        """Return an image without haze, in units of its exposure [1]."""
        return np.asarray((image - self.haze[number]) / self.exposure[number])

    def moved(self, change: FloatArray) -> "Exposures":
        """Return exposures after a change, (2k,): of exposure and haze of each image, in units of its exposure.

        No exposure falls to less than half in one step: a wild first step must not turn an image into its negative.
        """
        if not self.free:
            return self
        gain, offset = change.reshape(-1, 2).T
        return Exposures(
            exposure=self.exposure * np.clip(1.0 + gain, 0.5, 2.0), haze=self.haze + self.exposure * offset
        )


def first_exposures(images: list[FloatArray], shades: list[FloatArray], names: list[str]) -> Exposures:
    """Return exposures by a straight line through brightness over the shading that the coarse elevation predicts.

    The shading of details that the coarse elevation lacks is hardly correlated with that of the elevation itself, so
    that the line's slope is nearly free of bias. Where the sun's direction is wrong, brightness does not grow with it.

    Parameters
    ----------
    images : list of float64 arrays (h, w)
        Brightness, NaN where unknown.
    shades : list of float64 arrays (h, w)
        Shading predicted, 0 in shadow.
    names : list of str
        What messages call the images.

    Returns
    -------
    Exposures
        A start, that is refined with the heights.

    Raises
    ------
    InputError
        If an image has no contrast, lies all in shadow, or does not follow its sun.
    """
    found = [_line(image, shade, name) for image, shade, name in zip(images, shades, names, strict=True)]
    exposure, haze, told = np.array(found).T
    return Exposures(exposure=exposure, haze=haze, free=bool(told.all()))


def _line(image: FloatArray, shade: FloatArray, name: str) -> tuple[float, float, bool]:
    """Return exposure, haze, and whether the elevation tells them."""
    known = np.isfinite(image) & np.isfinite(shade)
    values, predicted = image[known], shade[known]
    _require_light(values, predicted, name)
    spread = predicted - predicted.mean()
    flat = float(spread @ spread) < predicted.size * 1e-8
    if flat:
        # A level elevation predicts the same everywhere: all brightness is taken as sunlight, none as haze.
        return float(values.mean() / predicted.mean()), 0.0, False
    slope = float(spread @ values / (spread @ spread))
    correlation = float(slope * np.sqrt(spread @ spread) / (np.std(values) * np.sqrt(values.size)))
    if not correlation > max(_LEAST, 4.0 / np.sqrt(values.size)):
        raise InputError(
            given=f"{name} does not grow brighter where the elevation, under its sun, should (correlation "
            f"{correlation:.2f}).",
            needed="Brightness must follow the sun that is given for the image.",
            remedy="Check the sun's azimuth (clockwise from north), that row 0 of elevation and image is north, and "
            "that both show the same ground.",
        )
    return slope, float(values.mean() - slope * predicted.mean()), True


def _require_light(values: FloatArray, predicted: FloatArray, name: str) -> None:
    lit: BoolArray = predicted > 0
    if values.size == 0 or not lit.any():
        raise InputError(
            given=f"{name} has {values.size} known pixels; the elevation puts {np.count_nonzero(lit)} in the sun.",
            needed="An image must show ground in the sun.",
            remedy="Check its sun, or leave the image out.",
        )
    if not np.ptp(values) > 1e-9 * np.abs(values).max():
        raise InputError(
            given=f"{name} has the same brightness, {values[0]:g}, everywhere.",
            needed="An image in which sunlight makes a difference, not one that lies in shadow or is empty.",
            remedy="Check the file, or leave the image out.",
        )
