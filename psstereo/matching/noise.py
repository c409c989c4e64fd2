"""How much a linear pixel value scatters, and the scale on which it scatters alike everywhere."""

from dataclasses import dataclass, replace

import numpy as np

from psstereo.errors import OptionError
from psstereo.types import FloatArray

__all__ = ["Noise"]


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Variance of a linear value v as a share of full scale: ``read² + step²/12 + v/electrons + (relative v)²``.

    The model of EMVA 1288 [1]_ with dark current left out. Do not use it for values to which a tone curve has been
    applied and not undone: their scatter is something else in the dark than in the light.

    Attributes
    ----------
    read : float
        Standard deviation in the dark; also what two views may differ by for reasons that do not grow with the signal
        [share of full scale].
    step : float
        Distance of neighbouring values, for rounding [share of full scale].
    electrons : float
        Electrons at full scale, for photon noise; infinite for none [electrons].
    relative : float
        Standard deviation that grows with the signal: differing sensitivities, exposures, a trace of gloss [1].

    Raises
    ------
    OptionError
        If a number is negative, not a number, or all are such that there is no noise at all.

    References
    ----------
    .. [1] European Machine Vision Association, "EMVA Standard 1288: Standard for Characterization of Image Sensors and
       Cameras", Release 4.0, 2021.

    Examples
    --------
    >>> float(Noise(read=0.003, relative=0.04).sigma(0.1).round(6))
    0.005
    """

    read: float = 0.0
    step: float = 0.0
    electrons: float = np.inf
    relative: float = 0.0

    def __post_init__(self) -> None:
        parts = (self.read, self.step, self.relative)
        fine = all(0 <= part < np.inf for part in parts) and self.electrons > 0
        if not fine or (max(parts) == 0 and self.electrons == np.inf):
            raise OptionError(
                given=f"The noise is read {self.read}, step {self.step}, electrons {self.electrons}, relative "
                f"{self.relative}.",
                needed="Numbers of zero or more, electrons above zero, and some noise: differences are measured in it.",
                remedy="Give at least the step of rounding, 1/255 for 8 bits and 1/65535 for 16.",
            )

    def variance(self, value: FloatArray) -> FloatArray:
        """Return the variance of linear values, of the same shape; below zero as at zero [share of full scale²]."""
        v = np.maximum(value, 0.0)
        constant = self.read**2 + self.step**2 / 12
        return np.asarray(constant + v / self.electrons + (self.relative * v) ** 2)

    def sigma(self, value: FloatArray | float) -> FloatArray:
        """Return the standard deviation of linear values, of the same shape [share of full scale]."""
        return np.sqrt(self.variance(np.asarray(value, np.float64)))

    def with_tolerance(self, floor: float, relative: float) -> "Noise":
        """Return the noise with room for what two views differ by beside it.

        Parameters
        ----------
        floor : float
            Standard deviation of it anywhere [share of full scale].
        relative : float
            Standard deviation of it over the signal [1].

        Returns
        -------
        Noise
            All of it together.
        """
        return replace(self, read=float(np.hypot(self.read, floor)), relative=float(np.hypot(self.relative, relative)))

    def scaled(self, factor: float) -> "Noise":
        """Return the noise of values that have been multiplied by a positive factor [1]."""
        return Noise(
            read=self.read * factor,
            step=self.step * factor,
            electrons=self.electrons / factor,
            relative=self.relative,
        )

    def stabilised(self, value: FloatArray) -> FloatArray:
        """Return values on a scale on which the standard deviation is 1 everywhere: the integral of dv / sigma(v).

        So the difference of two stabilised values is that of the values in units of their noise, as long as the noise
        is about the same at both. Negative values go on in a straight line.

        Parameters
        ----------
        value : float array of any shape
            Linear values [share of full scale].

        Returns
        -------
        float array of the same shape
            0 at 0; as precise as the values [1].
        """
        v = np.asarray(value)
        light = np.maximum(v, 0)
        constant, linear, square = self.read**2 + self.step**2 / 12, 1 / self.electrons, self.relative**2
        dark = constant**0.5  # a plain float, which leaves float32 as it is
        result: FloatArray
        if square > 0:
            root = np.sqrt(constant + (linear + square * light) * light)
            begin = 2 * self.relative * dark + linear
            result = np.log((2 * self.relative * root + 2 * square * light + linear) / begin) / self.relative
        elif linear > 0:
            # 2 (√(a + b v) − √a) / b, without the difference of nearly equal numbers
            result = 2 * light / (np.sqrt(constant + linear * light) + dark)
        else:
            result = light / dark
        if dark > 0 and v.size and float(v.min()) < 0:
            result = result + np.minimum(v, 0) / dark
        return np.asarray(result, v.dtype)
