"""What is compared between views: brightness and its slopes in units of noise, as whole numbers with an interval."""

from typing import NamedTuple

import numpy as np

from psstereo.errors import OptionError
from psstereo.matching.images import ViewImages
from psstereo.matching.noise import Noise
from psstereo.types import Array, FloatArray, IntArray

__all__ = ["Features", "Scale", "encode", "guide"]

_STEPS = 5.0
"""Steps a standard deviation."""
_RANGE = 8000.0
"""Largest value [steps]."""
_END = 16000
"""End of an interval that is open."""
_NOWHERE = -8100
"""Value of what may not be matched."""


class Scale(NamedTuple):
    """How linear values become whole numbers, the same for both views.

    Attributes
    ----------
    noise : Noise
        In whose units values are.
    steps : float
        Steps a standard deviation; fewer where the images reach over so many that they would not fit [1].
    brightness, gradient : float
        Weights of the values themselves and of their slopes, 0 to leave one out [1].
    top : float
        Difference from which on it does not matter how large it is [standard deviations].
    """

    noise: Noise
    steps: float
    brightness: float
    gradient: float
    top: float

    @classmethod
    def of(cls, noise: Noise, brightest: float, *, brightness: float, gradient: float, top: float) -> "Scale":
        """Find the steps for images whose largest value is known [share of full scale]."""
        if not (brightness >= 0 and gradient >= 0 and brightness + gradient > 0 and top > 0):
            raise OptionError(
                given=f"The weights are {brightness} for brightness and {gradient} for slopes, and the top is {top}.",
                needed="Weights of zero or more, not both zero, and a top above zero.",
                remedy="Leave them out to get the usual ones.",
            )
        reach = float(noise.stabilised(np.array([max(brightest, 1e-12)]))[0]) * max(brightness, gradient)
        return cls(noise, min(_STEPS, _RANGE / reach), brightness, gradient, top)


class Features(NamedTuple):
    """Channels to compare.

    Attributes
    ----------
    encoded : int16 array (h, k, 3, w)
        Value, lower and upper end of its interval [steps].
    tops : int16 array (k,)
        Largest cost of each channel [steps].
    levels : float32 array (m, h, w)
        Brightness under each light on the scale on which noise is 1, the mean of the colours; not mirrored.
    """

    encoded: IntArray
    tops: IntArray
    levels: FloatArray

    @property
    def multiplier(self) -> np.uint32:
        """Cost of a step times 65536, so that all tops together cost 240."""
        return np.uint32(np.floor(240 * 65536 / int(self.tops.sum(dtype=np.int64))))


def encode(images: ViewImages, scale: Scale, *, mirrored: bool) -> Features:
    """Turn the images of a view into channels to compare.

    Parameters
    ----------
    images : ViewImages
        The view.
    scale : Scale
        Common to both views.
    mirrored : bool
        Whether the last column comes first, as the right view's does. What its mask excludes matches nothing.

    Returns
    -------
    Features
        A channel for each colour of each light, and two slopes for each light.
    """
    import cv2

    m, c, height, width = images.values.shape
    kinds = c * (scale.brightness > 0) + 2 * (scale.gradient > 0)
    encoded = np.zeros((height, m * kinds, 3, width), np.int16)
    steps = np.float32(scale.steps)
    levels = np.zeros((m, height, width), np.float32)
    k = 0
    for light in range(m):
        level = np.asarray(scale.noise.stabilised(np.asarray(images.values[light], np.float32)))
        if scale.brightness > 0:
            for colour in range(c):
                _put(encoded[:, k], level[colour] * (steps * np.float32(scale.brightness)))
                encoded[:, k, 2][images.saturated[light, colour]] = _END
                k += 1
        gray = levels[light]
        for colour in range(c):
            gray += level[colour]
        gray /= np.float32(c)
        if scale.gradient > 0:
            weight = float(steps) * scale.gradient / 4
            for dx, dy in ((1, 0), (0, 1)):
                slope = cv2.Sobel(gray, cv2.CV_32F, dx, dy, ksize=3, scale=weight, borderType=cv2.BORDER_REPLICATE)
                _put(encoded[:, k], np.asarray(slope))
                k += 1
    if mirrored:
        for part in range(3):
            encoded[:, :, part].transpose(0, 2, 1)[~images.mask] = _NOWHERE
        encoded = np.ascontiguousarray(encoded[..., ::-1])
    top = min(max(1, round(scale.top * scale.steps)), 32000 // encoded.shape[1])
    return Features(encoded, np.full(encoded.shape[1], top, np.int16), levels)


def _put(out: IntArray, values: FloatArray) -> None:
    """Fill (h, 3, w) with values and what lies half a pixel to either side."""
    v = np.clip(np.rint(values), -_RANGE, _RANGE).astype(np.int16)
    half = (v[:, 1:] + v[:, :-1]) >> 1  # sums stay below 16 bits
    out[:, 0] = out[:, 1] = out[:, 2] = v
    low, high = out[:, 1], out[:, 2]
    np.minimum(low[:, 1:], half, out=low[:, 1:])
    np.minimum(low[:, :-1], half, out=low[:, :-1])
    np.maximum(high[:, 1:], half, out=high[:, 1:])
    np.maximum(high[:, :-1], half, out=high[:, :-1])


def guide(levels: FloatArray) -> tuple[Array, Array]:
    """Return how much brightness changes from each pixel to the next, to the right and down.

    Parameters
    ----------
    levels : float32 array (m, h, w)
        Brightness on the scale on which noise is 1.

    Returns
    -------
    right, down : float32 array (h, w)
        Changes, averaged over lights; 0 in the last column and row [standard deviations].
    """
    _, height, width = levels.shape
    right, down = np.zeros((height, width), np.float32), np.zeros((height, width), np.float32)
    for level in levels:
        right[:, :-1] += np.abs(np.diff(level, axis=1))
        down[:-1] += np.abs(np.diff(level, axis=0))
    return right / np.float32(len(levels)), down / np.float32(len(levels))
