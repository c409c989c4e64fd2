"""The interface of normal solvers.

A solver is a frozen value of options. :meth:`NormalSolver.prepare` does once what all pixels share, and
:meth:`NormalSolver.solve` works on any set of pixels without side effects, so that tiles, threads and clusters are an
argument of whoever calls it and never a second copy of a solver.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, TypeVar

from psstereo.errors import RigError
from psstereo.lights import Rig
from psstereo.normals.gate import GATES, Gate
from psstereo.normals.verdict import VerdictArray
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
    verdicts : bool
        Whether the solver is to say what it made of each observation.
    covariance : bool
        Whether the solver is to tell the covariance of its error.
    """

    values: FloatArray
    weights: FloatArray | None = None
    verdicts: bool = False
    covariance: bool = False


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
    covariance : float64 array (p, 6) or None
        Covariance of the unit normal's error, entries xx, xy, yy, xz, yz, zz, if that was asked for; it has no part
        along the normal, and its trace is the square of `uncertainty` [rad²].
    verdicts : uint8 array (m, p) or None
        What was made of each observation, if that was asked for; see :class:`psstereo.normals.verdict.Verdict`.
    ambient : float64 array (p,) or None
        What each pixel shows without any of the lights, in the unit of its brightness over light strength, from solvers
        that tell it; NaN where the normal is.
    """

    scaled: FloatArray
    uncertainty: FloatArray
    flags: FlagArray
    used: FlagArray
    covariance: FloatArray | None = None
    verdicts: VerdictArray | None = None
    ambient: FloatArray | None = None


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
    assumes: ClassVar[str]
    """What has to be true of the surface, as a clause."""
    avoid: ClassVar[str]
    """When not to use it, as a clause."""
    least_lights: ClassVar[int] = 3
    """Lights below which it refuses: with fewer a flexible model follows the noise, or has more unknowns than data."""
    unknowns: ClassVar[int] = 3
    """Numbers that a pixel's observations have to tell: a normal and an albedo, and what else there is."""
    sees_the_eye: ClassVar[bool] = False
    """Whether its model depends on the direction toward the camera, so that turning the scene is not for free."""
    pays_from: ClassVar[int] = 3
    """Lights from which it is better than plain least squares where its assumption holds."""
    gate: Gate = field(default_factory=lambda: GATES["auto"], metadata={"choices": GATES})

    @property
    def learns_from(self) -> int:
        """How many pixels of an object it wants to see before it solves any; 0 if pixels have nothing in common."""
        return 0

    def taught(self, rig: Rig, samples: "Samples", pixels: int | None = None) -> tuple["NormalSolver[Any]", str]:
        """Return the solver for one object, and a sentence on what was learnt of it.

        Parameters
        ----------
        rig : Rig
            The lights.
        samples : Samples
            Observations of some of the object's pixels, from all over it.
        pixels : int, optional
            How many the object has in all: whether compiled code pays [1].

        Returns
        -------
        NormalSolver
            Itself, if there was nothing to learn.
        str
            What was learnt, or why nothing.
        """
        del rig, samples, pixels
        return self, "Pixels are solved one by one."

    def require_lights(self, rig: Rig) -> None:
        """Refuse a rig with too few lights for this method, or with directions that cannot give normals.

        Raises
        ------
        RigError
            With the methods that would serve.
        """
        rig.require_spanning()
        if len(rig) < self.least_lights:
            raise RigError(
                given=f"There are {len(rig)} lights.",
                needed=f"The solver {self.name} needs {self.least_lights} or more.",
                remedy="Use the solver least-squares, from eight lights on the solver robust, or take more images.",
            )

    @abstractmethod
    def prepare(self, rig: Rig, pixels: int | None = None) -> StateT:
        """Do once what all pixels share.

        Parameters
        ----------
        rig : Rig
            The lights.
        pixels : int, optional
            How many pixels will be solved in all: little work is not worth loading compiled code for. Not known if
            absent, and taken for little.

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
