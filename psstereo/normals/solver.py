"""The interface of normal solvers.

A solver is a frozen value of options. :meth:`NormalSolver.prepare` does once what all pixels share, and
:meth:`NormalSolver.solve` works on any set of pixels without side effects, so that tiles, threads and clusters are an
argument of whoever calls it and never a second copy of a solver.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar, Generic, TypeVar

from psstereo.lights import Rig
from psstereo.normals.gate import GATES, Gate
from psstereo.types import FlagArray, FloatArray

__all__ = ["NormalSolver", "PixelNormals", "Samples"]

StateT = TypeVar("StateT")


@dataclass(frozen=True, eq=False)
class Samples:
    """Observations of some pixels.

    Attributes
    ----------
    values : float array (m, p)
        Linear brightness divided by the light's strength; NaN where an observation is not usable.
    weights : float array (m, p) or None
        Non-negative weights, the inverse variances up to a factor; all 1 if absent. Zero leaves an observation out.
    """

    values: FloatArray
    weights: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class PixelNormals:
    """What a solver found at some pixels.

    Attributes
    ----------
    scaled : float64 array (p, 3)
        Albedo times unit normal; NaN where a fatal flag stands.
    uncertainty : float64 array (p,)
        Root-mean-square angle of the normal's error predicted from the residual; NaN where it cannot be told [rad].
    flags : uint16 array (p,)
        Bits of :class:`psstereo.flags.Flag`.
    used : int array (p,)
        Observations used.
    """

    scaled: FloatArray
    uncertainty: FloatArray
    flags: FlagArray
    used: FlagArray


@dataclass(frozen=True, kw_only=True)
class NormalSolver(ABC, Generic[StateT]):
    """A method that turns brightness under known lights into normals.

    Attributes
    ----------
    gate : Gate
        Which observations are left out.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    gate: Gate = field(default_factory=lambda: GATES["auto"])

    @abstractmethod
    def prepare(self, rig: Rig) -> StateT:
        """Do once what all pixels share.

        Parameters
        ----------
        rig : Rig
            The lights.

        Raises
        ------
        RigError
            If the lights cannot give normals.
        UnsupportedError
            If this method does not work with such lights.
        """

    @abstractmethod
    def solve(self, state: StateT, samples: Samples) -> PixelNormals:
        """Solve some pixels; pure, so that any split of the pixels gives the same numbers."""
