"""How captures under near lamps are solved, and what comes out."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from psstereo.depth import Integrator, Poisson
from psstereo.errors import OptionError
from psstereo.normals.exemplar import Exemplar
from psstereo.results import DepthResult, NormalsResult, Outcome

__all__ = ["REFLECTANCES", "NearOptions", "NearResult", "Round"]

REFLECTANCES = ("auto", "lambert", "exemplar")
"""What a surface under near lamps may be taken for."""


@dataclass(frozen=True, kw_only=True)
class NearOptions:
    """How a capture under near lamps is solved.

    Attributes
    ----------
    distance : float or None
        Distance of the object, or its height for an orthographic camera; it is searched for if absent, and refined in
        any case unless `hold_distance` says that it is known [length of the lamps' positions].
    hold_distance : bool
        Whether the median distance is held at `distance`: for lamps so far away that the fall-off of their light tells
        little about it.
    max_rounds : int
        Rounds at each image size: fit, integrate, move.
    tolerance : float
        Change of the logarithm of the distance (for heights: of the height over the distance to the lamps), that 95 %
        of the pixels have to stay below for
        the rounds to end [1].
    integrator : Integrator
        Method for the depth.
    gray : str or sequence of float
        How channels become one value, see :func:`psstereo.normals.estimate_normals`. With ``"per-channel"`` the
        geometry is that of the channels' mean, and each has its own albedo.
    saturation : bool
        Whether observations with a channel near full scale are left out. Those in shadow always are, by the model.
    valid_range : (float, float) or None
        Raw values, as shares of full scale, outside of which an observation is left out.
    length_unit : str or None
        Unit of the lamps' positions, such as ``"mm"``; if absent that of the camera, millimetres for
        files of lamps that have them, or ``"lamp units"``.
    reflectance : str
        What the surface is taken for: ``"lambert"``; ``"exemplar"``, a sum of matte and glossy materials where
        Lambert's law does not explain a pixel; or ``"auto"``, that only where a sample of the pixels speaks for it.
    exemplars : Exemplar
        Numbers of the fit of these materials; its gate has no part in it.
    max_memory : int or None
        Bound for the samples; they wait in a temporary file beyond it [byte].
    workers : int
        Blocks that are solved at the same time.

    Raises
    ------
    OptionError
        If a number is out of its range.
    """

    distance: float | None = None
    hold_distance: bool = False
    max_rounds: int = 40
    tolerance: float = 1e-4
    integrator: Integrator = field(default_factory=Poisson)
    gray: str | Sequence[float] = "mean"
    saturation: bool = True
    valid_range: tuple[float, float] | None = None
    length_unit: str | None = None
    reflectance: str = "auto"
    exemplars: Exemplar = field(default_factory=Exemplar)
    max_memory: int | None = None
    workers: int = 1

    def __post_init__(self) -> None:
        if self.distance is not None and not math.isfinite(self.distance):
            raise OptionError(
                given=f"The distance is {self.distance}.",
                needed="It must be a finite length, in the unit of the lamps' positions.",
                remedy="Leave it out to have it searched for.",
            )
        if self.hold_distance and self.distance is None:
            raise OptionError(
                given="The distance is to be held, but none is given.",
                needed="A known distance is a number.",
                remedy="Give the distance, or let it be found.",
            )
        if self.reflectance not in REFLECTANCES:
            raise OptionError(
                given=f"The reflectance is {self.reflectance!r}.",
                needed=f"One of {', '.join(REFLECTANCES)}.",
                remedy="Leave it out to have it chosen by what the images show.",
            )
        if not (self.max_rounds >= 1 and 0 < self.tolerance < 1):
            raise OptionError(
                given=f"The limit is {self.max_rounds} rounds, the tolerance {self.tolerance}.",
                needed="At least one round, and a tolerance above 0 and below 1.",
                remedy="Leave them out to use 40 and 1e-4.",
            )


@dataclass(frozen=True, kw_only=True)
class Round:
    """One round of the alternation, for the record.

    Attributes
    ----------
    factor : int
        Side of the pixels it worked on, in pixels of the image [px].
    energy : float
        Mean loss of the usable observations, between 0 and 1 [1].
    distance : float
        Median distance, or height [length].
    change : float
        Change of the logarithm of the distance, or of the height over the distance to the lamps, that 95 % of the
        pixels stay below [1].
    reflectance : str
        What the surface was taken for.
    """

    factor: int
    energy: float
    distance: float
    change: float
    reflectance: str = "lambert"


@dataclass(frozen=True, kw_only=True, eq=False)
class NearResult:
    """Normals and metric depth.

    Attributes
    ----------
    normals : NormalsResult
        Normals, albedo, uncertainty, flags.
    depth : DepthResult
        Depth in the unit of the lamps' positions.
    rounds : tuple of Round
        What the iteration went through.
    facts : mapping
        Plain figures for the record.
    """

    normals: NormalsResult
    depth: DepthResult
    rounds: tuple[Round, ...]
    facts: Mapping[str, Any]

    @property
    def converged(self) -> bool:
        """Whether the iteration met its tolerance."""
        return Outcome.NOT_CONVERGED not in (self.normals.outcome, self.depth.outcome)
