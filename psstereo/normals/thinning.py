"""Samples of a thinned grid of pixels, enough to find what few unknowns of the lights all pixels share."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psstereo.capture import Capture
from psstereo.errors import InputError
from psstereo.normals.observations import checked_mask, may_take_part
from psstereo.normals.verdict import VerdictArray
from psstereo.stack import Conversion, MemoryStore, PixelSet, gather, gray_weights
from psstereo.stack.gather import sample_dtype
from psstereo.types import BoolArray, FloatArray, Map, Progress, no_progress

__all__ = ["SampleGrid", "sample_grid"]

_NEARLY_WHITE = 0.98
"""Share of full scale from which a value counts as saturated; sensors bend before they clip."""


@dataclass(frozen=True, eq=False)
class SampleGrid:
    """Gray or channel values of pixels that lie on a grid.

    Attributes
    ----------
    values : float64 array (k, m, p)
        Linear brightness, k values an observation; NaN where an observation is not usable.
    mask : bool array (rows, columns)
        Where on the thinned grid these pixels lie, in row-major order.
    step : int
        Pixels of the image from one pixel of the grid to the next [px].
    gray : str
        How channels became a value.
    """

    values: FloatArray
    mask: BoolArray
    step: int
    gray: str


def sample_grid(
    capture: Capture,
    *,
    gray: str | Sequence[float],
    limit: int,
    strengths: bool,
    valid_range: tuple[float, float] | None = None,
    observation_mask: BoolArray | VerdictArray | None = None,
    over: Map = map,
    progress: Progress = no_progress,
) -> SampleGrid:
    """Read a capture's samples on every step-th row and column, the step being the smallest that meets a limit.

    Parameters
    ----------
    capture : Capture
        Images, lights, mask.
    gray : str or sequence of float
        How channels become one value; ``"per-channel"`` keeps them apart.
    limit : int
        About how many pixels are wanted at most.
    strengths : bool
        Whether values are divided by the strengths of the rig.
    valid_range : (float, float), optional
        Raw values, as shares of full scale, outside of which an observation is left out; below 0.98 if absent and the
        images have a full scale.
    observation_mask : bool or uint8 array (m, h, w), optional
        Observations that may take part, or verdicts; see :func:`psstereo.normals.estimate_normals`.
    over : map-like
        Executes the images.
    progress : callable
        Told how far reading is.

    Returns
    -------
    SampleGrid
        The samples.

    Raises
    ------
    InputError
        If an image is black or saturated everywhere under the mask, or the valid range is empty, or the mask of
        observations does not fit.
    """
    stack = capture.stack
    step = _step(capture.effective_mask, limit)
    rows, columns = _first(capture.effective_mask, step)
    mask = np.zeros(capture.shape, np.bool_)
    mask[rows::step, columns::step] = capture.effective_mask[rows::step, columns::step]
    by_hand = checked_mask(observation_mask, stack.shape[:3])
    channels = gray_weights(gray, stack.shape[3])
    divisor = capture.rig.strengths(stack.shape[3]) if strengths else np.ones((len(stack), stack.shape[3]))
    conversion = Conversion(
        factors=channels.matrix[None] / (divisor[:, None] * stack.white),
        response=capture.response,
        dark=capture.dark,
        flat=capture.flat,
        valid=_valid(capture, valid_range),
    )
    pixels = PixelSet.from_mask(mask)
    with MemoryStore((len(channels.matrix), len(stack), len(pixels)), sample_dtype(stack)) as store:
        _require_light(gather(stack, pixels, conversion, store, over=over, progress=progress), stack.names)
        values = store.read(0, len(pixels)).astype(np.float64)
    values[~np.isfinite(values)] = np.nan
    if by_hand is not None:
        values[:, ~may_take_part(by_hand[:, pixels.indices])] = np.nan
    return SampleGrid(values, mask[rows::step, columns::step], step, channels.name)


def _step(mask: BoolArray, limit: int) -> int:
    return max(1, int(np.ceil(np.sqrt(np.count_nonzero(mask) / limit))))


def _first(mask: BoolArray, step: int) -> tuple[int, int]:
    """Return the first row and column of the grid: the corner, unless the mask is so thin that the grid misses it."""
    rows, columns = np.nonzero(mask)
    counts = np.bincount((rows % step) * step + columns % step, minlength=step * step)
    best = 0 if 2 * counts[0] * step * step >= len(rows) else int(counts.argmax())
    return best // step, best % step


def _valid(capture: Capture, valid_range: tuple[float, float] | None) -> tuple[float, float] | None:
    white = capture.stack.white
    if valid_range is None:
        return (-np.inf, _NEARLY_WHITE * white) if capture.stack.saturates else None
    low, high = valid_range
    if not low < high:
        raise InputError(
            given=f"The valid range is {low} to {high}.",
            needed="The lower end must be below the upper one.",
            remedy="Give shares of full scale such as 0.01,0.98.",
        )
    return low * white, high * white


def _require_light(largest: FloatArray, names: tuple[str, ...]) -> None:
    unusable = [name for name, value in zip(names, largest, strict=True) if not value > 0]
    if unusable:
        raise InputError(
            given=f"The image {unusable[0]} shows nothing that can be used under the mask"
            + (f", and {len(unusable) - 1} more." if len(unusable) > 1 else "."),
            needed="What is unknown about a light can be told only from an image in which it reaches the object.",
            remedy="Leave such images out together with their lights, or check exposure and mask.",
        )
