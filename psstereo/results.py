"""What a solver hands back: plain frozen data, with an outcome that is a sentence."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from psstereo.types import FlagArray, FloatArray, IntArray
from psstereo.verdict import VerdictArray

__all__ = ["AlbedoKind", "DepthKind", "DepthResult", "NormalsResult", "Outcome", "Step"]


class Outcome(Enum):
    """How a computation ended; the values are sentences for a person, cause first, then what to try."""

    SOLVED = "The solution was found."
    PARTIAL = (
        "Some pixels could not be solved; the flags say why for each. Add lights or widen the mask's distance from "
        "shadows if too much is missing."
    )
    NOT_CONVERGED = (
        "The iteration stopped at its limit before the tolerance was met. Raise the iteration limit, or accept the "
        "residual that is reported."
    )

    @property
    def converged(self) -> bool:
        """Whether the result may be used without a caveat about convergence."""
        return self is not Outcome.NOT_CONVERGED


class AlbedoKind(Enum):
    """What the numbers of an albedo map mean."""

    RELATIVE = "relative"
    """Proportional to the reflectance; the factor is unknown because radiances are not."""
    REFLECTANCE = "reflectance"
    """The share of light that is reflected, πρ [1]; pixel values and lights are in absolute units."""


class DepthKind(Enum):
    """What the numbers of a depth map mean."""

    HEIGHT = "height"
    """Orthographic: z, growing toward the camera."""
    DISTANCE = "distance"
    """Pinhole: positive distance along the optical axis."""


@dataclass(frozen=True, kw_only=True, eq=False)
class NormalsResult:
    """Normals and what belongs to them.

    Attributes
    ----------
    normals : float array (h, w, 3)
        Unit normals, x right, y up, z toward the camera; NaN where not recovered [1].
    albedo : float array (h, w) or (h, w, c)
        Albedo; NaN where not recovered. `albedo_kind` says whether it is relative or πρ [1].
    uncertainty : float array (h, w)
        Root-mean-square angle between the true and the estimated normal that the residual predicts; NaN where it
        cannot be told [rad].
    flags : uint16 array (h, w)
        Bits of :class:`psstereo.flags.Flag`.
    albedo_kind : AlbedoKind
        Meaning of the albedo's numbers.
    outcome : Outcome
        How the computation ended.
    facts : mapping
        Plain figures for the record: options used, light conditioning, counts, what was left out.
    seconds : mapping
        Wall-clock seconds by stage [s].
    verdicts : uint8 array (m, h, w) or None
        What was made of each observation, :class:`psstereo.verdict.Verdict`, and 255 outside the mask; if asked for.
    covariance : float array (h, w, 6) or None
        Covariance of the normal's error, entries xx, xy, yy, xz, yz, zz, without a part along the normal; its trace is
        the square of `uncertainty`, and NaN stands where that does. If asked for [rad²].
    used : float array (h, w) or None
        Observations that the covariance rests on: with three unknowns its variance has ``used − 3`` degrees of
        freedom. For several channels an equivalent number, not whole. NaN outside the mask. Beside `covariance` [1].
    """

    normals: FloatArray
    albedo: FloatArray
    uncertainty: FloatArray
    flags: FlagArray
    albedo_kind: AlbedoKind = AlbedoKind.RELATIVE
    outcome: Outcome = Outcome.SOLVED
    facts: Mapping[str, Any] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)
    verdicts: VerdictArray | None = None
    covariance: FloatArray | None = None
    used: FloatArray | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthResult:
    """A depth map and what belongs to it.

    Attributes
    ----------
    depth : float array (h, w)
        Height toward the camera or distance along the optical axis, see `kind`; NaN outside.
    kind : DepthKind
        Meaning of the numbers.
    unit : str
        ``"px"``, ``"mm"`` or another length; ``"relative"`` where a pinhole depth has a free scale.
    components : int array (h, w)
        Connected component of each pixel, from 1; 0 outside. Each component has a free constant (orthographic) or a
        free scale (pinhole) of its own.
    iterations : int
        Iterations of the linear solver.
    residual : float
        Relative residual reached [1].
    outcome : Outcome
        How the computation ended.
    facts : mapping
        Plain figures for the record.
    """

    depth: FloatArray
    kind: DepthKind
    unit: str
    components: IntArray
    iterations: int
    residual: float
    outcome: Outcome = Outcome.SOLVED
    facts: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Step:
    """One step of a run.

    Attributes
    ----------
    name : str
        What it is.
    done : bool
        Whether it was done rather than left out.
    reason : str
        Why, as a sentence.
    seconds : float
        Time it took, 0 if left out [s].
    """

    name: str
    done: bool
    reason: str
    seconds: float = 0.0
