"""From a capture to normals and albedo: read once, solve in blocks, put the answer together.

Pixels are solved in blocks of a fixed number, counted from the first pixel of the mask. Threads and tiles only decide
who solves which block and when, so the answer is the same to the last bit for any number of either.
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from psstereo.capture import Capture
from psstereo.errors import InputError
from psstereo.flags import Flag, fatal_mask
from psstereo.lights import StrengthUnit
from psstereo.method_options import settings_of
from psstereo.normals.blocks import Answer, BlockJob, solve_blocks
from psstereo.normals.default import default_solver
from psstereo.normals.gathered import Gathered, Reading, gathered
from psstereo.normals.moments import widening
from psstereo.normals.rounding import rounding_of
from psstereo.normals.solver import NormalSolver
from psstereo.normals.verdict import VerdictArray
from psstereo.results import AlbedoKind, NormalsResult, Outcome
from psstereo.stack import PixelSet
from psstereo.types import BoolArray, FloatArray, Map, Progress, no_progress

__all__ = ["estimate_normals", "solve_gathered"]

_LOOSE = 30.0
"""Condition of the lights from which error bars to first order are not enough [1]."""


def estimate_normals(
    capture: Capture,
    solver: NormalSolver[Any] | None = None,
    *,
    gray: str | Sequence[float] = "mean",
    clip: float | None = None,
    valid_range: tuple[float, float] | None = None,
    weights: FloatArray | None = None,
    observation_mask: BoolArray | VerdictArray | None = None,
    verdicts: bool = False,
    covariance: bool = False,
    max_memory: int | None = None,
    workers: int = 1,
    over: Map = map,
    progress: Progress = no_progress,
) -> NormalsResult:
    """Recover normals and albedo from a capture.

    Parameters
    ----------
    capture : Capture
        Images, lights, mask.
    solver : NormalSolver, optional
        The method; :func:`psstereo.normals.default_solver` chooses if absent.
    gray : str or sequence of float
        How channels become one value, a name in :data:`psstereo.stack.COLOUR_CHOICES` or one weight a channel. With
        ``"per-channel"`` every channel is solved and the albedo has channels.
    clip : float, optional
        Upper bound put on brightness over light strength, as published baselines do.
    valid_range : (float, float), optional
        Raw values, as shares of full scale, outside of which an observation is left out. From the solver's gate if
        absent: below 0.98 where saturated values are left out and the images have a full scale.
    weights : float array (m, h, w), optional
        Weights of the observations, inverse variances up to a factor; zero leaves one out.
    observation_mask : bool or uint8 array (m, h, w), optional
        Observations that a person leaves out: False where one may not take part. Or verdicts, of an earlier result and
        edited perhaps: USED and NOT_NEEDED may take part, everything else may not. Their verdict becomes UNUSABLE.
    verdicts : bool
        Whether to tell what was made of each observation; one byte each.
    covariance : bool
        Whether to tell the covariance of each normal's error, and on how many observations it rests.
    max_memory : int, optional
        Bound for arrays [byte]. If the samples do not fit they wait in a temporary file.
    workers : int
        How many pieces `over` executes at the same time, for that bound.
    over : map-like
        Executes images and blocks, such as the ``map`` of a thread pool.
    progress : callable
        Told how far reading and solving are.

    Returns
    -------
    NormalsResult
        Normals, albedo, uncertainty and flags, and what else was asked for; float64 for float64 images, float32
        otherwise. Where images are integers the uncertainty is never less than what rounding to them does.

    Raises
    ------
    RigError
        If the lights cannot give normals.
    UnsupportedError
        If the solver does not work with such lights, or does not tell what is asked for.
    InputError
        If images are black, or do not fit each other, the mask, the weights or the observation mask.
    OptionError
        If an option's value is unknown.
    """
    method = default_solver(capture.rig).solver if solver is None else solver
    method.prepare(capture.rig)  # before anything is decoded: a bad rig is told at once
    reading = Reading(
        gray=gray,
        clip=clip,
        valid_range=valid_range,
        observation_mask=observation_mask,
        saturation=method.gate.saturation,
    )
    flat = _flat_weights(weights, capture)
    with gathered(
        capture,
        reading,
        verdicts=verdicts,
        covariance=covariance,
        max_memory=max_memory,
        workers=workers,
        over=over,
        progress=progress,
    ) as samples:
        return solve_gathered(
            samples, method, weights=flat, verdicts=verdicts, covariance=covariance, over=over, progress=progress
        )


def solve_gathered(
    samples: Gathered,
    solver: NormalSolver[Any],
    *,
    weights: FloatArray | None = None,
    verdicts: bool = False,
    covariance: bool = False,
    over: Map = map,
    progress: Progress = no_progress,
) -> NormalsResult:
    """Recover normals and albedo from samples that were gathered before, by one solver or several in turn.

    Parameters
    ----------
    samples : Gathered
        Of a capture.
    solver : NormalSolver
        The method. Whether saturated values take part was decided when the samples were gathered.
    weights : float array (m, h · w), optional
        Weights of the observations.
    verdicts, covariance : bool
        What else to tell.
    over : map-like
        Executes blocks.
    progress : callable
        Told how far solving is.

    Returns
    -------
    NormalsResult
        As of :func:`estimate_normals`.

    Raises
    ------
    RigError, UnsupportedError, InputError
        As there.
    """
    capture, pixels, channels = samples.capture, samples.pixels, samples.channels
    started = time.perf_counter()
    job = BlockJob(
        solver=solver,
        state=None,
        pixels=pixels,
        channels=channels.values,
        projection=channels.projection,
        strengths=capture.rig.strengths(capture.stack.shape[3]),
        weights=weights,
        mask=samples.mask,
        verdicts=verdicts,
        covariance=covariance,
        rounding=rounding_of(capture, channels, pixels.indices),
    )
    taught, learnt = job.taught(capture.rig, samples.store)
    job = replace(job, solver=taught, state=taught.prepare(capture.rig, len(pixels)))
    answer = solve_blocks(job, samples.store, samples.plan, over, progress)
    del job  # and the working arrays with it
    if capture.rig.all_distant and capture.rig.condition() > _LOOSE:
        grown = widening(capture.rig.directions, answer.normals, answer.uncertainty)
        answer.uncertainty[:] *= grown
        if answer.covariance is not None:
            answer.covariance[:] *= np.square(grown)[:, None]
    below, left_out, names = samples.below, samples.left_out, capture.stack.names
    facts = {
        "solver": solver.name,
        "gate": solver.gate.name,
        "options": settings_of(solver),
        "learnt": learnt,
        "gray": channels.name,
        "clip": samples.reading.clip,
        "valid_range": None if samples.valid is None else [v / capture.stack.white for v in samples.valid],
        "lights": len(capture.rig),
        "light_condition": capture.rig.condition() if capture.rig.all_distant else None,
        "light_source": capture.rig.source,
        "pixels": len(pixels),
        "samples_in": "memory" if samples.plan.in_memory else "temporary file",
        "sample_bytes": samples.plan.sample_bytes,
        "left_out_by_hand": None if left_out is None else int(left_out.sum()),
        "below_dark": None if below is None else float(below.mean()),
        "below_dark_most": None if below is None else [names[below.argmax()], float(below.max())],
        "ambient_share": _ambient_share(answer),
    }
    seconds = {"read": samples.seconds, "solve": time.perf_counter() - started}
    return _assemble(answer, pixels, capture, facts, seconds)


def _flat_weights(weights: FloatArray | None, capture: Capture) -> FloatArray | None:
    if weights is None:
        return None
    w = np.asarray(weights)
    if w.shape != capture.stack.shape[:3] or any(not np.isfinite(one).all() or (one < 0).any() for one in w):
        raise InputError(
            given=f"The weights have the shape {w.shape}.",
            needed=f"They must be {capture.stack.shape[:3]}, one an observation, finite and not negative.",
            remedy="Use zero for an observation that should be left out.",
        )
    return w.reshape(len(w), -1)


def _assemble(
    answer: Answer, pixels: PixelSet, capture: Capture, facts: dict[str, Any], seconds: dict[str, float]
) -> NormalsResult:
    """Spread the pixels' values over the image and say what they mean."""
    flags = answer.flags
    with np.errstate(invalid="ignore"):
        flags[answer.normals[:, 2] <= 0] |= np.uint16(Flag.FACING_AWAY)
    lost = int(np.count_nonzero(fatal_mask(flags)))
    if lost == len(flags):
        raise InputError(
            given="No pixel under the mask could be solved.",
            needed="Each pixel needs three lights that reach it and do not lie in one plane.",
            remedy="Try without gate, check that lights and images are in the same order, or widen the valid range.",
        )
    albedo = answer.albedo[:, 0] if answer.albedo.shape[1] == 1 else answer.albedo
    kind = AlbedoKind.RELATIVE
    if capture.radiance_at_white is not None and capture.rig.strength_unit is StrengthUnit.IRRADIANCE:
        kind = AlbedoKind.REFLECTANCE
        albedo = albedo * np.asarray(np.pi * capture.radiance_at_white, albedo.dtype)
    return NormalsResult(
        normals=pixels.scatter(answer.normals),
        albedo=pixels.scatter(albedo),
        uncertainty=pixels.scatter(answer.uncertainty),
        flags=pixels.scatter(flags, int(Flag.OUTSIDE_MASK)),
        albedo_kind=kind,
        outcome=_outcome(answer, lost),
        facts={**facts, "pixels_lost": lost},
        seconds=seconds,
        verdicts=None if answer.verdicts is None else answer.verdicts.reshape(-1, *pixels.shape),
        covariance=None if answer.covariance is None else pixels.scatter(answer.covariance),
        used=None if answer.used is None else pixels.scatter(answer.used),
    )


def _ambient_share(answer: Answer) -> list[float] | None:
    """Return ambient over ambient and a facing light's part together: its 5 %, 50 % and 95 % quantiles over pixels."""
    if answer.ambient is None:
        return None
    with np.errstate(invalid="ignore", divide="ignore"):
        share = answer.ambient / (answer.ambient + answer.albedo.mean(axis=1))
    share = share[np.isfinite(share)]
    return [float(value) for value in np.quantile(share, [0.05, 0.5, 0.95])] if len(share) else None


_STRAY = 0.05
"""Share of pixels up to which those that did not converge are told by their flags alone."""


def _outcome(answer: Answer, lost: int) -> Outcome:
    stuck = int(np.count_nonzero(answer.flags & np.uint16(Flag.NOT_CONVERGED)))
    if stuck > _STRAY * len(answer.flags):
        return Outcome.NOT_CONVERGED
    return Outcome.PARTIAL if lost or stuck else Outcome.SOLVED
