"""Albedo error after one scale: relative albedo is known up to a factor."""

from dataclasses import dataclass

import numpy as np

from psstereo.errors import InputError
from psstereo.types import BoolArray, FloatArray

__all__ = ["AlbedoError", "albedo_error"]


@dataclass(frozen=True, kw_only=True)
class AlbedoError:
    """Relative error ``|scale · estimate − truth| / truth`` of an albedo map.

    Attributes
    ----------
    median, mean, rms, p95 : float
        Median, mean, root mean square and 95th percentile of the relative error [1].
    scale : float
        Median ratio of truth and estimate, applied before comparing; 1 when no scale was asked for [1].
    count : int
        Compared values (pixels times channels).
    missing : int
        Values with a truth but without an estimate; they are not in the statistics.
    coverage : float
        Compared values over compared and missing ones [1].
    """

    median: float
    mean: float
    rms: float
    p95: float
    scale: float
    count: int
    missing: int
    coverage: float


def albedo_error(
    estimate: FloatArray, truth: FloatArray, mask: BoolArray | None = None, *, fit_scale: bool = True
) -> AlbedoError:
    """Compare an albedo map with the truth.

    One scale is shared by all channels, so a wrong colour balance counts as an error.

    Parameters
    ----------
    estimate, truth : float arrays (h, w) or (h, w, c)
        Albedo; NaN where there is none. Only values with a positive truth are compared [1].
    mask : bool array (h, w), optional
        Pixels to compare; all of them when left out.
    fit_scale : bool
        Scale the estimate by the median ratio first. Switch it off to compare reflectances with a known scale.

    Returns
    -------
    AlbedoError
        Relative errors, computed in float64.

    Raises
    ------
    InputError
        If the shapes differ, nothing can be compared, or the median ratio is not positive and finite.

    Examples
    --------
    >>> albedo_error(np.array([[1.0, 2.0]]), np.array([[3.0, 6.0]])).scale
    3.0
    """
    guess, reference = np.asarray(estimate, dtype=np.float64), np.asarray(truth, dtype=np.float64)
    inside = np.ones(reference.shape[:2], dtype=np.bool_) if mask is None else np.asarray(mask, dtype=np.bool_)
    if guess.shape != reference.shape or reference.ndim not in (2, 3) or inside.shape != reference.shape[:2]:
        raise InputError(
            given=f"The estimate has shape {guess.shape}, the truth {reference.shape}, the mask {inside.shape}.",
            needed="Both maps have to be (h, w) or (h, w, c) alike, and the mask (h, w).",
            remedy="Crop, resample or convert one of them.",
        )
    within = inside if reference.ndim == 2 else inside[..., None]
    known = within & np.isfinite(reference) & (reference > 0)
    both = known & np.isfinite(guess)
    count, missing = int(np.count_nonzero(both)), int(np.count_nonzero(known & ~both))
    if count == 0:
        raise InputError(
            given="No pixel has both an estimated and a positive true albedo.",
            needed="At least one is needed.",
            remedy="Check the mask, and that both maps belong to the same view.",
        )
    scale = _median_ratio(guess[both], reference[both]) if fit_scale else 1.0
    error = np.abs(scale * guess[both] - reference[both]) / reference[both]
    return AlbedoError(
        median=float(np.median(error)),
        mean=float(np.mean(error)),
        rms=float(np.sqrt(np.mean(error**2))),
        p95=float(np.percentile(error, 95)),
        scale=scale,
        count=count,
        missing=missing,
        coverage=count / (count + missing),
    )


def _median_ratio(estimate: FloatArray, truth: FloatArray) -> float:
    """Return the median of truth over estimate where the estimate is positive."""
    positive = estimate > 0
    if not positive.any():
        raise InputError(
            given="The estimated albedo is nowhere positive.",
            needed="A scale between estimate and truth has to be found.",
            remedy="Check the estimate, or compare with fit_scale=False.",
        )
    return float(np.median(truth[positive] / estimate[positive]))
