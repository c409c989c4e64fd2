"""Whose directions of the lights a reconstruction takes: those given, refined ones, or those that the images tell."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import Any

import numpy as np

from psstereo.capture import Capture
from psstereo.errors import OptionError
from psstereo.normals.refine_lights import RefineHealth, RefineOptions, refine_lights
from psstereo.normals.uncalibrated import UncalibratedHealth, UncalibratedOptions, find_lights
from psstereo.results import Outcome, Step
from psstereo.stack import PER_CHANNEL
from psstereo.types import Map, Progress, no_progress

__all__ = ["ChosenLights", "LightChoice", "LightSource", "choose_lights"]

_ANGLES = {"disagreement", "expected_error"}


class LightSource(Enum):
    """Where directions of lights come from."""

    GIVEN = "given"
    REFINED = "refine"
    UNKNOWN = "unknown"


@dataclass(frozen=True, kw_only=True)
class LightChoice:
    """Whose lights, and how they are found.

    Attributes
    ----------
    source : LightSource
        Where directions come from.
    ambiguity : str or None
        What resolves the bas-relief ambiguity of unknown lights; see
        :class:`psstereo.normals.uncalibrated.UncalibratedOptions`, whose default is taken if absent.
    relief : str or None
        Which of the two surfaces unknown lights may show; likewise.
    doubt : float or None
        How far given lights may be off that are to be refined; the default of
        :class:`psstereo.normals.refine_lights.RefineOptions` if absent [rad].

    Raises
    ------
    OptionError
        If an option belongs to another source.
    """

    source: LightSource = LightSource.GIVEN
    ambiguity: str | None = None
    relief: str | None = None
    doubt: float | None = None

    def __post_init__(self) -> None:
        stray = [name for name in ("ambiguity", "relief") if getattr(self, name) is not None]
        wanted = LightSource.UNKNOWN
        if not stray or self.source is LightSource.UNKNOWN:
            stray, wanted = ["doubt"] if self.doubt is not None else [], LightSource.REFINED
        if stray and self.source is not wanted:
            raise OptionError(
                given=f"The option {stray[0]} was given, and lights are {self.source.value}.",
                needed=f"It belongs to lights that are {wanted.value}.",
                remedy=f"Leave it out, or use --lights {wanted.value}.",
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class ChosenLights:
    """A capture under the lights that were chosen.

    Attributes
    ----------
    capture : Capture
        Under these lights.
    steps : tuple of Step
        What was done; empty for given lights.
    facts : mapping
        Plain figures for the record; empty for given lights.
    settled : bool
        Whether the search settled.
    """

    capture: Capture
    steps: tuple[Step, ...] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)
    settled: bool = True


def choose_lights(
    capture: Capture,
    choice: LightChoice,
    *,
    gray: str | Sequence[float] = "mean",
    valid_range: tuple[float, float] | None = None,
    over: Map = map,
    progress: Progress = no_progress,
) -> ChosenLights:
    """Return a capture under the lights that are wanted, so that every solver for known lights can follow.

    Parameters
    ----------
    capture : Capture
        Images and given lights.
    choice : LightChoice
        Whose lights.
    gray : str or sequence of float
        How channels become one value; their mean where each channel is solved on its own.
    valid_range : (float, float), optional
        Raw values, as shares of full scale, outside of which an observation is left out.
    over : map-like
        Executes the images.
    progress : callable
        Told how far it is.

    Returns
    -------
    ChosenLights
        The capture, and what was done.

    Raises
    ------
    PsstereoError
        See :func:`psstereo.normals.uncalibrated.find_lights` and
        :func:`psstereo.normals.refine_lights.refine_lights`.
    """
    if choice.source is LightSource.GIVEN:
        return ChosenLights(capture=capture)
    common: dict[str, Any] = {"gray": "mean" if gray == PER_CHANNEL else gray, "valid_range": valid_range}
    if choice.source is LightSource.REFINED:
        doubt: dict[str, Any] = {} if choice.doubt is None else {"doubt": choice.doubt}
        refined = refine_lights(capture, RefineOptions(**common, **doubt), over=over, progress=progress)
        facts = {
            "changed": refined.changed,
            "moved_deg": np.degrees(refined.moved).tolist(),
            **_health(refined.health),
            **_rig(refined.capture),
        }
        return _chosen(refined.capture, refined.step, "lights_refined", facts, refined.outcome)
    words = {name: value for name in ("ambiguity", "relief") if (value := getattr(choice, name)) is not None}
    options = UncalibratedOptions(**common, **words)
    found = find_lights(capture, options, over=over, progress=progress)
    facts = {
        "ambiguity": options.ambiguity,
        "relief": options.relief,
        **_health(found.health),
        **_rig(found.capture),
        "alternative_directions": found.alternative.directions.tolist(),
    }
    return _chosen(found.capture, found.step, "lights_found", facts, found.outcome)


def _chosen(capture: Capture, step: Step, name: str, facts: dict[str, Any], outcome: Outcome) -> ChosenLights:
    return ChosenLights(capture=capture, steps=(step,), facts={name: facts}, settled=outcome.converged)


def _health(health: UncalibratedHealth | RefineHealth) -> dict[str, Any]:
    """Return figures as plain values, angles in degrees under names that say so."""
    plain = asdict(health)
    for name in _ANGLES & plain.keys():
        plain[f"{name}_deg"] = float(np.degrees(plain.pop(name)))
    return plain


def _rig(capture: Capture) -> dict[str, Any]:
    strengths = capture.rig.strengths(capture.stack.shape[3])
    return {"directions": capture.rig.directions.tolist(), "strengths": strengths.tolist()}
