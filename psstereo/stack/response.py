"""The camera's response, which must be undone before pixel values are proportional to radiance."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from psstereo.errors import OptionError
from psstereo.types import Array, FloatArray

__all__ = ["LINEAR", "Response"]


@dataclass(frozen=True)
class Response:
    """A tone curve that is the same for every pixel and channel.

    Attributes
    ----------
    name : str
        ``"linear"``, ``"srgb"`` (IEC 61966-2-1) or ``"gamma"``.
    exponent : float
        Of the gamma curve, value = light^(1 / exponent); unused otherwise [1].
    """

    name: str = "linear"
    exponent: float = 1.0

    def __post_init__(self) -> None:
        if self.name not in ("linear", "srgb", "gamma") or not 0.1 <= self.exponent <= 10:
            raise OptionError(
                given=f"The camera response is {self.name!r} with exponent {self.exponent}.",
                needed="Known are linear, srgb, and gamma with an exponent of 0.1 to 10.",
                remedy="Choose one of them; photometric stereo needs linear values.",
            )

    @property
    def is_linear(self) -> bool:
        """Whether there is nothing to undo."""
        return self.name == "linear"

    def linearise(self, values: Array, white: float) -> FloatArray:
        """Return light in the same scale: 0 stays 0 and white stays white.

        Parameters
        ----------
        values : array of any shape
            Pixel values. Integers go through a table.
        white : float
            Value of full scale.

        Returns
        -------
        float32 array, float64 if the values are
            Linear values.
        """
        if values.dtype.kind == "u":
            return _table(self, int(np.iinfo(values.dtype).max), white)[values]
        return (self.curve(values / white) * white).astype(values.dtype)

    def curve(self, v: FloatArray) -> FloatArray:
        """Return light, as a share of full scale, for values as shares of full scale [1]."""
        v = np.maximum(v, 0.0)
        if self.name == "srgb":
            return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
        return np.asarray(v**self.exponent)


@lru_cache(maxsize=4)
def _table(response: Response, top: int, white: float) -> FloatArray:
    """Return light for every integer value; the same for all images of a stack."""
    table = response.curve(np.arange(top + 1, dtype=np.float64) / white) * white
    return np.asarray(table, np.float32)


LINEAR = Response()
"""Pixel values proportional to light."""
