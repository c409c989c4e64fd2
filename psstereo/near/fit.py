"""Fits of all pixels of a level at given places, block by block."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from psstereo.kernels.dispatch import kernel
from psstereo.kernels.near import GEMAN_MCCLURE, TUKEY, NearFit
from psstereo.near.level import Level
from psstereo.normals.memory import BLOCK
from psstereo.types import FloatArray, Map

__all__ = ["SCALE", "fit_level", "over_blocks"]

SCALE = 0.1
"""Residual that counts as large while the geometry is looked for, as a share of a pixel's mean brightness."""

BREAK_EVEN = 1e7
"""Samples times rounds from which the compiled twin is sooner done, loading included."""

_Block: TypeAlias = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class _Job:
    """Fits one block; a class rather than a closure so that any executor can take it."""

    lamps: FloatArray
    rounds: int
    loss: int
    work: float

    def __call__(self, block: _Block) -> NearFit:
        values, points, motion, start, scale = block
        fit = kernel("near", "fit_near", self.work, BREAK_EVEN)
        found: NearFit = fit(values, points, motion, self.lamps, start, scale, self.rounds, self.loss)
        return found


def fit_level(
    level: Level,
    lamps: FloatArray,
    q: FloatArray,
    *,
    start: FloatArray | None = None,
    scale: FloatArray | None = None,
    rounds: int,
    work: float,
    channel: int | None = None,
    over: Map = map,
) -> NearFit:
    """Fit every pixel of a level.

    Parameters
    ----------
    level : Level
        Samples and lines of sight.
    lamps : float64 array (m, 7)
        Position, axis, exponent.
    q : float64 array (p,)
        Where the surface is, see :class:`psstereo.near.view.View`.
    start : float64 array (p, 3), optional
        Albedo times normal to begin with.
    scale : float64 array (p,), optional
        Scale of Tukey's loss; if absent that of Geman and McClure is used with a tenth of the brightness, an energy
        that means the same at all distances.
    rounds : int
        Rounds of reweighting.
    work : float
        Samples times rounds of the whole run, which tell whether compiled code pays.
    channel : int, optional
        Which of the values to fit; their mean if absent.
    over : map-like
        Executes blocks.

    Returns
    -------
    NearFit
        Of all pixels.
    """
    count = len(level)
    begin = np.full((count, 3), np.nan) if start is None else start
    width = SCALE * level.level if scale is None else scale
    points = level.view.points(q)
    motion = level.view.motion(points)
    job = _Job(lamps, rounds, GEMAN_MCCLURE if scale is None else TUKEY, work)

    def block(values: FloatArray, s: int, e: int) -> _Block:
        return values, points[s:e], motion[s:e], begin[s:e], width[s:e]

    parts = over_blocks(level, job, block, channel=channel, over=over)
    return NearFit(*(np.concatenate(field) for field in zip(*parts, strict=True)))


def over_blocks(
    level: Level,
    job: Callable[[Any], Any],
    block: Callable[[FloatArray, int, int], Any],
    *,
    channel: int | None = None,
    over: Map = map,
) -> list[Any]:
    """Do a job for every block of a level's pixels, one read of samples after the other.

    Parameters
    ----------
    level : Level
        Samples and lines of sight.
    job : callable
        What is done.
    block : callable
        Makes what the job is given, of values (m, k), the first pixel's number and the one after the last.
    channel : int, optional
        Which of the values to take; their mean if absent.
    over : map-like
        Executes blocks.

    Returns
    -------
    list
        What the jobs returned, in the order of the pixels.
    """
    parts: list[Any] = []
    for tile in range(0, len(level), level.tile):
        stop = min(tile + level.tile, len(level))
        samples = level.store.read(tile, stop)
        blocks = (
            block(_gray(samples[:, :, s - tile : e - tile], channel), s, e)
            for s in range(tile, stop, BLOCK)
            for e in (min(s + BLOCK, stop),)
        )
        parts.extend(over(job, blocks))
    return parts


def _gray(samples: FloatArray, channel: int | None) -> FloatArray:
    """Return float64 values (m, p)."""
    if channel is not None:
        return np.ascontiguousarray(samples[channel], np.float64)
    return np.ascontiguousarray(samples.mean(axis=0, dtype=np.float64))
