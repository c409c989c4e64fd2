"""Height error after a stated alignment: integration leaves a constant or a scale free, so say how it was removed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from psstereo.errors import InputError, OptionError
from psstereo.types import BoolArray, FloatArray

__all__ = ["ALIGNMENTS", "HeightError", "height_error"]


@dataclass(frozen=True, kw_only=True)
class HeightError:
    """Error of a height or depth map after ``scale · estimate + offset``.

    Attributes
    ----------
    rmse, mean_abs, median_abs, max_abs : float
        Root mean square, mean, median and largest absolute difference [unit].
    alignment : str
        Name of the alignment, a key of :data:`ALIGNMENTS`.
    scale : float
        Factor applied to the estimate [1].
    offset : float
        Constant added after that [unit].
    count : int
        Compared pixels.
    missing : int
        Pixels with a truth but without an estimate; they are not in the statistics.
    coverage : float
        Compared pixels over compared and missing ones [1].
    unit : str
        Unit of the truth, as given by the caller.
    """

    rmse: float
    mean_abs: float
    median_abs: float
    max_abs: float
    alignment: str
    scale: float
    offset: float
    count: int
    missing: int
    coverage: float
    unit: str


def _none(_estimate: FloatArray, _truth: FloatArray) -> tuple[float, float]:
    """Leave the estimate as it is."""
    return 1.0, 0.0


def _offset(estimate: FloatArray, truth: FloatArray) -> tuple[float, float]:
    """Remove the mean difference (least squares over the offset)."""
    return 1.0, float(np.mean(truth - estimate))


def _median_offset(estimate: FloatArray, truth: FloatArray) -> tuple[float, float]:
    """Remove the median difference (least absolute differences over the offset)."""
    return 1.0, float(np.median(truth - estimate))


def _scale(estimate: FloatArray, truth: FloatArray) -> tuple[float, float]:
    """Scale by the median ratio, the alignment of perspective depth."""
    usable = estimate != 0
    if not usable.any():
        raise _flat("zero everywhere", "scale")
    factor = float(np.median(truth[usable] / estimate[usable]))
    return factor, 0.0


def _affine(estimate: FloatArray, truth: FloatArray) -> tuple[float, float]:
    """Fit scale and offset by least squares."""
    centred = estimate - np.mean(estimate)
    power = float(np.sum(centred**2))
    if power <= (np.finfo(np.float64).eps * float(np.max(np.abs(estimate), initial=0.0))) ** 2 * estimate.size:
        raise _flat("constant", "affine")
    factor = float(np.sum(centred * (truth - np.mean(truth)))) / power
    return factor, float(np.mean(truth) - factor * np.mean(estimate))


def _flat(what: str, alignment: str) -> InputError:
    return InputError(
        given=f"The estimate is {what}.",
        needed=f"The alignment '{alignment}' has to find a scale, which needs values that differ.",
        remedy="Use the alignment 'offset' or 'none'.",
    )


ALIGNMENTS: Mapping[str, Callable[[FloatArray, FloatArray], tuple[float, float]]] = {
    "none": _none,
    "offset": _offset,
    "median-offset": _median_offset,
    "scale": _scale,
    "affine": _affine,
}
"""Alignments by name; each takes estimate and truth as float64 (p,) and returns scale [1] and offset [unit]."""


def height_error(
    estimate: FloatArray,
    truth: FloatArray,
    mask: BoolArray | None = None,
    *,
    alignment: str = "offset",
    unit: str = "px",
) -> HeightError:
    """Compare a height or depth map with the truth.

    One alignment is applied to the whole map. Components that are not connected each have a free constant of their
    own: call this once per component then.

    Parameters
    ----------
    estimate, truth : float arrays (h, w)
        Heights or depths; NaN where there is none [unit].
    mask : bool array (h, w), optional
        Pixels to compare; all of them when left out.
    alignment : str
        ``"none"``; ``"offset"``: mean difference removed, fits orthographic heights; ``"median-offset"``: median
        difference removed, less moved by a discontinuity; ``"scale"``: median ratio, fits perspective depth;
        ``"affine"``: scale and offset by least squares, fits heights of unknown unit.
    unit : str
        Unit of the truth, kept for the report.

    Returns
    -------
    HeightError
        Statistics in `unit`, with the scale and offset that were used; computed in float64.

    Raises
    ------
    InputError
        If the shapes differ, no pixel has both values, or the estimate is flat and a scale is asked for.
    OptionError
        If the alignment is unknown.

    Examples
    --------
    >>> height_error(np.array([[1.0, 2.0]]), np.array([[4.0, 5.0]])).offset
    3.0
    """
    if alignment not in ALIGNMENTS:
        raise OptionError(
            given=f"The alignment is {alignment!r}.",
            needed=f"Known are {', '.join(map(repr, ALIGNMENTS))}.",
            remedy="Use 'offset' for orthographic heights, 'scale' for perspective depth.",
        )
    guess, reference = np.asarray(estimate, dtype=np.float64), np.asarray(truth, dtype=np.float64)
    inside = np.ones(reference.shape, dtype=np.bool_) if mask is None else np.asarray(mask, dtype=np.bool_)
    if not guess.shape == reference.shape == inside.shape:
        raise InputError(
            given=f"The estimate has shape {guess.shape}, the truth {reference.shape}, the mask {inside.shape}.",
            needed="All have to have the same shape.",
            remedy="Crop or resample one of them.",
        )
    known = inside & np.isfinite(reference)
    both = known & np.isfinite(guess)
    count, missing = int(np.count_nonzero(both)), int(np.count_nonzero(known & ~both))
    if count == 0:
        raise InputError(
            given="No pixel has both an estimated and a true height.",
            needed="At least one is needed.",
            remedy="Check the mask, and that both maps belong to the same view.",
        )
    scale, offset = ALIGNMENTS[alignment](guess[both], reference[both])
    error = np.abs(scale * guess[both] + offset - reference[both])
    return HeightError(
        rmse=float(np.sqrt(np.mean(error**2))),
        mean_abs=float(np.mean(error)),
        median_abs=float(np.median(error)),
        max_abs=float(np.max(error)),
        alignment=alignment,
        scale=scale,
        offset=offset,
        count=count,
        missing=missing,
        coverage=count / (count + missing),
        unit=unit,
    )
