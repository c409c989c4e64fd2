"""A capture's samples, decoded once, for whatever is done with them afterwards."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from psstereo.capture import Capture
from psstereo.errors import InputError
from psstereo.normals.memory import MemoryPlan, plan_memory
from psstereo.normals.observations import checked_mask, count_left_out
from psstereo.normals.verdict import VerdictArray
from psstereo.stack import Conversion, MemoryStore, PixelSet, SampleStore, SpillStore, colour_reading, gather
from psstereo.stack.colour import ColourReading
from psstereo.types import BoolArray, FloatArray, IntArray, Map, Progress, no_progress

__all__ = ["Gathered", "Reading", "gathered"]

_NEARLY_WHITE = 0.98
"""Share of full scale from which a value counts as saturated; sensors bend before they clip."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """How images become samples.

    Attributes
    ----------
    gray, clip, valid_range, observation_mask
        As in :func:`psstereo.normals.estimate_normals`.
    saturation : bool
        Whether saturated values are left out, if no valid range is given.
    """

    gray: str | Sequence[float] = "mean"
    clip: float | None = None
    valid_range: tuple[float, float] | None = None
    observation_mask: BoolArray | VerdictArray | None = None
    saturation: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class Gathered:
    """Samples of a capture, ready to be solved.

    Attributes
    ----------
    capture : Capture
        Where they are from.
    reading : Reading
        How they were made.
    pixels : PixelSet
        The pixels under the mask.
    channels : ColourReading
        What becomes of the channels.
    valid : (float, float) or None
        Open range of raw values outside of which an observation is NaN.
    plan : MemoryPlan
        Where they wait, and in what pieces they are solved.
    store : SampleStore
        The samples (k, m, p): values over the lights' strengths and full scale.
    mask : bool or uint8 array (m, h · w) or None
        Observations that may take part, or verdicts.
    left_out : int array (m,) or None
        Observations of each image that a person left out.
    below : float array (m,) or None
        Share of each image's observations below the dark level, if there is one [1].
    seconds : float
        Time that it took [s].
    """

    capture: Capture
    reading: Reading
    pixels: PixelSet
    channels: ColourReading
    valid: tuple[float, float] | None
    plan: MemoryPlan
    store: SampleStore
    mask: BoolArray | VerdictArray | None
    left_out: IntArray | None
    below: FloatArray | None
    seconds: float


@contextmanager
def gathered(
    capture: Capture,
    reading: Reading | None = None,
    *,
    verdicts: bool = False,
    covariance: bool = False,
    max_memory: int | None = None,
    workers: int = 1,
    over: Map = map,
    progress: Progress = no_progress,
) -> Iterator[Gathered]:
    """Decode every image once and hold what the mask covers.

    Parameters
    ----------
    capture : Capture
        Images, lights, mask.
    reading : Reading, optional
        How images become samples.
    verdicts, covariance : bool
        Whether solving will tell these, which needs memory.
    max_memory : int, optional
        Bound for arrays [byte]. If the samples do not fit they wait in a temporary file.
    workers : int
        How many pieces `over` executes at the same time, for that bound.
    over : map-like
        Executes images, such as the ``map`` of a thread pool.
    progress : callable
        Told how far reading is.

    Yields
    ------
    Gathered
        The samples; they are gone when the context ends.

    Raises
    ------
    InputError
        If images are black, or do not fit each other, the mask or the observation mask.
    OptionError
        If an option's value is unknown.
    """
    how = Reading() if reading is None else reading
    started = time.perf_counter()
    pixels = PixelSet.from_mask(capture.effective_mask)
    channels = colour_reading(how.gray, capture.stack.shape[3])
    conversion = _conversion(capture, channels.weights.matrix, how)
    mask = checked_mask(how.observation_mask, capture.stack.shape[:3])
    left_out = None if mask is None else count_left_out(mask, pixels.indices)
    frames = (capture.dark is not None) + (capture.flat is not None)
    undoing = (0 if capture.response.is_linear else 8) + 8 * frames
    plan = plan_memory(
        capture.stack,
        pixels,
        len(channels.weights.matrix),
        max_memory,
        workers,
        undoing=undoing,
        masked=mask is not None,
        verdicts=verdicts,
        covariance=covariance,
        projected=channels.projection is not None,
    )
    below = None if capture.dark is None else np.zeros(len(capture.stack))
    with _store(plan) as store:
        largest = gather(capture.stack, pixels, conversion, store, below=below, over=over, progress=progress)
        _require_light(largest, capture.stack.names, None if left_out is None else left_out == len(pixels))
        yield Gathered(
            capture=capture,
            reading=how,
            pixels=pixels,
            channels=channels,
            valid=conversion.valid,
            plan=plan,
            store=store,
            mask=mask,
            left_out=left_out,
            below=below,
            seconds=time.perf_counter() - started,
        )


def _conversion(capture: Capture, matrix: FloatArray, how: Reading) -> Conversion:
    stack, valid_range = capture.stack, how.valid_range
    strengths = capture.rig.strengths(stack.shape[3])
    valid = None
    if valid_range is not None:
        low, high = valid_range
        if not low < high:
            raise InputError(
                given=f"The valid range is {low} to {high}.",
                needed="The lower end must be below the upper one.",
                remedy="Give shares of full scale such as 0.01,0.98.",
            )
        valid = (low * stack.white, high * stack.white)
    elif how.saturation and stack.saturates:
        valid = (-np.inf, _NEARLY_WHITE * stack.white)
    return Conversion(
        factors=matrix[None] / (strengths[:, None] * stack.white),
        response=capture.response,
        dark=capture.dark,
        flat=capture.flat,
        valid=valid,
        clip=how.clip,
    )


def _store(plan: MemoryPlan) -> SampleStore:
    kind = MemoryStore if plan.in_memory else SpillStore
    return kind(plan.shape, plan.dtype)


def _require_light(largest: FloatArray, names: tuple[str, ...], left_out: BoolArray | None) -> None:
    """Refuse images that hold nothing; least squares would take them for deep shadow everywhere."""
    dark = largest <= 0
    black = np.flatnonzero(dark if left_out is None else dark & ~left_out)
    if len(black) and dark.all():
        raise InputError(
            given="All images are black under the mask.",
            needed="The object must be visible.",
            remedy="Check the exposure, the mask, and that the dark image is not one of the lit ones.",
        )
    if len(black):
        raise InputError(
            given=f"The image {names[black[0]]} is black everywhere under the mask"
            + (f", and {len(black) - 1} more." if len(black) > 1 else "."),
            needed="Each light must reach some part of the object.",
            remedy="Leave it out together with its light; its flash may have failed.",
        )
