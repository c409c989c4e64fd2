"""What rounding to whole numbers does to normals: the least that an error bar may be where images are integers.

Error bars are told from the residual. That misses what rounding does where neighbouring lights round to the same level:
under a narrow cone of lights all values of a pixel agree, nothing is left over, and the normal may yet be anywhere that
a step allows. A value rounded to whole steps is off by a standard deviation of step / √12. Propagated through the least
squares of the lit observations that is a floor, below which no bar may lie.

Rounding errors are independent only where a pixel's values are spread over many steps. Values that fill K steps evenly
are pulled together by the share 1 / K² of their own slope, whatever their number n, where independent errors would move
it by 1 / (K √n); and where K falls below 1 a slope is a matter of which values happen to lie beyond the next half step.
So the floor grows by √n / K where that is more than 1, with K at least 1.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from psstereo.capture import Capture
from psstereo.normals.moments import RigFactor, angular_spread
from psstereo.normals.solver import PixelNormals
from psstereo.stack import ColourReading
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Rounding", "raise_bars", "rounding_of"]

_STEP = 1.0 / np.sqrt(12.0)
"""Standard deviation of what rounding takes away, as a share of the step [1]."""

_FAR = 30.0
"""Bars beyond this multiple of the most that rounding does under all lights are left alone: lights that do not reach
the pixel would have to leave it worse off by such a factor [1]."""

_DARK = 0.02
"""Share of the albedo below which a value counts as shadow, as in the least-squares gate."""

_PART = 256
"""Pixels looked at together; what is computed on the way stays small, and in the cache."""

_SINGULAR = 1e-10
"""Determinant over the cube of the trace below which observations do not span space [1]."""

_Curve = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, kw_only=True, eq=False)
class Rounding:
    """What a step of the images is in samples.

    Attributes
    ----------
    rig : RigFactor
        The light matrix, factored.
    directions : float64 array (m, 3)
        Its rows, unit vectors toward the lights [1].
    deviation : float64 array (k, m)
        Standard deviation of a sample by rounding, for each value that is solved and each light, where the response has
        the slope 1 [unit of the samples].
    level : float64 array (k, m)
        Share of full scale over sample: what a gray surface shows, in linear light [1 over unit of the samples].
    curve : (float64 array, float64 array) or None
        Linear light of every whole value, as a share of full scale, and the length of a step there over that of a
        linear one; None for a linear response [1].
    indices : int array (p,)
        Flat indices of the capture's pixels.
    dark : float64 array (h · w, c) or None
        Linear level without the lights, as a share of full scale [1].
    gain : float array (1, h · w, c) or (m, h · w, c) or None
        What light is multiplied by to undo the lens and unequal pixels [1].
    """

    rig: RigFactor
    directions: FloatArray
    deviation: FloatArray
    level: FloatArray
    indices: IntArray
    curve: _Curve | None = None
    dark: FloatArray | None = None
    gain: FloatArray | None = None

    @cached_property
    def steepest(self) -> float:
        """The most by which curve and gain stretch a step [1]."""
        slope = 1.0 if self.curve is None else float(self.curve[1].max())
        return slope if self.gain is None else slope * float(np.nanmax(self.gain))

    def of(self, values: FloatArray, channel: int, start: int, pixels: IntArray | None = None) -> FloatArray:
        """Return the standard deviations of samples by rounding.

        Parameters
        ----------
        values : float array (m, p)
            Samples of some pixels.
        channel : int
            Which of the values that are solved.
        start : int
            Place of the block's first pixel among those of the capture.
        pixels : int array (p,), optional
            Places of the pixels in the block; all of it if absent.

        Returns
        -------
        float64 array (m, p) or (m, 1)
            Standard deviations; NaN where the sample is, if they depend on it [unit of the samples].
        """
        deviation: FloatArray = self.deviation[channel][:, None]
        if self.curve is None and self.gain is None:
            return deviation
        where = self.indices[start + (np.arange(values.shape[1]) if pixels is None else pixels)]
        light = values * self.level[channel][:, None]
        if self.gain is not None:
            gain = self.gain[:, where].mean(axis=2, dtype=np.float64)
            deviation, light = deviation * gain, light / gain
        if self.curve is None:
            return deviation
        if self.dark is not None:
            light = light + self.dark[where].mean(axis=1, dtype=np.float64)
        return np.asarray(deviation * np.interp(light, *self.curve), np.float64)


def rounding_of(capture: Capture, channels: ColourReading, indices: IntArray) -> Rounding | None:
    """Return what a step of a capture's images is in its samples.

    Channels are taken to round independently, as those of a colour sensor do; where a projection weighs them pixel by
    pixel, they count as their mean. A curve of the camera is looked up at the level that a gray surface would have.

    Parameters
    ----------
    capture : Capture
        The capture.
    channels : ColourReading
        What becomes of its channels.
    indices : int array (p,)
        Flat indices of its pixels.

    Returns
    -------
    Rounding or None
        None for images that are not integers, or lights that are not distant.
    """
    stack, rig = capture.stack, capture.rig
    if stack.dtype.kind not in "iu" or not rig.all_distant:
        return None
    count = stack.shape[3]
    matrix = channels.weights.matrix if channels.projection is None else np.full((1, count), 1.0 / count)
    over = 1.0 / rig.strengths(count)  # (m, c)
    sums = matrix @ over.T
    with np.errstate(divide="ignore"):  # weights that cancel see no gray
        level = np.where(sums > 0, 1.0 / sums, 0.0)
    curve = None
    if not capture.response.is_linear:
        top = min(256 ** int(stack.dtype.itemsize) - 1, int(np.ceil(stack.white)))
        light = capture.response.curve(np.arange(top + 1, dtype=np.float64) / stack.white)
        curve = (light, np.abs(np.gradient(light)) * stack.white)
    return Rounding(
        rig=RigFactor.from_rig(rig),
        directions=rig.directions,
        deviation=_STEP / stack.white * np.sqrt((matrix * matrix) @ (over * over).T),
        level=level,
        indices=indices,
        curve=curve,
        dark=None if capture.dark is None else capture.dark.reshape(-1, count) / stack.white,
        gain=None if capture.flat is None else capture.flat.gain.reshape(-1, stack.shape[1] * stack.shape[2], count),
    )


def raise_bars(
    rounding: Rounding,
    part: PixelNormals,
    values: FloatArray,
    weights: FloatArray | None,
    *,
    channel: int,
    start: int,
) -> None:
    """Raise error bars that are smaller than what rounding does, in place; bars that cannot be told stay unknown.

    Do not read the floor as an error bar of its own: noise, shadows and the surface's reflectance come on top, and they
    are what the residual tells.

    Parameters
    ----------
    rounding : Rounding
        What a step is in the samples.
    part : PixelNormals
        What a solver found at some pixels.
    values : float array (m, p)
        Their samples.
    weights : float array (m, p) or None
        Weights of the observations.
    channel : int
        Which of the values that are solved.
    start : int
        Place of the first pixel among those of the capture.
    """
    albedo = np.sqrt((part.scaled * part.scaled).sum(axis=1))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        normals = part.scaled / albedo[:, None]
        largest = np.sqrt(len(values)) * rounding.steepest * float(rounding.deviation[channel].max()) / albedo
        most = largest * angular_spread(rounding.rig.r_inverse, None, normals.T)
        some = np.flatnonzero(part.uncertainty < _FAR * most)
    for first in range(0, len(some), _PART):
        few = some[first : first + _PART]
        seen, n, rho = values[:, few].astype(np.float64), normals[few], albedo[few]
        w = _taken(rounding, seen, n, rho, None if weights is None else weights[:, few])
        deviation = rounding.of(seen, channel, start, few)
        covariance = _propagated(rounding, w, w * deviation, n)
        covariance *= np.square(_alike(seen / deviation * _STEP, w > 0) / rho)[:, None, None]
        floor = np.sqrt(np.trace(covariance, axis1=1, axis2=2))
        low = floor > part.uncertainty[few]  # not where singular: nothing is known of those
        part.uncertainty[few[low]] = floor[low]
        if part.covariance is not None:
            part.covariance[few[low]] = covariance[low][:, [0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]


def _taken(
    rounding: Rounding, values: FloatArray, normals: FloatArray, albedo: FloatArray, weights: FloatArray | None
) -> FloatArray:
    """Return the weights that observations have in plain least squares: those that light reaches, all if these are few.

    A method that trusts fewer of them has a larger error, so that this stays a floor.
    """
    usable: BoolArray = np.isfinite(values)
    with np.errstate(invalid="ignore"):
        lit = usable & (rounding.directions @ normals.T > 0.0) & (values > _DARK * albedo)
    short = lit.sum(axis=0) <= 3
    lit[:, short] = usable[:, short]
    return lit.astype(np.float64) if weights is None else lit * weights


def _alike(levels: FloatArray, lit: BoolArray) -> FloatArray:
    """Return by how much errors are larger than independent ones, (p,), from samples in steps, (m, p)."""
    with np.errstate(invalid="ignore"):
        width = np.where(lit, levels, -np.inf).max(axis=0) - np.where(lit, levels, np.inf).min(axis=0)
    return np.asarray(np.maximum(np.sqrt(lit.sum(axis=0)) / np.maximum(width, 1.0), 1.0))


def _propagated(rounding: Rounding, w: FloatArray, w_deviation: FloatArray, normals: FloatArray) -> FloatArray:
    """Return the covariance of b across the normals, (p, 3, 3), for weights and noise times weights, (m, p).

    With rows q and b = R⁻¹ x, the estimate x = A⁻¹ Σ w q I has the covariance A⁻¹ (Σ w² σ² q qᵀ) A⁻¹; NaN where the
    observations do not span space.
    """
    inverse = _matrices(_inverse(rounding.rig.moments @ w))
    b = _matrices(rounding.rig.moments @ np.nan_to_num(w_deviation * w_deviation))
    through = rounding.rig.r_inverse @ inverse
    through = through - normals[:, :, None] * np.einsum("pi,pij->pj", normals, through)[:, None]
    return np.asarray(through @ b @ through.transpose(0, 2, 1))


def _inverse(a: FloatArray) -> FloatArray:
    """Return the inverses of symmetric matrices given as entries (6, p), NaN where they are singular."""
    a11, a12, a22, a13, a23, a33 = a
    c11, c12, c13 = a22 * a33 - a23 * a23, a13 * a23 - a12 * a33, a12 * a23 - a13 * a22
    determinant = a11 * c11 + a12 * c12 + a13 * c13
    sound = determinant > _SINGULAR * (a11 + a22 + a33) ** 3
    cofactors = np.stack([c11, c12, a11 * a33 - a13 * a13, c13, a12 * a13 - a11 * a23, a11 * a22 - a12 * a12])
    return np.asarray(cofactors / np.where(sound, determinant, np.nan))


def _matrices(entries: FloatArray) -> FloatArray:
    """Return symmetric matrices (p, 3, 3) from their entries 11, 12, 22, 13, 23, 33, (6, p)."""
    return np.asarray(entries[[0, 1, 3, 1, 2, 4, 3, 4, 5]].T.reshape(-1, 3, 3))
