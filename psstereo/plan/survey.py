"""Looking at a capture once: facts from its description, and from a bounded sample of its pixels."""

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from psstereo.camera import Orthographic
from psstereo.capture import Capture
from psstereo.lights import StrengthUnit
from psstereo.near import wants_near
from psstereo.normals.gathered import Gathered
from psstereo.normals.memory import plan_memory
from psstereo.normals.observations import may_take_part
from psstereo.plan.contestants import run_trials
from psstereo.plan.diagnosis import MotionProbe, diagnose
from psstereo.plan.evidence import colour_spread, evidence, saturated_share
from psstereo.plan.facts import Facts
from psstereo.plan.options import AUTO, Options
from psstereo.plan.sample import Sample, SamplePixels, WatchedStack, sample_pixels
from psstereo.plan.trials import Trial
from psstereo.plan.turning import turning_share
from psstereo.stack import PixelSet, colour_reading
from psstereo.types import FloatArray

__all__ = ["Watched", "describe", "survey", "watch"]

_NEARLY_WHITE = 0.98
"""Share of full scale from which a value counts as saturated."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Watched:
    """A capture whose images leave their part of the sample behind when they are decoded.

    Attributes
    ----------
    capture : Capture
        The capture, over a stack that watches.
    stack : WatchedStack
        That stack.
    where : SamplePixels
        The sample's pixels.
    """

    capture: Capture
    stack: WatchedStack
    where: SamplePixels


def watch(capture: Capture, *, motion: bool = False) -> Watched:
    """Prepare a capture for being surveyed while it is read.

    Parameters
    ----------
    capture : Capture
        The capture.
    motion : bool
        Whether a piece of each frame is kept to tell motion by.

    Returns
    -------
    Watched
        The same capture, watched.
    """
    where = sample_pixels(capture.effective_mask)
    middle = np.median(where.pixels, axis=0).astype(np.int64)
    probe = MotionProbe(len(capture.stack), (int(middle[0]), int(middle[1]))) if motion else None
    stack = WatchedStack(capture.stack, where, probe)
    return Watched(capture=replace(capture, stack=stack), stack=stack, where=where)


def describe(capture: Capture, options: Options) -> Facts:
    """Return the facts that need no image.

    Parameters
    ----------
    capture : Capture
        The capture.
    options : Options
        What is asked for.

    Returns
    -------
    Facts
        Those of rig, camera, mask, and memory.

    Raises
    ------
    InputError
        If the memory limit is too small for any tile.
    """
    import cv2

    m, h, w, c = capture.stack.shape
    mask = capture.effective_mask
    pixels = PixelSet.from_mask(mask)
    components = cv2.connectedComponents(mask[pixels.box].astype(np.uint8), connectivity=4)[0] - 1
    channels = colour_reading(options.gray, c)
    memory = plan_memory(
        capture.stack,
        pixels,
        len(channels.weights.matrix),
        options.max_memory,
        options.workers,
        undoing=(0 if capture.response.is_linear else 8)
        + 8 * ((capture.dark is not None) + (capture.flat is not None)),
        masked=options.observation_mask is not None,
        verdicts=options.verdicts,
        projected=channels.projection is not None,
    )
    return Facts(
        images=m,
        height=h,
        width=w,
        channels=c,
        bits=8 * capture.stack.dtype.itemsize,
        floating=capture.stack.dtype.kind == "f",
        saturates=capture.stack.saturates,
        pixels=len(pixels),
        components=int(components),
        perspective=not isinstance(capture.camera, Orthographic),
        linear=capture.response.is_linear,
        response=capture.response.name,
        dark_frame=capture.dark is not None,
        lamps=wants_near(capture),
        strengths_absolute=capture.rig.strength_unit is StrengthUnit.IRRADIANCE,
        sample_bytes=memory.sample_bytes,
        memory_limit=options.max_memory,
        in_memory=memory.in_memory,
        workers=options.workers,
        kept_apart=channels.values > 1,
        masked_by_hand=options.observation_mask is not None,
        **_rig_facts(capture),
    )


def _rig_facts(capture: Capture) -> dict[str, Any]:
    rig = capture.rig
    if not rig.all_distant or not len(rig):
        return {}
    directions, strengths = rig.directions, rig.strengths(capture.stack.shape[3]).mean(axis=1)
    values = np.linalg.svd(directions, compute_uv=False)
    mean = directions.sum(axis=0)
    away = np.arctan2(np.linalg.norm(np.cross(directions, mean), axis=1), directions @ mean)
    return {
        "rank": int(np.count_nonzero(values > 1e-9 * values[0])),
        "condition": rig.condition(),
        "cone_deg": float(np.degrees(away.max())),
        "tilt_deg": float(np.degrees(np.arccos(np.clip(directions[:, 2], -1, 1)).mean())),
        "strength_ratio": float(strengths.max() / strengths.min()) if strengths.min() > 0 else None,
    }


def survey(samples: Gathered, watched: Watched, facts: Facts, options: Options) -> Facts:
    """Add what a sample of the pixels shows.

    Parameters
    ----------
    samples : Gathered
        The samples of the watched capture; every image has been decoded.
    watched : Watched
        That capture.
    facts : Facts
        From :func:`describe`.
    options : Options
        What is asked for: what somebody has decided already is not looked into.

    Returns
    -------
    Facts
        With the figures of the sample.
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, user_api="blas"):  # small matrices: threads would only wait for each other
        return _survey(samples, watched, facts, options)


def _survey(samples: Gathered, watched: Watched, facts: Facts, options: Options) -> Facts:
    started = time.perf_counter()
    capture = samples.capture
    values = sample_values(samples, watched.where)
    sample = Sample.fitted(values, watched.where, capture.stack, capture.rig, raw=watched.stack.raw)
    seconds = time.perf_counter() - started
    said = evidence(sample)
    trials: tuple[Trial, ...] = ()
    ambient: tuple[float | None, float | None] = (None, None)
    if options.solver is None:
        trials, ambient = run_trials(sample, capture.rig, said, facts.pixels, options.gate)
    return replace(
        facts,
        surveyed=len(sample),
        unusable=said.unusable,
        saturated=saturated_share(sample, _NEARLY_WHITE),
        shadowed=said.shadowed,
        dark_outliers=said.dark_outliers,
        bright_outliers=said.bright_outliers,
        noise=said.noise,
        residual=said.residual,
        misfit=said.misfit,
        ambient=ambient[0],
        ambient_error=ambient[1],
        colour_spread=colour_spread(sample),
        turning=turning_share(sample) if options.integrator == AUTO else None,
        decode_seconds=float(np.median(watched.stack.seconds)),
        sample_seconds=seconds,
        trials=trials,
        findings=diagnose(sample, facts, motion=watched.stack.motion) if options.diagnose else (),
    )


def sample_values(samples: Gathered, where: SamplePixels) -> FloatArray:
    """Return the gray values of the sample's pixels, NaN where one is not usable.

    Parameters
    ----------
    samples : Gathered
        The samples of a capture, the sample's pixels among them.
    where : SamplePixels
        The sample.

    Returns
    -------
    float64 array (m, n)
        Values over strengths and full scale; the mean of the channels if they are kept apart.
    """
    flat = where.pixels[:, 0] * samples.pixels.shape[1] + where.pixels[:, 1]
    place = np.searchsorted(samples.pixels.indices, flat)
    values = np.full((samples.store.shape[0], samples.store.shape[1], len(flat)), np.nan, samples.plan.dtype)
    for start in range(0, len(samples.pixels), samples.plan.tile):
        inside = np.flatnonzero((place >= start) & (place < start + samples.plan.tile))
        if len(inside):
            stop = min(start + samples.plan.tile, len(samples.pixels))
            values[:, :, inside] = samples.store.read(start, stop)[:, :, place[inside] - start]
    if samples.mask is not None:
        values[:, ~may_take_part(samples.mask[:, flat])] = np.nan
    if samples.channels.projection is not None:
        strengths = samples.capture.rig.strengths(samples.capture.stack.shape[3])
        return samples.channels.projection(values, strengths)
    return np.asarray(values.mean(axis=0, dtype=np.float64))
