"""The interface of surfaces z = f(x, y)."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from psstereo.types import FloatArray

__all__ = ["Elevation", "Relief"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Elevation:
    """Heights and slopes at some places; NaN where there is no surface.

    Attributes
    ----------
    height : float64 array (...)
        z [length].
    slope_x, slope_y : float64 array (...)
        ∂z/∂x and ∂z/∂y, exact rather than differenced [1].
    """

    height: FloatArray
    slope_x: FloatArray
    slope_y: FloatArray


@dataclass(frozen=True, eq=False)
class Relief(ABC):
    """A surface over the plane: x right, y up, z toward the viewer. Defaults fit into −1 ≤ x, y ≤ 1.

    Lengths have no unit of their own; a scene says how long its unit is.
    """

    name: ClassVar[str]
    summary: ClassVar[str]

    @property
    def convex(self) -> bool:
        """Whether no part of it can cast a shadow on another part, whatever the light."""
        return False

    @property
    @abstractmethod
    def bounds(self) -> tuple[float, float]:
        """Heights below and above which there is no surface, tight within a few per cent [length]."""

    @abstractmethod
    def evaluate(self, x: FloatArray, y: FloatArray) -> Elevation:
        """Return the surface at some places.

        Parameters
        ----------
        x, y : float array (...)
            Places [length].

        Returns
        -------
        Elevation
            float64 heights and slopes of the same shape; NaN outside the surface's outline.
        """
