"""Strengths and directions of lights from the object itself, when there was no target."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psstereo.capture import Capture
from psstereo.errors import OptionError
from psstereo.io.rig_file import RigQuality
from psstereo.lights import Rig
from psstereo.normals.refine_lights import LightsRefined, RefineOptions, refine_lights
from psstereo.normals.strengths import StrengthEstimate, estimate_strengths
from psstereo.types import FloatArray, Map, Progress, no_progress

__all__ = ["ObjectCalibration", "calibrate_from_object"]


@dataclass(frozen=True, kw_only=True, eq=False)
class ObjectCalibration:
    """Lights that the object tells.

    Attributes
    ----------
    rig : Rig
        The lights.
    quality : RigQuality
        How far to trust them: one expected error for all, since the object tells no more.
    strengths : StrengthEstimate or None
        What was found of strengths, if they were asked for.
    directions : LightsRefined or None
        What was found of directions, if they were asked for.
    """

    rig: Rig
    quality: RigQuality
    strengths: StrengthEstimate | None
    directions: LightsRefined | None


def calibrate_from_object(
    capture: Capture,
    *,
    strengths: bool = True,
    directions: bool = False,
    doubt: float = float(np.radians(3.0)),
    gray: str | Sequence[float] = "mean",
    valid_range: tuple[float, float] | None = None,
    over: Map = map,
    progress: Progress = no_progress,
) -> ObjectCalibration:
    """Find strengths of lights, and refine their directions, from the images of an object of unknown shape.

    Not in place of a target where one can be had: what the surface does that is not matte goes into the lights, and a
    rig found from one object is only as good as that object. Flat objects are refused.

    Parameters
    ----------
    capture : Capture
        Images and nominal lights.
    strengths : bool
        Whether strengths are found.
    directions : bool
        Whether directions are refined, after the strengths.
    doubt : float
        How far nominal directions may be off, as a standard deviation [rad].
    gray : str or sequence of float
        How channels become one value.
    valid_range : (float, float), optional
        Raw values, as shares of full scale, outside of which an observation is left out [1].
    over : map-like
        Executes the images.
    progress : callable
        Told how far it is.

    Returns
    -------
    ObjectCalibration
        Rig and quality.

    Raises
    ------
    OptionError
        If neither is wanted.
    PsstereoError
        See :func:`psstereo.normals.strengths.estimate_strengths` and
        :func:`psstereo.normals.refine_lights.refine_lights`.
    """
    if not (strengths or directions):
        raise OptionError(
            given="Neither strengths nor directions are to be found.",
            needed="At least one of the two.",
            remedy="Leave strengths on, or ask for directions.",
        )
    told, refined = None, None
    if strengths:
        told = estimate_strengths(capture, gray=gray, valid_range=valid_range, over=over, progress=progress)
        capture = told.capture
    if directions:
        options = RefineOptions(doubt=doubt, gray=gray, valid_range=valid_range)
        refined = refine_lights(capture, options, over=over, progress=progress)
        capture = refined.capture
    return ObjectCalibration(
        rig=capture.rig, quality=_quality(len(capture.rig), told, refined), strengths=told, directions=refined
    )


def _quality(count: int, told: StrengthEstimate | None, refined: LightsRefined | None) -> RigQuality:
    said, advice = [], []
    strength_error: FloatArray | None = None
    direction_error: FloatArray | None = None
    residual = residual_angle = None
    if told is not None:
        strength_error = np.full(count, told.health.expected_error)
        residual = told.health.spread_after
        said.append(f"strengths to {100 * told.health.expected_error:.2g} %")
        if told.health.expected_error > 0.05:
            advice.append("Measure strengths with a white card: this object tells them to worse than 5 %.")
        if not told.outcome.converged:
            advice.append("The search for strengths did not settle: do not rely on them without a look at the result.")
    if refined is not None:
        direction_error = np.full(count, refined.health.expected_error)
        residual, residual_angle = refined.health.spread_after, refined.health.disagreement
        done = "refined" if refined.changed else "left as they were"
        said.append(f"directions {done}, to {np.degrees(refined.health.expected_error):.2g}°")
        if refined.health.expected_error > np.radians(2.0):
            advice.append("Photograph a ball: this object is not matte or not round enough for directions.")
    advice.append(
        "A rig from one object carries that object's gloss and interreflection into the next: a ball does not."
    )
    return RigQuality(
        direction_error=direction_error,
        strength_error=strength_error,
        residual_angle=residual_angle,
        residual_brightness=residual,
        verdict=f"{count} lights from the object itself: {', '.join(said)} (expected errors).",
        advice=tuple(advice),
    )
