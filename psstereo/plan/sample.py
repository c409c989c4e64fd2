"""A bounded sample of a capture, on which is decided what the whole of it needs.

Pixels come in compact square blocks, so that neighbours exist and slopes can be compared, and the blocks are spread
evenly over the mask. While the images are decoded for the solver, the sample's raw values are picked on the way: no
file is opened twice.
"""

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from psstereo.lights import Rig
from psstereo.normals.least_squares import LeastSquares
from psstereo.normals.memory import BLOCK
from psstereo.normals.solver import Samples
from psstereo.stack import ImageStack
from psstereo.types import Array, BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from psstereo.plan.diagnosis.motion_probe import MotionProbe

__all__ = ["SAMPLE_PIXELS", "Sample", "SamplePixels", "WatchedStack", "sample_pixels"]

SAMPLE_PIXELS = 8192
"""Pixels of a sample at most."""

_SIDE = 16
"""Side of a block [px]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SamplePixels:
    """Which pixels the sample holds.

    Attributes
    ----------
    pixels : int array (n, 2)
        Row and column of each, block by block.
    neighbours : int array (n, 2)
        Number of the sample's pixel to the right, and of the one below; −1 where the sample has none.
    blocks : int array (n,)
        Block of each pixel, from 0.
    """

    pixels: IntArray
    neighbours: IntArray
    blocks: IntArray

    def __len__(self) -> int:
        return len(self.pixels)

    def mask(self, shape: tuple[int, int]) -> BoolArray:
        """Return the mask of these pixels alone."""
        mask = np.zeros(shape, np.bool_)
        mask[tuple(self.pixels.T)] = True
        return mask


def sample_pixels(mask: BoolArray, most: int = SAMPLE_PIXELS) -> SamplePixels:
    """Choose the pixels of a sample: all if they are few, else full square blocks spread over the mask.

    Parameters
    ----------
    mask : bool array (h, w)
        The object; at least one pixel.
    most : int
        Pixels at most.

    Returns
    -------
    SamplePixels
        The pixels; the same for the same mask.
    """
    rows, columns = np.nonzero(mask)
    block = _morton(rows // _SIDE, columns // _SIDE)
    if len(rows) > most:
        chosen = _spread(block, most)
        rows, columns, block = rows[chosen], columns[chosen], block[chosen]
    order = np.lexsort((columns, rows, block))
    rows, columns = rows[order], columns[order]
    _, number = np.unique(block[order], return_inverse=True)
    index = np.full((mask.shape[0] + 1, mask.shape[1] + 1), -1, np.int64)
    index[rows, columns] = np.arange(len(rows))
    neighbours = np.stack([index[rows, columns + 1], index[rows + 1, columns]], axis=1)
    return SamplePixels(pixels=np.stack([rows, columns], axis=1), neighbours=neighbours, blocks=number.reshape(-1))


def _morton(rows: IntArray, columns: IntArray) -> IntArray:
    """Interleave the bits of two numbers below 2¹⁶: near in the order is near in the image."""

    def spread(x: IntArray) -> IntArray:
        for shift, keep in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
            x = (x | (x << shift)) & keep
        return x

    return np.asarray(spread(rows.astype(np.int64)) << 1 | spread(columns.astype(np.int64)))


def _spread(block: IntArray, most: int) -> BoolArray:
    """Return which pixels lie in blocks that are chosen at even steps along the order of blocks."""
    names, inverse, sizes = np.unique(block, return_inverse=True, return_counts=True)
    good = np.flatnonzero(sizes >= min(_SIDE * _SIDE // 2, sizes.max()))  # blocks at the rim hold little
    count = max(most // (_SIDE * _SIDE), 1)
    if len(good) > count:
        good = good[((np.arange(count) + 0.5) * len(good) / count).astype(np.int64)]
    wanted = np.zeros(len(names), np.bool_)
    wanted[good] = True
    chosen = wanted[inverse.reshape(-1)]
    short = most - int(chosen.sum())
    if 2 * short > most:  # scattered pixels: there are no full blocks
        others = np.flatnonzero(~chosen)
        chosen[others[((np.arange(short) + 0.5) * len(others) / short).astype(np.int64)]] = True
    return chosen


@dataclass(frozen=True, kw_only=True, eq=False)
class Sample:
    """Observations of some pixels under distant lights, and a first fit to them.

    Attributes
    ----------
    values : float64 array (m, n)
        One gray value an observation: linear brightness over light strength and full scale; NaN where it is not usable
        (saturated, outside the valid range, left out by hand).
    raw : array (m, n, c) or None
        What stood in the images, in their own numbers, channels R, G, B; None if it was not watched.
    pixels, neighbours, blocks
        As of :class:`SamplePixels`.
    shape : (int, int)
        Rows and columns of the image.
    directions : float64 array (m, 3)
        Unit vectors to the lights.
    strengths : float64 array (m, c)
        Their strengths.
    white : float
        Raw value that means full scale.
    bits : int
        Bits of a raw value: 8, 16, or 32 and 64 for floating point.
    saturates : bool
        Whether raw values end at `white`.
    names : tuple of str
        Names of the images, for messages.
    normals : float64 array (n, 3)
        Unit normals of a least-squares fit with shadow gate; NaN where there is none [1].
    albedo : float64 array (n,)
        Its albedo, in the unit of `values`.
    residual : float64 array (m, n)
        ``values − albedo · max(0, n·l)``; NaN where a value or the fit is.
    """

    values: FloatArray
    pixels: IntArray
    neighbours: IntArray
    blocks: IntArray
    shape: tuple[int, int]
    directions: FloatArray
    strengths: FloatArray
    white: float
    bits: int
    saturates: bool
    names: tuple[str, ...]
    normals: FloatArray
    albedo: FloatArray
    residual: FloatArray
    raw: Array | None = None

    def __len__(self) -> int:
        return int(self.values.shape[1])

    @classmethod
    def fitted(
        cls,
        values: FloatArray,
        where: SamplePixels,
        stack: ImageStack,
        rig: Rig,
        raw: Array | None = None,
    ) -> "Sample":
        """Fit least squares to values and put the sample together.

        Parameters
        ----------
        values : float array (m, n)
            As the attribute.
        where : SamplePixels
            Which pixels they are.
        stack : ImageStack
            For full scale, bits and names; no image is decoded.
        rig : Rig
            Distant lights that span space.
        raw : array (m, n, c), optional
            As the attribute.

        Returns
        -------
        Sample
            The sample.

        Raises
        ------
        RigError, UnsupportedError
            If the lights cannot give normals.
        """
        v = np.asarray(values, np.float64)
        solver = LeastSquares()
        state = solver.prepare(rig, v.shape[1])
        blocks = [Samples(np.ascontiguousarray(v[:, s : s + BLOCK])) for s in range(0, v.shape[1], BLOCK)]
        scaled = np.concatenate([solver.solve(state, block).scaled for block in blocks])
        albedo = np.sqrt((scaled * scaled).sum(axis=1))
        with np.errstate(invalid="ignore", divide="ignore"):
            normals = scaled / albedo[:, None]
        return cls(
            values=v,
            raw=raw,
            pixels=where.pixels,
            neighbours=where.neighbours,
            blocks=where.blocks,
            shape=(stack.shape[1], stack.shape[2]),
            directions=rig.directions,
            strengths=rig.strengths(stack.shape[3]),
            white=stack.white,
            bits=8 * stack.dtype.itemsize,
            saturates=stack.saturates,
            names=stack.names,
            normals=normals,
            albedo=albedo,
            residual=v - np.maximum(rig.directions @ scaled.T, 0.0),
        )


class WatchedStack(ImageStack):
    """A stack that keeps the sample's raw values of each image as it goes by, and how long decoding took.

    Parameters
    ----------
    source : ImageStack
        Where images come from.
    where : SamplePixels
        The pixels to keep.
    motion : object with a method `feed`, optional
        Shown each image as well.
    """

    def __init__(self, source: ImageStack, where: SamplePixels, motion: "MotionProbe | None" = None) -> None:
        self.motion = motion
        self.source = source
        self.shape, self.dtype, self.white = source.shape, source.dtype, source.white
        self.saturates, self.names = source.saturates, source.names
        self.raw: Array = np.zeros((source.shape[0], len(where), source.shape[3]), source.dtype)
        self.seconds: FloatArray = np.zeros(source.shape[0])
        self._rows, self._columns = where.pixels.T

    def frame(self, index: int) -> Array:
        """Return an image and keep the sample's part of it; see :meth:`ImageStack.frame`."""
        started = time.perf_counter()
        image = self.source.frame(index)
        self.seconds[index] = time.perf_counter() - started
        self.raw[index] = image[self._rows, self._columns]
        if self.motion is not None:
            self.motion.feed(image, index)
        return image
