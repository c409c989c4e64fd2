"""The camera's response, which must be undone before pixel values are proportional to radiance."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from psstereo.errors import OptionError
from psstereo.types import Array, FloatArray

__all__ = ["LINEAR", "Response"]


@dataclass(frozen=True)
class Response:
    """A tone curve that is the same for every pixel and channel.

    Attributes
    ----------
    name : str
        ``"linear"``, ``"srgb"`` (IEC 61966-2-1), ``"gamma"`` or ``"curve"``.
    exponent : float
        Of the gamma curve, value = light^(1 / exponent); unused otherwise [1].
    knots : tuple of (float, float)
        Of the curve: values and the light that they stand for, both rising from (0, 0) to (1, 1), as shares of full
        scale; a monotone cubic runs between them (PCHIP), so that light never falls while values rise [1].
    """

    name: str = "linear"
    exponent: float = 1.0
    knots: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        if self.name not in ("linear", "srgb", "gamma", "curve") or not 0.1 <= self.exponent <= 10:
            raise OptionError(
                given=f"The camera response is {self.name!r} with exponent {self.exponent}.",
                needed="Known are linear, srgb, gamma with an exponent of 0.1 to 10, and curve with its knots.",
                remedy="Choose one of them; photometric stereo needs linear values.",
            )
        if (self.name == "curve") != bool(self.knots):
            raise OptionError(
                given=f"The camera response {self.name!r} has {len(self.knots)} knots.",
                needed="A curve has knots, and nothing else has.",
                remedy="Name it curve, or leave the knots out.",
            )
        if self.knots:
            object.__setattr__(self, "knots", _checked(self.knots))

    @classmethod
    def from_knots(cls, values: npt.ArrayLike, light: npt.ArrayLike) -> "Response":
        """Return the curve through some points.

        Parameters
        ----------
        values, light : float array (n,)
            Values and the light that they stand for, rising from 0 to 1 [1].

        Returns
        -------
        Response
            The curve.

        Raises
        ------
        OptionError
            If there are fewer than two, or they do not rise from (0, 0) to (1, 1).
        """
        v, light_of = np.asarray(values, np.float64), np.asarray(light, np.float64)
        if v.ndim != 1 or v.shape != light_of.shape:
            raise OptionError(
                given=f"The knots have the shapes {v.shape} and {light_of.shape}.",
                needed="As many values as lights, in one row each.",
                remedy="Give one light a value.",
            )
        return cls("curve", knots=tuple((float(a), float(b)) for a, b in zip(v, light_of, strict=True)))

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
        if self.name == "curve":
            return _through(self.knots, v)
        return np.asarray(v**self.exponent)


def _checked(knots: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """Return the knots as plain numbers, or refuse what is no rising curve from (0, 0) to (1, 1)."""
    try:
        points = np.asarray(knots, np.float64)
        rising = points.ndim == 2 and points.shape[1] == 2 and len(points) >= 2 and bool(np.isfinite(points).all())
    except (TypeError, ValueError):
        rising = False
    if (
        not rising
        or (points[0] != 0).any()
        or (points[-1] != 1).any()
        or not ((np.diff(points[:, 0]) > 0) & (np.diff(points[:, 1]) >= 0)).all()
    ):
        raise OptionError(
            given=f"The camera response has the knots {str(knots)[:80]}.",
            needed="Pairs (value, light) that rise from (0, 0) to (1, 1).",
            remedy="Scale both to full scale and sort them; a curve that falls anywhere cannot be undone.",
        )
    return tuple((float(value), float(light)) for value, light in points)


def _through(knots: tuple[tuple[float, float], ...], v: FloatArray) -> FloatArray:
    """Return the monotone cubic through the knots; beyond full scale it goes on straight."""
    from scipy.interpolate import PchipInterpolator

    points = np.asarray(knots)
    cubic = PchipInterpolator(points[:, 0], points[:, 1])
    slope = float(cubic.derivative()(1.0))
    inside = np.minimum(v, 1.0)
    return np.asarray(cubic(inside) + slope * (v - inside))


@lru_cache(maxsize=4)
def _table(response: Response, top: int, white: float) -> FloatArray:
    """Return light for every integer value; the same for all images of a stack."""
    table = response.curve(np.arange(top + 1, dtype=np.float64) / white) * white
    return np.asarray(table, np.float32)


LINEAR = Response()
"""Pixel values proportional to light."""
