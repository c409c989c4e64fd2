"""How much memory an estimate takes, and what to do when that is too much."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from psstereo.errors import InputError
from psstereo.stack import ImageStack, PixelSet
from psstereo.stack.gather import sample_dtype

__all__ = ["BLOCK", "MemoryPlan", "plan_memory"]

BLOCK = 2048
"""Pixels solved at once: large enough to hide the interpreter, small enough for 96 lights to stay in the cache."""

_BLOCK_ARRAYS = 7.0
"""Working arrays of a block in float64: masks, weights, refits included; test_memory holds solvers to it."""

_COVARIANCE = 40
"""Numbers of a pixel in float64 that are held while its covariance is worked out."""


@dataclass(frozen=True, kw_only=True)
class MemoryPlan:
    """Where samples wait and how many pixels are solved between two reads.

    Attributes
    ----------
    shape : (int, int, int)
        Samples: values, images, pixels.
    dtype : numpy dtype
        Of the samples and of the result.
    in_memory : bool
        Whether the samples stay in memory rather than in a temporary file.
    tile : int
        Pixels a read, a multiple of `BLOCK`.
    sample_bytes : int
        Size of all samples [byte].
    """

    shape: tuple[int, int, int]
    dtype: np.dtype[Any]
    in_memory: bool
    tile: int
    sample_bytes: int


def plan_memory(
    stack: ImageStack,
    pixels: PixelSet,
    values: int,
    max_memory: int | None,
    workers: int,
    *,
    undoing: int = 0,
    masked: bool = False,
    verdicts: bool = False,
    covariance: bool = False,
    projected: bool = False,
) -> MemoryPlan:
    """Decide where the samples wait.

    Parameters
    ----------
    stack : ImageStack
        The images.
    pixels : PixelSet
        Pixels wanted.
    values : int
        Values an observation: 1 for gray, the number of channels otherwise.
    max_memory : int or None
        Bound for arrays; no bound if absent [byte].
    workers : int
        Images decoded, and blocks solved, at the same time.
    undoing : int
        What undoing a response or a dark level takes while an image is decoded [byte a channel of a pixel].
    masked : bool
        Whether observations are left out by a mask, which is applied to a copy of each block.
    verdicts, covariance : bool
        Whether they are asked for.
    projected : bool
        Whether the values of an observation are projected to one before they are solved.

    Returns
    -------
    MemoryPlan
        The plan.

    Raises
    ------
    InputError
        If even the smallest tile does not fit.
    """
    m, h, w, c = stack.shape
    dtype = sample_dtype(stack)
    count = len(pixels)
    total = values * m * count * dtype.itemsize
    # Normals, albedo, uncertainty and flags of a pixel, six numbers and a count of its covariance; they become images
    # when the working arrays are gone.
    pixel = (4 + values + 7 * covariance) * dtype.itemsize + 2
    result = count * (pixel + 16)
    box = (pixels.box[0].stop - pixels.box[0].start) * (pixels.box[1].stop - pixels.box[1].start)
    decoding = workers * (
        h * w * c * (stack.dtype.itemsize + 1) + box * ((c + values + 1) * dtype.itemsize + c * undoing)
    )
    solving = int(workers * m * BLOCK * 8 * _BLOCK_ARRAYS)
    solving += workers * BLOCK * (m * values * (dtype.itemsize + 2) * masked + 2 * m * values * verdicts)
    solving += workers * BLOCK * 8 * _COVARIANCE * values * covariance
    solving += workers * BLOCK * 8 * m * (2 * values + 2) * projected
    # Verdicts fill their images at once; those of a tile may wait for them if a thread falls behind.
    fixed = result + max(decoding, solving, h * w * pixel) + m * h * w * verdicts
    whole = MemoryPlan(
        shape=(values, m, count), dtype=dtype, in_memory=True, tile=-(-count // BLOCK) * BLOCK, sample_bytes=total
    )
    waiting = m * BLOCK * verdicts
    if max_memory is None or total + fixed + waiting * (whole.tile // BLOCK) <= max_memory:
        return whole
    block = values * m * BLOCK * dtype.itemsize + waiting
    room = (max_memory - fixed) // block
    if room < 1:
        raise InputError(
            given=f"The memory limit is {max_memory / 1e6:.0f} MB.",
            needed=f"Images of {w} × {h} pixels under {m} lights take {(fixed + block) / 1e6:.0f} MB even in tiles.",
            remedy="Allow that much, use fewer threads, crop the images to the object, or bin their pixels.",
        )
    return MemoryPlan(shape=whole.shape, dtype=dtype, in_memory=False, tile=int(room) * BLOCK, sample_bytes=total)
