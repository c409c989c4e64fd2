"""From images to samples: the pixels under the mask, one row an image, ready for a solver.

Each image is decoded once, and in one pass over it the dark level is taken off, the flat field's gain applied, the
channels are weighted and divided by the strength of their light, and the pixels under the mask are picked. Only the
samples stay.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from psstereo.scratch import Scratch
from psstereo.stack.flat import FlatField
from psstereo.stack.response import LINEAR, Response
from psstereo.stack.stack import ImageStack
from psstereo.stack.store import SampleStore
from psstereo.types import Array, BoolArray, FloatArray, IntArray, Map, Progress, no_progress

__all__ = ["Conversion", "PixelSet", "gather", "sample_dtype"]

_BELOW = 0.02
"""Share of an image's largest sample by which one must be negative to count as below the dark level."""


@dataclass(frozen=True, eq=False)
class PixelSet:
    """The pixels under a mask, in row-major order.

    Attributes
    ----------
    shape : (int, int)
        Rows and columns of the image.
    indices : int array (p,)
        Flat indices into the image.
    box : (slice, slice)
        Smallest rectangle that holds them.
    in_box : int array (p,)
        Flat indices into that rectangle.
    """

    shape: tuple[int, int]
    indices: IntArray
    box: tuple[slice, slice]
    in_box: IntArray

    def __len__(self) -> int:
        return len(self.indices)

    @classmethod
    def from_mask(cls, mask: BoolArray) -> "PixelSet":
        """List the pixels of a mask, bool (h, w), with at least one pixel set."""
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        box = (slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1))
        return cls((mask.shape[0], mask.shape[1]), np.flatnonzero(mask), box, np.flatnonzero(mask[box]))

    def scatter(self, values: Array, fill: float = np.nan) -> Array:
        """Return an image (h, w, ...) that holds values (p, ...) at these pixels and `fill` elsewhere."""
        image = np.full((self.shape[0] * self.shape[1], *values.shape[1:]), fill, values.dtype)
        image[self.indices] = values
        return image.reshape(*self.shape, *values.shape[1:])


@dataclass(frozen=True, kw_only=True, eq=False)
class Conversion:
    """How pixel values become samples: ``Σ_c factors[i, k, c] · gain · (linear(value) − dark)``.

    Attributes
    ----------
    factors : float64 array (m, k, c)
        Channel weights over light strengths and full scale, k values an image.
    response : Response
        Camera response to undo.
    dark : float array (h, w, c) or None
        Level without the light, in linear pixel values.
    flat : FlatField or None
        Gains of the pixels; 1 if absent.
    valid : (float, float) or None
        Open range of raw pixel values outside of which an observation is not usable; it becomes NaN.
    clip : float or None
        Upper bound put on the samples afterwards.
    """

    factors: FloatArray
    response: Response = LINEAR
    dark: FloatArray | None = None
    flat: FlatField | None = None
    valid: tuple[float, float] | None = None
    clip: float | None = None


def sample_dtype(stack: ImageStack) -> np.dtype[Any]:
    """Return float64 for float64 images and float32 for all others, which it holds without loss or nearly so."""
    return np.dtype(np.float64) if stack.dtype == np.float64 else np.dtype(np.float32)


def gather(
    stack: ImageStack,
    pixels: PixelSet,
    conversion: Conversion,
    store: SampleStore,
    *,
    below: FloatArray | None = None,
    over: Map = map,
    progress: Progress = no_progress,
) -> FloatArray:
    """Decode every image once and put its samples into a store.

    Parameters
    ----------
    stack : ImageStack
        The images.
    pixels : PixelSet
        Which pixels are wanted.
    conversion : Conversion
        How values become samples.
    store : SampleStore
        Takes k rows of p samples an image; NaN marks an observation outside the valid range.
    below : float64 array (m,), optional
        Filled with the share of each image's samples that lie below the dark level by more than noise would, by a
        fiftieth of the image's largest sample [1]. Looked for only if given.
    over : map-like
        Executes the images; a thread pool's ``map`` pays, since decoders release the interpreter's lock.
    progress : callable
        Told after each image.

    Returns
    -------
    float64 array (m,)
        Largest sample of each image, NaN if none is usable.

    Raises
    ------
    InputError, MissingFileError, UnreadableFileError
        If an image does not fit the others, is not there, or is damaged.
    """
    job = _ImageJob(stack, pixels, conversion, store, below)
    largest = np.zeros(len(stack))
    for index, value in enumerate(over(job, range(len(stack)))):
        largest[index] = value
        progress("reading images", index + 1, len(stack))
    return largest


@dataclass(frozen=True, eq=False)
class _ImageJob:
    """Converts one image; a class rather than a closure so that any executor can take it."""

    stack: ImageStack
    pixels: PixelSet
    conversion: Conversion
    store: SampleStore
    below: FloatArray | None = None
    scratch: Scratch = field(default_factory=Scratch)

    def __call__(self, index: int) -> float:
        frame = self.stack.frame(index)[self.pixels.box]
        factors, valid = self.conversion.factors[index], self.conversion.valid
        turned = frame.strides[2] < 0
        if turned:
            # B, G, R in memory: turn factors, dark level and gains round instead of the pixels
            frame, factors = frame[..., ::-1], factors[:, ::-1]
        combined = self._combine(index, frame, factors, turned=turned)
        rows = self.store.rows(index)
        shape = (len(factors), len(self.pixels))
        samples = self.scratch.array("samples", shape, combined.dtype) if rows is None else rows
        for k in range(len(factors)):
            np.take(combined[..., k].reshape(-1), self.pixels.in_box, out=samples[k], mode="clip")
        if self.conversion.clip is not None:
            np.minimum(samples, self.conversion.clip, out=samples)
        if valid is not None:
            _drop_outside(frame, valid, factors, self.pixels.in_box, samples)
        if rows is None:
            self.store.write(index, samples)
        largest = float(np.fmax.reduce(samples, axis=None))
        if self.below is not None:
            self.below[index] = np.count_nonzero(samples < -_BELOW * abs(largest)) / samples.size
        return largest

    def _combine(self, index: int, frame: Array, factors: FloatArray, *, turned: bool) -> FloatArray:
        """Return (rows, columns, k) sums over the channels, float32, or float64 for float64 images."""
        import cv2

        dtype = np.float64 if frame.dtype == np.float64 else np.float32
        linear = self.scratch.array("linear", frame.shape, dtype)
        self._fill(index, frame, linear, turned=turned)
        out = self.scratch.array("combined", (*frame.shape[:2], len(factors)), dtype)
        cv2.transform(linear, np.ascontiguousarray(factors, dtype), dst=out)
        spoilt = frame.dtype.kind == "f" or self.conversion.flat is not None
        if linear.shape[2] > 1 and spoilt and not (factors.all() or np.isfinite(linear).all()):
            # 0 · NaN is NaN, but a channel that is not used cannot spoil the others
            for k, row in enumerate(factors.astype(dtype)):
                out[..., k] = linear[..., row != 0] @ row[row != 0]
        return out

    def _fill(self, index: int, frame: Array, linear: FloatArray, *, turned: bool) -> None:
        """Write light to `linear`: each step's result goes straight there, so that none takes a pass of its own."""
        how = self.conversion
        light: Array = frame if how.response.is_linear else how.response.linearise(frame, self.stack.white)
        if how.dark is not None:
            dark = self._dark[turned][self.pixels.box]
            # never in integers: below the dark level they would wrap round
            exact = np.result_type(light, dark, np.float32)
            np.subtract(light, dark, out=linear, dtype=exact, casting="same_kind")
            light = linear
        if how.flat is not None:
            gain = how.flat.of(index) if how.flat.per_light else self._gain[turned]
            gain = gain[..., ::-1] if turned and how.flat.per_light else gain
            np.multiply(light, gain[self.pixels.box], out=linear, dtype=linear.dtype, casting="same_kind")
        elif light is not linear:
            np.copyto(linear, light, casting="same_kind")

    @cached_property
    def _dark(self) -> tuple[FloatArray, FloatArray]:
        """The dark level as R, G, B and as B, G, R lie in memory: loops over rows cost a third of those over pixels."""
        return _both_ways(self.conversion.dark)

    @cached_property
    def _gain(self) -> tuple[FloatArray, FloatArray]:
        """The gains that all images share, likewise."""
        flat = self.conversion.flat
        return _both_ways(None if flat is None else flat.gain)


def _both_ways(values: FloatArray | None) -> tuple[FloatArray, FloatArray]:
    """Return an image with its channels in both orders, each contiguous."""
    image = np.zeros((0, 0, 1)) if values is None else values
    return np.ascontiguousarray(image), np.ascontiguousarray(image[..., ::-1])


def _largest(frame: Array) -> float:
    """Return the largest value; OpenCV finds it in integers several times faster than NumPy does in a cut-out."""
    import cv2

    if frame.dtype.kind == "u" and frame.strides[2] > 0:
        return float(cv2.norm(frame, cv2.NORM_INF))
    return float(frame.max())


def _drop_outside(
    frame: Array, valid: tuple[float, float], factors: FloatArray, in_box: IntArray, samples: FloatArray
) -> None:
    """Put NaN where a channel that is used lies outside the valid range."""
    low, high = valid
    # Nearly all images have none, and one look at the extremes costs a tenth of a comparison of all pixels.
    if _largest(frame) < high and (low == -np.inf or frame.min() > low):
        return
    bad = ((frame >= high) | (frame <= low)).reshape(-1, frame.shape[2]).take(in_box, axis=0)
    for k, row in enumerate(factors):
        samples[k][bad[:, row != 0].any(axis=1)] = np.nan
