"""Whose strengths of the lights are taken: the given ones, equal ones, or those that the images tell."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from enum import Enum
from typing import Any

import numpy as np

from psstereo.capture import Capture
from psstereo.errors import InputError
from psstereo.lights import Rig, StrengthUnit
from psstereo.normals.strengths import StrengthEstimate, estimate_strengths
from psstereo.normals.verdict import VerdictArray
from psstereo.results import Outcome, Step
from psstereo.types import BoolArray, Map, Progress, no_progress

__all__ = ["ChosenStrengths", "StrengthChoice", "choose_strengths"]

_STEP = "light strengths"
_DISAGREES = 3.0
"""Departure from what the images tell, over their expected error, from which a given strength is named."""
_ALWAYS_FINE = 0.02
"""Departure below which it never is."""
_NAMED = 6
"""Lights named at most."""


class StrengthChoice(Enum):
    """Where the strengths of lights come from; the values are the words of the command."""

    GIVEN = "given"
    """From the capture; equal if it has none."""
    CHECKED = "checked"
    """From the capture, and compared with what the images tell."""
    EQUAL = "equal"
    """All the same, whatever the capture says."""
    UNKNOWN = "unknown"
    """From the images; those of the capture say how a light's channels are balanced."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ChosenStrengths:
    """A capture with the strengths to use.

    Attributes
    ----------
    capture : Capture
        The capture, its rig with these strengths.
    step : Step
        What was done, with figures.
    facts : mapping
        The figures as plain data for the record; empty if the images were not asked.
    settled : bool
        False if strengths are used whose iteration did not settle.
    """

    capture: Capture
    step: Step
    facts: Mapping[str, Any] = field(default_factory=dict)
    settled: bool = True


def choose_strengths(
    capture: Capture,
    choice: StrengthChoice,
    *,
    gray: str | Sequence[float] = "mean",
    valid_range: tuple[float, float] | None = None,
    observation_mask: BoolArray | VerdictArray | None = None,
    over: Map = map,
    progress: Progress = no_progress,
) -> ChosenStrengths:
    """Give a capture the strengths that were asked for.

    Parameters
    ----------
    capture : Capture
        Images and lights.
    choice : StrengthChoice
        Whose strengths.
    gray, valid_range, observation_mask, over, progress
        As in :func:`psstereo.normals.strengths.estimate_strengths`.

    Returns
    -------
    ChosenStrengths
        The capture to solve. The given strengths are never changed by checking them, and where the images do not tell
        any, the check says so and the run goes on.

    Raises
    ------
    RigError, InputError, UnsupportedError
        If the strengths are unknown and cannot be told; see :func:`psstereo.normals.strengths.estimate_strengths`.
    """
    if choice is StrengthChoice.GIVEN:
        return ChosenStrengths(capture=capture, step=_left("The strengths of the capture were taken as they are."))
    if choice is StrengthChoice.EQUAL:
        unit, source = StrengthUnit.RELATIVE, f"{capture.rig.source}, strengths taken as equal"
        rig = Rig.distant(capture.rig.directions, strength_unit=unit, source=source)
        step = Step(name=_STEP, done=True, reason="All lights were taken as equally strong.")
        return ChosenStrengths(capture=replace(capture, rig=rig), step=step)
    started = time.perf_counter()
    try:
        found = estimate_strengths(
            capture,
            gray=gray,
            valid_range=valid_range,
            observation_mask=observation_mask,
            over=over,
            progress=progress,
        )
    except InputError as error:
        if choice is StrengthChoice.UNKNOWN:
            raise
        reason = f"The strengths of the capture were taken and could not be checked. {error.given}"
        return ChosenStrengths(capture=capture, step=_left(reason, time.perf_counter() - started))
    facts = {"light_strengths": _facts(found, choice)}
    if choice is StrengthChoice.UNKNOWN:
        settled = found.outcome is not Outcome.NOT_CONVERGED
        return ChosenStrengths(capture=found.capture, step=found.step, facts=facts, settled=settled)
    step = Step(name=_STEP, done=True, reason=_comparison(found), seconds=time.perf_counter() - started)
    return ChosenStrengths(capture=capture, step=step, facts=facts)


def _left(reason: str, seconds: float = 0.0) -> Step:
    return Step(name=_STEP, done=False, reason=reason, seconds=seconds)


def _facts(found: StrengthEstimate, choice: StrengthChoice) -> dict[str, Any]:
    return {
        "choice": choice.value,
        "factors": found.strengths.tolist(),
        "rounds": found.rounds,
        "outcome": found.outcome.name.lower(),
        **asdict(found.health),
    }


def _comparison(found: StrengthEstimate) -> str:
    """Say which given strengths disagree with the images, and by how much."""
    departures = found.departures.reshape(len(found.rig), -1)
    size = np.abs(departures).max(axis=1)
    expected = found.health.expected_error
    limit = max(_ALWAYS_FINE, _DISAGREES * expected)
    known = f"which tell them within {100 * expected:.2g} %"
    worst = np.argsort(-size, kind="stable")
    named = [int(i) for i in worst[:_NAMED] if size[i] > limit]
    if not named:
        return (
            f"The strengths of the capture agree with the images, {known}: {100 * size[worst[0]]:.2g} % at most, at "
            f"light {worst[0] + 1}."
        )
    parts = [f"light {i + 1} by {_signed(departures[i])}" for i in named]
    more = int(np.count_nonzero(size > limit)) - len(named)
    rest = f" and {more} more" if more > 0 else ""
    return (
        f"The strengths of the capture disagree with the images, {known}: {', '.join(parts)}{rest}. A wrong direction "
        "can look like that too."
    )


def _signed(departure: Any) -> str:
    return f"{100 * float(departure[np.abs(departure).argmax()]):+.2g} %"
