"""Solving the pixels of a capture block by block, and putting what comes out in its place."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from psstereo.errors import UnsupportedError
from psstereo.lights import Rig
from psstereo.normals.channels import combine_channels, combine_covariances, combine_verdicts
from psstereo.normals.memory import BLOCK, MemoryPlan
from psstereo.normals.observations import may_take_part
from psstereo.normals.rounding import Rounding, raise_bars
from psstereo.normals.solver import NormalSolver, PixelNormals, Samples
from psstereo.normals.verdict import OUTSIDE, VerdictArray
from psstereo.stack import PixelSet, Projection, SampleStore
from psstereo.types import BoolArray, FlagArray, FloatArray, IntArray, Map, Progress

__all__ = ["Answer", "BlockJob", "solve_blocks"]

_GROUP = 8
"""Blocks that an executor gets at once; one at a time, threads would wait for each other more than they work."""


@dataclass(frozen=True, eq=False)
class Answer:
    """Values of pixels under the mask.

    Attributes
    ----------
    normals : float array (p, 3)
        Unit normals [1].
    albedo : float array (p, c)
        Albedo.
    uncertainty : float array (p,)
        Root-mean-square angle [rad].
    flags : uint16 array (p,)
        Flag bits.
    covariance : float array (p, 6) or None
        Covariance of the normal's error, if asked for [rad²].
    used : float array (p,) or None
        Observations that it rests on, with it [1].
    verdicts : uint8 array (m, p) or None
        What was made of each observation, if asked for; of a whole capture (m, h · w).
    ambient : float array (p,) or None
        What the pixels show without the lights, if the solver tells it; the mean of several channels.
    """

    normals: FloatArray
    albedo: FloatArray
    uncertainty: FloatArray
    flags: FlagArray
    covariance: FloatArray | None = None
    used: FloatArray | None = None
    verdicts: VerdictArray | None = None
    ambient: FloatArray | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class BlockJob:
    """Solves one block of pixels, all its channels.

    Attributes
    ----------
    solver : NormalSolver
        The method.
    state : object
        What it prepared.
    pixels : PixelSet
        The pixels of the capture.
    channels : int
        Values an observation that are solved.
    projection : Projection or None
        What makes one value of the samples' channels first.
    strengths : float array (m, c) or None
        Strengths of the lights, for it.
    weights : float array (m, h · w) or None
        Weights of all observations; a block's are picked when it is solved, so that they are not held twice.
    mask : bool or uint8 array (m, h · w) or None
        Observations that may take part, or a stack of verdicts.
    verdicts, covariance : bool
        What else is asked for.
    rounding : Rounding or None
        What a step of the images is in the samples, for the least that error bars may be; None for images that are not
        integers.
    """

    solver: NormalSolver[Any]
    state: Any
    pixels: PixelSet
    channels: int
    projection: Projection | None = None
    strengths: FloatArray | None = None
    weights: FloatArray | None = None
    mask: BoolArray | VerdictArray | None = None
    verdicts: bool = False
    covariance: bool = False
    rounding: Rounding | None = None

    def solve_group(self, blocks: list[tuple[int, FloatArray]]) -> list[Answer]:
        """Solve some blocks one after the other."""
        return [self(block) for block in blocks]

    def __call__(self, block: tuple[int, FloatArray]) -> Answer:
        """Solve one block: its first pixel, and its samples (k, m, p)."""
        start, values = block
        values, weights = self._observations(self.pixels.indices[start : start + values.shape[2]], values)
        parts = [
            self.solver.solve(self.state, Samples(values[k], weights, self.verdicts, self.covariance))
            for k in range(self.channels)
        ]
        self._require_what_was_asked(parts[0])
        if self.rounding is not None:
            for k, part in enumerate(parts):
                raise_bars(self.rounding, part, values[k], weights, channel=k, start=start)
        return _one(parts[0], self.covariance) if self.channels == 1 else _several(parts, self.covariance)

    def taught(self, rig: Rig, store: SampleStore) -> tuple[NormalSolver[Any], str | None]:
        """Return the solver when it has seen pixels from all over the object, and what it learnt, if it wants to."""
        count = len(self.pixels)
        wanted = min(self.solver.learns_from, count)
        if wanted == 0:
            return self.solver, None
        at = np.unique(np.linspace(0, count - 1, wanted).astype(np.intp))
        read = np.concatenate([store.read(int(i), int(i) + 1) for i in at], axis=2)
        values, weights = self._observations(self.pixels.indices[at], read)
        heavy = None if weights is None else np.tile(weights, len(values))
        return self.solver.taught(rig, Samples(np.hstack(list(values)), heavy), count)

    def _observations(self, indices: IntArray, values: FloatArray) -> tuple[FloatArray, FloatArray | None]:
        """Return values (k, m, p) and weights (m, p) of some pixels as the solver is to see them."""
        weights = None if self.weights is None else self.weights[:, indices].astype(np.float64)
        if self.mask is not None:
            values = np.where(may_take_part(self.mask[:, indices]), values, values.dtype.type(np.nan))
        if self.projection is not None and self.strengths is not None:
            values = self.projection(values, self.strengths)[None]
        return values, weights

    def _require_what_was_asked(self, part: PixelNormals) -> None:
        for wanted, found, what in (
            (self.verdicts, part.verdicts, "verdict on each observation"),
            (self.covariance, part.covariance, "covariance of its error"),
        ):
            if wanted and found is None:
                raise UnsupportedError(
                    given=f"The solver {self.solver.name} tells no {what}.",
                    needed="A solver that does.",
                    remedy="Ask for less, or use the solver least-squares.",
                )


def _one(part: PixelNormals, with_covariance: bool) -> Answer:
    length = np.sqrt((part.scaled * part.scaled).sum(axis=1))
    with np.errstate(invalid="ignore", divide="ignore"):
        normals = part.scaled / length[:, None]
    used = part.used.astype(np.float64) if with_covariance else None
    return Answer(
        normals,
        length[:, None],
        part.uncertainty,
        part.flags,
        part.covariance if with_covariance else None,
        used,
        part.verdicts,
        part.ambient,
    )


def _several(parts: list[PixelNormals], with_covariance: bool) -> Answer:
    normals, albedo, uncertainty, flags = combine_channels(parts)
    covariance, used = combine_covariances(parts, normals, albedo) if with_covariance else (None, None)
    verdicts = combine_verdicts(parts) if parts[0].verdicts is not None else None
    levels = [part.ambient for part in parts if part.ambient is not None]
    ambient = np.nansum(levels, axis=0) / np.maximum(np.isfinite(levels).sum(axis=0), 1) if levels else None
    return Answer(normals, albedo, uncertainty, flags, covariance, used, verdicts, ambient)


def solve_blocks(job: BlockJob, store: SampleStore, plan: MemoryPlan, over: Map, progress: Progress) -> Answer:
    """Solve all pixels.

    Parameters
    ----------
    job : BlockJob
        How a block is solved.
    store : SampleStore
        The samples.
    plan : MemoryPlan
        How many pixels are read at once.
    over : map-like
        Executes groups of blocks.
    progress : callable
        Told how far it is.

    Returns
    -------
    Answer
        Of all pixels under the mask.
    """
    from threadpoolctl import threadpool_limits

    _, m, count = store.shape
    dtype = plan.dtype
    size = job.pixels.shape[0] * job.pixels.shape[1]
    out = Answer(
        np.zeros((count, 3), dtype),
        np.zeros((count, job.channels), dtype),
        np.zeros(count, dtype),
        np.zeros(count, np.uint16),
        np.zeros((count, 6), dtype) if job.covariance else None,
        np.zeros(count, dtype) if job.covariance else None,
        np.full((m, size), OUTSIDE, np.uint8) if job.verdicts else None,
        np.zeros(count, dtype) if job.solver.unknowns > 3 else None,
    )
    # One thread a block: linear algebra that splits a block itself would round differently from run to run.
    with threadpool_limits(1, user_api="blas"):
        for tile in range(0, count, plan.tile):
            stop = min(tile + plan.tile, count)
            _solve_tile(job, tile, store.read(tile, stop), out, over=over, progress=progress)
    return out


def _solve_tile(job: BlockJob, tile: int, values: FloatArray, out: Answer, *, over: Map, progress: Progress) -> None:
    """Solve the blocks of one tile; a function of its own so that one tile is gone before the next is read."""
    blocks = [(tile + s, values[:, :, s : s + BLOCK]) for s in range(0, values.shape[2], BLOCK)]
    groups = [blocks[i : i + _GROUP] for i in range(0, len(blocks), _GROUP)]
    for group, answers in zip(groups, over(job.solve_group, groups), strict=True):
        for (start, part), answer in zip(group, answers, strict=True):
            where = slice(start, start + part.shape[2])
            out.normals[where], out.albedo[where] = answer.normals, answer.albedo
            out.uncertainty[where], out.flags[where] = answer.uncertainty, answer.flags
            if out.covariance is not None and out.used is not None:
                out.covariance[where], out.used[where] = answer.covariance, answer.used
            if out.ambient is not None and answer.ambient is not None:
                out.ambient[where] = answer.ambient
            if out.verdicts is not None and answer.verdicts is not None:
                for row, verdicts in zip(out.verdicts, answer.verdicts, strict=True):
                    row[job.pixels.indices[where]] = verdicts
        progress("solving pixels", where.stop, len(out.flags))
