"""The same albedo everywhere."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from psstereo.types import FloatArray
from psstereo_synth.patterns.pattern import Pattern, albedos, require_points

__all__ = ["Constant"]


@dataclass(frozen=True, kw_only=True)
class Constant(Pattern):
    """One albedo.

    Attributes
    ----------
    albedo : float or sequence (c,)
        Albedo πρ, 0 … 1, one number or one a channel; kept as a tuple [1].

    Raises
    ------
    InputError
        If it is outside 0 … 1.
    """

    name: ClassVar[str] = "constant"
    summary: ClassVar[str] = "The same albedo everywhere."
    albedo: npt.ArrayLike = 0.7

    def __post_init__(self) -> None:
        object.__setattr__(self, "albedo", albedos("albedo", self.albedo))

    @property
    def channels(self) -> int:
        """See :attr:`Pattern.channels`."""
        return int(np.size(self.albedo))

    def evaluate(self, points: FloatArray) -> FloatArray:
        """Return the albedo, NaN at unknown points; see :meth:`Pattern.evaluate`."""
        known = np.isfinite(require_points(points)).all(axis=1, keepdims=True)
        return np.where(known, np.asarray(self.albedo, np.float64), np.nan)
