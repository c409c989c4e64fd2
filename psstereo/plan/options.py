"""What is asked for, and the whole answer."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from psstereo.depth import Integrator, Prior
from psstereo.normals import Gate, NormalSolver
from psstereo.normals.light_choice import LightChoice
from psstereo.normals.strength_choice import StrengthChoice
from psstereo.normals.views import SampleViews
from psstereo.results import DepthResult, NormalsResult, Outcome, Step
from psstereo.surface_mesh import SurfaceMesh
from psstereo.types import BoolArray
from psstereo.verdict import VerdictArray

if TYPE_CHECKING:
    from psstereo.plan.plan import Plan

__all__ = ["AUTO", "Options", "Reconstruction"]

AUTO: Literal["auto"] = "auto"
"""Word for "decide by what the capture shows"."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """How a capture is reconstructed.

    Attributes
    ----------
    solver : NormalSolver or None
        Method for the normals; the plan chooses one by what a sample of the capture shows if absent.
    gate : Gate or None
        Which observations are left out, instead of what the solver has for its gate.
    integrator : Integrator, "auto" or None
        Method for the depth; ``"auto"`` lets the plan choose between plain and discontinuity-preserving integration,
        None leaves depth and mesh out.
    lights : LightChoice
        Whose directions of the lights are taken: those given, refined ones, or those that the images tell.
    strengths : StrengthChoice
        Whose strengths of the lights are taken.
    distance : float or None
        Where the search for the object's distance begins, under near lamps; anywhere if absent [length of the lamps'
        positions].
    prior : Prior or None
        Depth known beforehand, to be fused with the normals.
    nothing_left_out : bool
        Whether every stage that applies is done, needed or not: to see that what the plan leaves out changes nothing.
    diagnose : bool
        Whether to look for what is wrong with the capture; the plan's facts then have the findings.
    views : bool
        Whether to keep small images and residuals, for a report.
    gray, clip, valid_range, observation_mask, verdicts, max_memory, workers
        As in :func:`psstereo.normals.estimate_normals`.
    """

    solver: NormalSolver[Any] | None = None
    gate: Gate | None = None
    integrator: Integrator | Literal["auto"] | None = AUTO
    lights: LightChoice = field(default_factory=LightChoice)
    strengths: StrengthChoice = StrengthChoice.GIVEN
    gray: str | Sequence[float] = "mean"
    clip: float | None = None
    valid_range: tuple[float, float] | None = None
    observation_mask: BoolArray | VerdictArray | None = None
    verdicts: bool = False
    distance: float | None = None
    prior: Prior | None = None
    nothing_left_out: bool = False
    diagnose: bool = False
    views: bool = False
    max_memory: int | None = None
    workers: int = 1


@dataclass(frozen=True, kw_only=True, eq=False)
class Reconstruction:
    """The whole answer.

    Attributes
    ----------
    normals : NormalsResult
        Normals, albedo, uncertainty, flags.
    depth : DepthResult or None
        Depth, if it was wanted.
    mesh : SurfaceMesh or None
        Its triangles.
    steps : tuple of Step
        What was done and what was left out.
    plan : Plan
        What was decided, and the facts that it rests on.
    views : SampleViews or None
        Small images and residuals, if asked for; never under near lamps.
    """

    normals: NormalsResult
    depth: DepthResult | None
    mesh: SurfaceMesh | None
    steps: tuple[Step, ...]
    plan: "Plan"
    views: SampleViews | None = None

    @property
    def converged(self) -> bool:
        """Whether every iteration met its tolerance."""
        outcomes = [self.normals.outcome] + ([self.depth.outcome] if self.depth else [])
        return Outcome.NOT_CONVERGED not in outcomes
