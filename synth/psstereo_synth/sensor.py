"""A camera's sensor: from radiance to the numbers in an image file."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal

import numpy as np

from psstereo.errors import InputError, OptionError
from psstereo.stack.response import LINEAR, Response
from psstereo.types import Array, FloatArray
from psstereo_synth.photons import poisson
from psstereo_synth.streams import Stream, generator

__all__ = ["Sensor"]

_BLOCK = 1 << 15
"""Values that are worked on at a time: few enough to stay in the cache from one step to the next."""


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A linear sensor with photon noise and read noise, after the model of EMVA 1288 [1]_, and a tone curve [2]_.

    A pixel under the radiance L collects, on average, ``μ = V(pixel) (1 + PRNU) (L / white) · full_well / gain``
    electrons. Their number is Poisson's and ends at the full well. Reading adds Gaussian noise; the result times
    ``gain / full_well`` plus the dark level is a share of full scale, which ends at 0 and 1, goes through the response
    and is rounded to the nearest of the steps 0 … 2^bits − 1.

    Noise of image `index` comes from a generator of its own, so the images are the same in any order and on any number
    of threads. Dark current, colour filters and the cross-talk of neighbours are not modelled; do not use it for
    exposures of many seconds.

    Attributes
    ----------
    bits : 8, 10, 12, 14, 16 or None
        Of the converter. None leaves float64 shares of full scale that end neither at 0 nor at 1 [1].
    white : float or None
        Radiance that reaches full scale on the optical axis, above the dark level, whatever the gain: the exposure.
        None until :meth:`with_white` says [W m⁻² sr⁻¹].
    full_well : float or None
        Electrons that a pixel holds. None for a sensor without any noise [electrons].
    read_noise : float
        Standard deviation; at a dark level of 0 its lower half is cut off [electrons].
    gain : float
        Amplification: full scale is at ``full_well / gain`` electrons. 1 uses the whole well, more is a higher ISO
        number, and below 1 the well is full before full scale is reached [1].
    prnu : float
        Standard deviation of the pixels' relative sensitivities, the same pattern in all images [1].
    dark_level : float
        Pedestal that is added before the response, below 1. It takes up part of the range [share of full scale].
    vignetting : float
        Share of light that is lost in the corners, below 1, after the law cos⁴ about the image centre [1].
    response : Response
        Tone curve.
    seed : int
        Of all the noise, zero or more.

    Raises
    ------
    OptionError
        If a number is out of range, or noise in electrons is asked for without a full well.

    References
    ----------
    .. [1] European Machine Vision Association, "EMVA Standard 1288: Standard for Characterization of Image Sensors and
       Cameras", Release 4.0, 2021.
    .. [2] IEC 61966-2-1, "Multimedia systems and equipment – Colour measurement and management – Part 2-1: Default RGB
       colour space – sRGB", 1999.

    Examples
    --------
    >>> Sensor(bits=8, white=2.0).expose(np.array([[[0.0, 1.0, 3.0]]]), 0).tolist()
    [[[0, 128, 255]]]
    """

    bits: Literal[8, 10, 12, 14, 16] | None = 16
    white: float | None = None
    full_well: float | None = None
    read_noise: float = 0.0
    gain: float = 1.0
    prnu: float = 0.0
    dark_level: float = 0.0
    vignetting: float = 0.0
    response: Response = LINEAR
    seed: int = 0

    def __post_init__(self) -> None:
        _require(self.bits in (8, 10, 12, 14, 16, None), "number of bits", self.bits, "8, 10, 12, 14, 16 or none")
        for what, value in (("radiance at full scale", self.white), ("full well", self.full_well)):
            _require(value is None or 0 < value < np.inf, what, value, "positive and finite, or none")
        _require(0 < self.gain < np.inf, "gain", self.gain, "positive and finite")
        for what, value in (("read noise", self.read_noise), ("spread of sensitivities", self.prnu)):
            _require(0 <= value < np.inf, what, value, "zero or more, and finite")
        for what, value in (("dark level", self.dark_level), ("vignetting", self.vignetting)):
            _require(0 <= value < 1, what, value, "0 or more and below 1")
        generator(self.seed, Stream.EXPOSURE)  # refuses bad seeds
        if self.full_well is None and (self.read_noise > 0 or self.gain != 1):
            raise OptionError(
                given=f"Read noise is {self.read_noise} electrons and the gain {self.gain}, without a full well.",
                needed="Electrons become shares of full scale through the full well.",
                remedy="Give a full well, for instance 10000 electrons, or leave read noise and gain out.",
            )

    def with_white(self, white: float) -> "Sensor":
        """Return the same sensor with another exposure: the radiance at full scale [W m⁻² sr⁻¹]."""
        return replace(self, white=white)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the images: uint8, uint16 (for 10, 12 and 14 bits too), or float64."""
        return np.dtype(np.float64 if self.bits is None else np.uint8 if self.bits == 8 else np.uint16)

    @property
    def white_value(self) -> float:
        """Value at full scale, 2^bits − 1, or 1 for floats."""
        return 1.0 if self.bits is None else float(2**self.bits - 1)

    @property
    def dark_value(self) -> float:
        """Linear value without any light, the dark level times the value at full scale."""
        return self.dark_level * self.white_value

    def expose(self, radiance: FloatArray, index: int) -> Array:
        """Take one image.

        Parameters
        ----------
        radiance : float array (h, w, c)
            Finite and not negative [W m⁻² sr⁻¹].
        index : int
            Of the exposure; the noise belongs to it.

        Returns
        -------
        uint8, uint16 or float64 array (h, w, c)
            Values from 0 to `white_value`, or shares of full scale.

        Raises
        ------
        InputError
            If the radiance has another shape, or is negative, infinite or not a number.
        OptionError
            If the radiance at full scale was not said.
        """
        radiance = np.asarray(radiance)
        if self.white is None:
            raise OptionError(
                given="The sensor's radiance at full scale is not known.",
                needed="Without an exposure no value follows from a radiance.",
                remedy="Take sensor.with_white(radiance), for instance the brightest radiance over 0.9.",
            )
        if radiance.ndim != 3 or 0 in radiance.shape:
            _refuse(f"The radiance is an array of shape {radiance.shape}")
        image = np.zeros(radiance.shape, self.dtype)
        rng = None if self.full_well is None else generator(self.seed, Stream.EXPOSURE, index)
        pattern = self._pattern(radiance.shape)
        step = max(1, _BLOCK // (radiance.shape[1] * radiance.shape[2]))
        for first in range(0, len(radiance), step):
            rows = slice(first, first + step)
            # divided, not multiplied by an inverse, so that equal radiances give equal values at any scale
            share = np.divide(radiance[rows], self.white, dtype=np.float64)
            if not (share.min() >= 0 and share.max() < np.inf):  # not a number fails too
                _refuse(f"The radiance goes from {radiance[rows].min()} to {radiance[rows].max()}")
            if pattern is not None:
                share *= pattern[rows]
            if rng is not None and self.full_well is not None:
                share = self._collect(share, self.full_well / self.gain, self.full_well, rng)
            self._convert(share, image[rows])
        return image

    def noise_sigma(self, value: FloatArray | float) -> FloatArray:
        """Return the standard deviation of a pixel, all noise together.

        Photon noise, read noise, the spread of sensitivities and rounding. From image to image, at one pixel, the
        spread of sensitivities stays the same and must be taken off. It is of no use within three times itself from 0
        and 1, where values are cut off, nor where it is well below a step and rounding is no noise any more.

        Parameters
        ----------
        value : float array of any shape
            Light on the sensor, with dark level and response undone [share of full scale].

        Returns
        -------
        float64 array of the same shape
            For values of which dark level and response have been undone as well [share of full scale].
        """
        light = np.maximum(np.asarray(value, np.float64), 0.0)
        variance = (self.prnu * light) ** 2
        if self.full_well is not None:
            electron = self.gain / self.full_well
            variance = variance + electron * light + (self.read_noise * electron) ** 2
        if self.bits is not None:
            variance = variance + (_decoding_slope(self.response, light + self.dark_level) / self.white_value) ** 2 / 12
        return np.asarray(np.sqrt(variance))

    def _pattern(self, shape: tuple[int, ...]) -> FloatArray | None:
        """Return what differs from pixel to pixel, (h, w, 1) or (h, w, c), or None if nothing does."""
        if self.vignetting == 0 and self.prnu == 0:
            return None
        return _fixed_pattern(shape, self.vignetting, self.prnu, self.seed)

    def _collect(self, share: FloatArray, scale: float, well: float, rng: np.random.Generator) -> FloatArray:
        """Return shares with photon and read noise; `scale` electrons are full scale, and `well` end them."""
        electrons = poisson(share * scale, rng)
        np.minimum(electrons, well, out=electrons)
        if self.read_noise > 0:
            read = rng.standard_normal(electrons.shape)
            read *= self.read_noise
            electrons += read
        electrons /= scale
        return electrons

    def _convert(self, share: FloatArray, out: Array) -> None:
        """Write values for shares of full scale, which are changed on the way."""
        if self.dark_level > 0:
            share += self.dark_level
        if self.bits is not None:
            np.clip(share, 0.0, 1.0, out=share)
        if not self.response.is_linear:
            share = _encode(self.response, share)
        if self.bits is not None:
            share *= self.white_value
            np.rint(share, out=share)
        np.copyto(out, share, casting="unsafe")


def _encode(response: Response, light: FloatArray) -> FloatArray:
    """Return values for light, both shares of full scale; the inverse of `Response.curve` [1]."""
    light = np.maximum(light, 0.0)
    if response.name == "srgb":
        return np.where(light <= 0.04045 / 12.92, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.asarray(light ** (1 / response.exponent))


def _decoding_slope(response: Response, light: FloatArray) -> FloatArray:
    """Return d light / d value where the light is as given; 0 where a gamma curve is upright [1]."""
    if response.is_linear:
        return np.ones_like(light)
    value = _encode(response, np.minimum(light, 1.0))
    if response.name == "srgb":
        return np.where(value <= 0.04045, 1 / 12.92, 2.4 / 1.055 * ((value + 0.055) / 1.055) ** 1.4)
    with np.errstate(divide="ignore"):  # below an exponent of 1 the first step holds no bounded share of light
        return np.asarray(response.exponent * value ** (response.exponent - 1))


@lru_cache(maxsize=2)
def _fixed_pattern(shape: tuple[int, ...], vignetting: float, prnu: float, seed: int) -> FloatArray:
    """Return fall-off times sensitivity, read-only, kept for the next image."""
    height, width, _ = shape
    y = (np.arange(height) - (height - 1) / 2)[:, None, None]
    x = (np.arange(width) - (width - 1) / 2)[None, :, None]
    corner = max((height - 1) ** 2 + (width - 1) ** 2, 1) / 4
    # cos⁴θ = (1 + tan²θ)⁻², and tan θ grows linearly with the distance from the centre
    tangent = 1 / np.sqrt(1 - vignetting) - 1
    pattern = (1 + tangent * (x * x + y * y) / corner) ** -2.0
    if prnu > 0:
        spread = generator(seed, Stream.PIXELS).standard_normal(shape)
        pattern = pattern * np.maximum(1 + prnu * spread, 0.0)
    pattern.flags.writeable = False
    return np.asarray(pattern)


def _require(fine: bool, what: str, value: object, needed: str) -> None:
    """Refuse an option."""
    if not fine:
        raise OptionError(
            given=f"The sensor's {what} is {value}.",
            needed=f"It must be {needed}.",
            remedy=f"Correct the {what}, or leave it out.",
        )


def _refuse(given: str) -> None:
    """Refuse an image."""
    raise InputError(
        given=f"{given}.",
        needed="A sensor sees an image (h, w, c) of finite radiances of zero or more.",
        remedy="Put 0 where there is no light, and look for what made other values.",
    )
