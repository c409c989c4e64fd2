"""Several exposures of every light, as one image of light each."""

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError
from psstereo.stack.response import LINEAR, Response
from psstereo.stack.stack import ImageStack
from psstereo.types import Array, FloatArray

__all__ = ["BracketStack", "merge_exposures"]

_FADES, _NEARLY_WHITE = 0.9, 0.98
"""Shares of full scale between which a value loses its weight; sensors bend before they clip."""
_FULL_WELL = 1e4
"""Electrons of a pixel at full scale, which set the noise of photons; those of cameras and small sensors."""
_STEPS = 8
"""Steps above zero over which values gain their weight: rounding spoils the lowest."""


class BracketStack(ImageStack):
    """A stack of light merged from exposure brackets while it is decoded.

    Values are floats without a full scale, in units of the light that fills a pixel in the shortest exposure; the
    response is undone, so that the capture that holds this stack is linear. NaN where all exposures are saturated. Not
    where things move between exposures, nor for a flickering lamp, whose light is not proportional to the time.

    Parameters
    ----------
    sources : tuple of ImageStack
        One stack an exposure, of the same lights in the same order.
    times : sequence of float
        How long each was exposed; only ratios matter, so that gain and aperture may be part of it [s].
    response : Response
        Camera response to undo.
    darks : sequence of (float array (h, w, c) or None), optional
        Level without the light, one an exposure, in linear pixel values.

    Raises
    ------
    InputError
        If the stacks differ in shape, type or full scale, or there are other numbers of times and dark levels, or a
        time is not positive.
    """

    def __init__(
        self,
        sources: tuple[ImageStack, ...],
        times: npt.ArrayLike,
        *,
        response: Response = LINEAR,
        darks: tuple[FloatArray | None, ...] | None = None,
    ) -> None:
        seconds = checked_times(times, len(sources))
        first = sources[0]
        alike = {(one.shape, one.dtype, one.white, one.saturates) for one in sources}
        levels = (None,) * len(sources) if darks is None else darks
        if len(alike) > 1 or len(levels) != len(sources):
            raise InputError(
                given=f"The {len(sources)} exposures have the shapes {', '.join(str(one.shape) for one in sources)} "
                f"and {len(levels)} dark levels.",
                needed="Each light's exposures are images of one size, type and full scale.",
                remedy="Convert them alike; give as many images of each exposure time as there are lights.",
            )
        self.sources, self.times, self.response, self.darks = sources, seconds, response, levels
        self.shape = first.shape
        self.dtype = np.dtype(np.float64 if first.dtype == np.float64 else np.float32)
        self.white = 1.0
        self.saturates = False
        self.names = tuple(f"{name} and {len(sources) - 1} more" for name in first.names)

    def frame(self, index: int) -> Array:
        """Merge the exposures of one light; see :meth:`ImageStack.frame`."""
        frames = [source.frame(index) for source in self.sources]
        light, _ = merge_exposures(
            frames, self.times, response=self.response, white=self.sources[0].white, darks=self.darks
        )
        return np.asarray(light, self.dtype)


def merge_exposures(
    frames: list[Array],
    times: npt.ArrayLike,
    *,
    response: Response = LINEAR,
    white: float,
    darks: tuple[FloatArray | None, ...] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Merge exposures of one scene by the noise that each has of the light.

    Parameters
    ----------
    frames : list of array (h, w, c)
        The exposures in their own numbers.
    times : sequence of float
        Exposure times; only ratios matter [s].
    response : Response
        Camera response to undo.
    white : float
        Value of full scale.
    darks : sequence of (float array (h, w, c) or None), optional
        Level without the light of each, in linear pixel values.

    Returns
    -------
    light : float64 array (h, w, c)
        In units of the light that fills a pixel in the shortest exposure; NaN where no exposure tells [1].
    error : float64 array (h, w, c)
        Standard error that rounding and the noise of photons leave, by a full well of 10 000 electrons, in the same
        unit.

    Raises
    ------
    InputError
        If times do not fit.

    References
    ----------
    .. [1] P. E. Debevec, J. Malik, "Recovering High Dynamic Range Radiance Maps from Photographs", SIGGRAPH 1997.
       doi:10.1145/258734.258884
    """
    seconds = checked_times(times, len(frames))
    relative = seconds / seconds.min()
    levels = (None,) * len(frames) if darks is None else darks
    step = 1.0 / white if frames[0].dtype.kind == "u" else 1.0 / 65535.0
    light, trust, noise = [], [], []
    for frame, time, dark in zip(frames, relative, levels, strict=True):
        share = np.asarray(frame, np.float64) / white
        level = 0.0 if dark is None else np.asarray(dark, np.float64) / white
        light.append((np.asarray(response.linearise(frame, white), np.float64) / white - level) / time)
        trust.append(_trust(share, step, longest=bool(time == relative.max())))
        noise.append(_rounding(response, share, step) / time)
    stacked, trusted, rounding = np.stack(light), np.stack(trust), np.stack(noise)
    exposure = relative.reshape(-1, 1, 1, 1)
    # Weights by what all exposures say of the light, not by each one's own value: noise would weigh itself.
    first = _mean(stacked, trusted * exposure)
    variance = rounding**2 + np.maximum(first, 0.0) / (_FULL_WELL * exposure)
    weight = trusted / np.where(variance > 0, variance, np.inf)
    merged = _mean(stacked, weight)
    with np.errstate(invalid="ignore", divide="ignore"):
        error = np.sqrt((weight * weight * variance).sum(axis=0)) / weight.sum(axis=0)
    return merged, np.where(np.isfinite(merged), error, np.nan)


def checked_times(times: npt.ArrayLike, count: int) -> FloatArray:
    """Return exposure times, float64 (k,), or refuse what cannot be such."""
    seconds = np.asarray(times, np.float64)
    if count < 1 or seconds.shape != (count,) or not ((seconds > 0) & np.isfinite(seconds)).all():
        raise InputError(
            given=f"There are {count} exposures and the times {str(seconds.tolist())[:60]}.",
            needed="One positive time each.",
            remedy="Give the exposure times in seconds, in the order of the photographs.",
        )
    return seconds


def _trust(share: FloatArray, step: float, *, longest: bool) -> FloatArray:
    """Return weights that fade towards full scale, and towards zero but in the longest exposure."""
    top = np.clip((_NEARLY_WHITE - share) / (_NEARLY_WHITE - _FADES), 0.0, 1.0)
    low = 1.0 if longest else np.clip(share / (_STEPS * step), 0.0, 1.0)
    smooth = top * low
    return np.where(np.isfinite(share), smooth * smooth * (3.0 - 2.0 * smooth), 0.0)


def _rounding(response: Response, share: FloatArray, step: float) -> FloatArray:
    """Return what a step of the values is worth in light, as a standard error of rounding."""
    if response.is_linear:
        return np.full(share.shape, step / np.sqrt(12.0))
    up, down = response.curve(share + step), response.curve(np.maximum(share - step, 0.0))
    return np.asarray((up - down) / 2.0 / np.sqrt(12.0))


def _mean(light: FloatArray, weight: FloatArray) -> FloatArray:
    total = weight.sum(axis=0)
    summed = (np.where(weight > 0, light, 0.0) * weight).sum(axis=0)
    return np.asarray(np.divide(summed, total, out=np.full(total.shape, np.nan), where=total > 0))
