"""The interface of albedo patterns."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError
from psstereo.types import FloatArray

__all__ = ["Pattern", "albedos", "require_points", "require_same_channels"]


@dataclass(frozen=True, eq=False)
class Pattern(ABC):
    """An albedo that may vary over a surface. Defaults are made for −1 ≤ x, y ≤ 1."""

    name: ClassVar[str]
    summary: ClassVar[str]

    @property
    @abstractmethod
    def channels(self) -> int:
        """Number of colour channels."""

    @abstractmethod
    def evaluate(self, points: FloatArray) -> FloatArray:
        """Return the albedo at points of a surface.

        Parameters
        ----------
        points : float array (p, 3)
            Points in the surface's frame and unit; NaN and infinity give NaN [length].

        Returns
        -------
        float64 array (p, c)
            Albedo πρ, 0 … 1 [1].

        Raises
        ------
        InputError
            If points have another shape.
        """


def albedos(what: str, value: npt.ArrayLike, channels: int | None = None) -> tuple[float, ...]:
    """Return an albedo as numbers, one a channel, and refuse what is none.

    Parameters
    ----------
    what : str
        What it is, for the message.
    value : float or sequence (c,)
        Albedo πρ, 0 … 1 [1].
    channels : int, optional
        Number of channels that a single number is repeated to.

    Returns
    -------
    tuple of float
        The numbers.

    Raises
    ------
    InputError
        If one of them is outside 0 … 1, or there are none.
    """
    a = np.atleast_1d(np.asarray(value, np.float64))
    if a.ndim != 1 or not a.size or not ((a >= 0.0) & (a <= 1.0)).all():
        raise InputError(
            given=f"The {what} is {a.tolist()}.",
            needed="An albedo πρ is one number a channel, each from 0, black, to 1, all light sent back.",
            remedy="Give such numbers; a BRDF ρ is the albedo divided by π.",
        )
    return tuple(float(v) for v in (np.repeat(a, channels) if channels and a.size == 1 else a))


def require_points(points: FloatArray) -> FloatArray:
    """Return points as float64, or refuse another shape.

    Parameters
    ----------
    points : float array (p, 3)
        Points [length].

    Returns
    -------
    float64 array (p, 3)
        The same [length].

    Raises
    ------
    InputError
        If the shape is another.
    """
    p = np.asarray(points, np.float64)
    if p.ndim != 2 or p.shape[1] != 3:
        raise InputError(
            given=f"Points have the shape {p.shape}.",
            needed="One row of x, y, z for each: (p, 3).",
            remedy="Take the rows of the image under the mask, as in Geometry.points.",
        )
    return p


def require_same_channels(what: str, first: tuple[float, ...], second: tuple[float, ...]) -> None:
    """Refuse two albedos of different numbers of channels.

    Parameters
    ----------
    what : str
        The pattern they belong to, for the message.
    first, second : tuple of float
        Albedos, one number a channel [1].

    Raises
    ------
    InputError
        If the numbers of channels differ.
    """
    if len(first) != len(second):
        raise InputError(
            given=f"The two albedos of a {what} have {len(first)} and {len(second)} channels.",
            needed="They must have the same number of channels, or one.",
            remedy="Give as many numbers for both.",
        )
