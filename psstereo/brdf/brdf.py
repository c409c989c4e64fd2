"""The interface of reflectance models."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Self

import numpy as np

from psstereo.types import FloatArray

__all__ = ["Brdf"]


@dataclass(frozen=True, eq=False)
class Brdf(ABC):
    """How much of the irradiance from one direction a surface sends into another, ``L_out = ∫ ρ L n·l dΩ``.

    A parameter that is an array of two or more axes varies over the surface: its last axis is channels, the others
    are those of the normals. One of a single axis (c,) is the same everywhere.

    Attributes
    ----------
    reciprocal : bool
        Whether light and eye may change places.
    conserving : bool
        Whether it reflects no more than it receives, for every direction and every parameter that it accepts.
    constant : bool
        Whether it is the same for all directions, so that radiance follows from the irradiance alone.
    """

    name: ClassVar[str]
    reciprocal: ClassVar[bool] = True
    conserving: ClassVar[bool] = True
    constant: ClassVar[bool] = False

    @property
    @abstractmethod
    def channels(self) -> int:
        """Number of channels c of its values."""

    @abstractmethod
    def evaluate(self, normals: FloatArray, to_light: FloatArray, to_eye: FloatArray) -> FloatArray:
        """Return ρ, never times the cosine.

        Parameters
        ----------
        normals, to_light, to_eye : float array (..., 3)
            Unit vectors, broadcast against each other; to the light and to the eye from the surface [1].

        Returns
        -------
        float64 array (..., c)
            ρ; zero where light or eye is not above the surface, NaN where a vector is [sr⁻¹].
        """

    @property
    def diffuse_albedo(self) -> FloatArray:
        """The albedo πρ of its diffuse part, what a matte solver should find, (c,) or (..., c) [1].

        Zero for a model without a diffuse part, NaN where it is not known, as for measured tables.
        """
        return np.zeros(self.channels)

    def at(self, index: Any) -> Self:
        """Return the model for some of the surface's points: whatever indexes the leading axes of a map."""
        maps = {
            f.name: v[index] for f in fields(self) if isinstance(v := getattr(self, f.name), np.ndarray) and v.ndim > 1
        }
        return replace(self, **maps) if maps else self
