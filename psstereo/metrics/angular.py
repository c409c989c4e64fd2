"""Angles between normals, and the summary that papers report."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from psstereo.errors import InputError, OptionError
from psstereo.types import BoolArray, FloatArray

__all__ = ["AngularSummary", "ShortTruth", "angular_error", "summarise_angles"]

ShortTruth = Literal["skip", "count-90"]
"""What happens where the truth's vector is too short to be a normal."""

_ZERO_LENGTH = 1e-12
_SHORT_TRUTH = 0.5


@dataclass(frozen=True, kw_only=True)
class AngularSummary:
    """Angular error of a normal map: a report, hence in degrees.

    All statistics are over the `count` scored pixels and are NaN when there are none. `coverage` has to be read beside
    them: a method that answers only where it is easy scores well.

    Attributes
    ----------
    mean_deg, median_deg, rmse_deg, max_deg : float
        Mean, median, root mean square and largest angle [deg].
    p25_deg, p75_deg, p95_deg, p99_deg : float
        Percentiles [deg].
    share_under_5_deg, share_under_10_deg, share_under_20_deg : float
        Share of the scored pixels whose angle is below 5, 10 and 20 degrees [1].
    count : int
        Scored pixels.
    missing : int
        Pixels with a truth but without an estimate (NaN or zero length); they are not in the statistics.
    short_truth : int
        Pixels whose truth is shorter than 0.5. They are left out (``"skip"``) or among the scored ones with 90 degrees
        (``"count-90"``); `short_truth_rule` says which.
    no_truth : int
        Pixels of the mask whose truth is not finite; never scored.
    coverage : float
        Scored pixels over scored and missing ones [1]; NaN when there is no truth at all.
    short_truth_rule : str
        ``"skip"`` or ``"count-90"``.
    """

    mean_deg: float
    median_deg: float
    rmse_deg: float
    max_deg: float
    p25_deg: float
    p75_deg: float
    p95_deg: float
    p99_deg: float
    share_under_5_deg: float
    share_under_10_deg: float
    share_under_20_deg: float
    count: int
    missing: int
    short_truth: int
    no_truth: int
    coverage: float
    short_truth_rule: ShortTruth


def angular_error(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the angle between vectors, ``atan2(|a×b|, a·b)``.

    Accurate to a few 1e-16 at every angle, unlike the arc cosine, which loses half the digits near 0 and π and steps by
    0.02 degrees in float32. Computed in float64; the vectors need not have unit length.

    Parameters
    ----------
    a, b : float arrays (..., 3)
        Vectors in one and the same frame, of shapes that broadcast [any unit].

    Returns
    -------
    float64 array (...)
        Angle in [0, π]; NaN where either vector is not finite or shorter than 1e-12 [rad].

    Raises
    ------
    InputError
        If the last axis does not have length 3 or the shapes do not broadcast.

    Examples
    --------
    >>> float(angular_error(np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 2.0]))) == np.pi / 2
    True
    """
    left, right = _scaled(a, "a"), _scaled(b, "b")
    try:
        np.broadcast_shapes(left.shape, right.shape)
    except ValueError:
        raise InputError(
            given=f"Vectors of shapes {left.shape} and {right.shape} were given.",
            needed="The shapes have to agree or broadcast.",
            remedy="Compare maps of the same size.",
        ) from None
    sine = np.linalg.norm(np.cross(left, right), axis=-1)
    cosine = np.sum(left * right, axis=-1)
    return np.asarray(np.arctan2(sine, cosine))


def summarise_angles(
    estimate: FloatArray,
    truth: FloatArray,
    mask: BoolArray | None = None,
    *,
    short_truth: ShortTruth = "skip",
) -> AngularSummary:
    """Compare a normal map with the truth.

    Parameters
    ----------
    estimate : float array (..., 3)
        Normals, mostly (h, w, 3); NaN where there is no answer [1].
    truth : float array (..., 3)
        True normals of the same shape and frame; NaN or short where there is none [1].
    mask : bool array (...), optional
        Pixels to score; all of them when left out.
    short_truth : {"skip", "count-90"}
        What to do where the truth is shorter than 0.5. ``"skip"`` leaves such pixels out. ``"count-90"`` scores them
        with 90 degrees, as DiLiGenT's own scorer does (arc cosine of zero), and needs a mask, since a background of
        zeros would be counted too.

    Returns
    -------
    AngularSummary
        Statistics in degrees, and how many pixels were not scored, by reason.

    Raises
    ------
    InputError
        If the shapes differ, or ``"count-90"`` comes without a mask.
    OptionError
        If `short_truth` is unknown.

    References
    ----------
    Shi et al., "A benchmark dataset and evaluation for non-Lambertian and uncalibrated photometric stereo", PAMI 2019,
    doi:10.1109/TPAMI.2018.2799222.
    """
    inside = _check(estimate, truth, mask, short_truth)
    answer, reference = np.asarray(estimate)[inside], np.asarray(truth)[inside]
    finite = np.asarray(np.isfinite(reference).all(axis=-1))
    lengths = np.linalg.norm(np.where(finite[..., None], reference, 0).astype(np.float64), axis=-1)
    short = finite & (lengths < _SHORT_TRUTH)
    usable = finite & ~short
    errors = angular_error(answer[usable], reference[usable])
    missing = int(np.count_nonzero(np.isnan(errors)))
    scored = errors[np.isfinite(errors)]
    if short_truth == "count-90":
        scored = np.concatenate([scored, np.full(np.count_nonzero(short), np.pi / 2)])
    degrees = np.degrees(scored)
    expected = scored.size + missing
    return AngularSummary(
        **_statistics(degrees),
        count=int(scored.size),
        missing=missing,
        short_truth=int(np.count_nonzero(short)),
        no_truth=int(np.count_nonzero(~finite)),
        coverage=scored.size / expected if expected else float("nan"),
        short_truth_rule=short_truth,
    )


def _statistics(degrees: FloatArray) -> dict[str, float]:
    """Return the statistics by field name; NaN when nothing was scored."""
    names = ("mean_deg", "median_deg", "rmse_deg", "max_deg", "p25_deg", "p75_deg", "p95_deg", "p99_deg")
    shares = {f"share_under_{limit}_deg": limit for limit in (5, 10, 20)}
    if degrees.size == 0:
        return dict.fromkeys((*names, *shares), float("nan"))
    p25, p75, p95, p99 = np.percentile(degrees, (25, 75, 95, 99))
    values = (
        np.mean(degrees), np.median(degrees), np.sqrt(np.mean(degrees**2)), np.max(degrees), p25, p75, p95, p99,
    )  # fmt: skip
    result = {name: float(value) for name, value in zip(names, values, strict=True)}
    return result | {name: float(np.mean(degrees < limit)) for name, limit in shares.items()}


def _scaled(vectors: FloatArray, name: str) -> FloatArray:
    """Return float64 vectors scaled so that products neither overflow nor underflow; unusable ones become NaN."""
    array = np.asarray(vectors, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise InputError(
            given=f"`{name}` has shape {array.shape}.",
            needed="Vectors with three components on the last axis are needed.",
            remedy="Pass normals as (h, w, 3) or (p, 3).",
        )
    largest = np.max(np.abs(array), axis=-1, keepdims=True, initial=0.0)
    usable = np.isfinite(largest) & (largest > 0)
    scaled = np.where(usable, array, np.nan) / np.where(usable, largest, 1.0)
    length = np.linalg.norm(scaled, axis=-1, keepdims=True)
    with np.errstate(over="ignore", invalid="ignore"):
        long_enough = length * largest >= _ZERO_LENGTH
    return np.asarray(np.where(long_enough, scaled / length, np.nan))


def _check(estimate: FloatArray, truth: FloatArray, mask: BoolArray | None, short_truth: str) -> BoolArray:
    """Check the input of the summary and return the mask."""
    if short_truth not in ("skip", "count-90"):
        raise OptionError(
            given=f"`short_truth` is {short_truth!r}.",
            needed="Known are 'skip' and 'count-90'.",
            remedy="Use 'skip' unless a figure of DiLiGenT's own scorer is to be reproduced.",
        )
    shape = np.shape(truth)
    if np.shape(estimate) != shape or not shape or shape[-1] != 3:
        raise InputError(
            given=f"The estimate has shape {np.shape(estimate)}, the truth {shape}.",
            needed="Both have to be normals of the same shape (..., 3).",
            remedy="Crop or resample one of the maps.",
        )
    if mask is None:
        if short_truth == "count-90":
            raise InputError(
                given="`short_truth` is 'count-90', but no mask was given.",
                needed="Without a mask, the background of zeros would be counted with 90 degrees.",
                remedy="Give the object's mask.",
            )
        return np.ones(shape[:-1], dtype=np.bool_)
    if np.shape(mask) != shape[:-1]:
        raise InputError(
            given=f"The mask has shape {np.shape(mask)}, the normals {shape}.",
            needed="The mask has to have the normals' shape without the last axis.",
            remedy="Give the mask that belongs to these normals.",
        )
    return np.asarray(mask, dtype=np.bool_)
