"""Surfaces of which it is known how far they reach."""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from psstereo.types import BoolArray, FloatArray
from psstereo_synth.shapes.checks import positive
from psstereo_synth.shapes.relief import Relief

__all__ = ["FiniteRelief", "SquareRelief"]


@dataclass(frozen=True, eq=False)
class FiniteRelief(Relief):
    """A surface inside a known rectangle, so that rays and meshes know where to look for it."""

    @property
    @abstractmethod
    def extent(self) -> tuple[float, float]:
        """Half the sides, along x and y, of the rectangle around the origin outside which it is nowhere [length]."""


@dataclass(frozen=True, kw_only=True)
class SquareRelief(FiniteRelief):
    """A surface over the square −half_width ≤ x, y ≤ half_width, edges included.

    Attributes
    ----------
    half_width : float
        Half the side of the square [length].

    Raises
    ------
    InputError
        If it is not positive.
    """

    half_width: float = 1.0

    def __post_init__(self) -> None:
        positive(self.name, half_width=self.half_width)

    @property
    def extent(self) -> tuple[float, float]:
        """See :attr:`FiniteRelief.extent`."""
        return self.half_width, self.half_width

    def inside(self, x: FloatArray, y: FloatArray) -> BoolArray:
        """Return whether places lie in the square, its edges included.

        Parameters
        ----------
        x, y : float64 array (...)
            Places [length].

        Returns
        -------
        bool array (...)
            True in the square; False for NaN.
        """
        return np.asarray((np.abs(x) <= self.half_width) & (np.abs(y) <= self.half_width))
