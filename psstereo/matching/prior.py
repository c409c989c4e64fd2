"""Matched depth as a prior for integration: low frequencies from stereo, detail from shading."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from psstereo.errors import InputError
from psstereo.matching.disparity import Disparity
from psstereo.matching.flags import MatchFlag
from psstereo.types import BoolArray, FloatArray

if TYPE_CHECKING:
    from psstereo.depth.prior import Prior

__all__ = ["crossover", "prior_from_disparity", "reject_by_surface"]

_SAME_ANGLE = np.radians(20.0)
_SAME_ALBEDO = 0.3


def prior_from_disparity(
    result: Disparity,
    focal: float,
    baseline: float,
    *,
    unit: str,
    shift: float = 0.0,
    sigma: float = 1.0,
    angle: float = 0.02,
) -> "Prior":
    """Turn matched disparities into a prior for integrators: σ_z = z² / (f B) σ_d.

    Filled pixels are no measurement and are left out. The integrator takes errors for independent from pixel to pixel,
    and those of smoothed matches are not: where neighbours err together over patches of k pixels, √k times the
    deviation says the same. A match errs by about a quarter of a pixel, over some sixteen pixels together. Wrong
    matches pull with the square of their error; take them out first, with :func:`reject_by_surface` for instance.

    Parameters
    ----------
    result : Disparity
        What was matched.
    focal : float
        Focal length [px].
    baseline : float
        Distance of the cameras [`unit`].
    unit : str
        Unit of the baseline, and so of the depth.
    shift : float
        Column of the right principal point minus that of the left one [px].
    sigma : float
        Deviation of a disparity where the match is clear; where the confidence is below one half it grows in inverse
        proportion to it [px].
    angle : float
        Standard error of the normals that it will be fused with [rad].

    Returns
    -------
    Prior
        Distances in the left view's pixels, for ``integrate(..., prior=...)``.

    Raises
    ------
    InputError
        If a length or a deviation is not positive, or nothing was matched.
    """
    from psstereo.depth.prior import Prior

    if not (focal > 0 and baseline > 0 and sigma > 0 and angle > 0) or not result.matched.any():
        raise InputError(
            given=f"Focal length {focal}, baseline {baseline}, deviations {sigma} and {angle}, and "
            f"{np.count_nonzero(result.matched)} matches.",
            needed="Positive numbers, and something that was matched.",
            remedy="Take them from the calibration; a pixel is a usual deviation.",
        )
    matched = replace(result, disparity=np.where(result.matched, result.disparity, np.nan))
    depth = matched.depth(focal, baseline, shift=shift)
    doubt = 0.5 / np.clip(np.asarray(result.confidence, np.float64), 0.01, 0.5)
    scatter = np.where(np.isfinite(depth), depth**2 / (focal * baseline) * sigma * doubt, np.nan)
    return Prior(depth=depth, sigma=scatter, unit=unit, angle=angle)


def crossover(sigma_depth: float, sigma_slope: float) -> float:
    """Return the wavelength at which stereo and shading know as much: 2π σ_z / σ_slope.

    Longer waves are stereo's, shorter ones shading's: a wave of amplitude a and length λ has slopes 2π a / λ.

    Parameters
    ----------
    sigma_depth : float
        Standard deviation of the depth [length].
    sigma_slope : float
        Standard deviation of the slopes that normals give [1].

    Returns
    -------
    float
        Wavelength [length].

    Raises
    ------
    InputError
        If one of them is not positive.
    """
    if not (sigma_depth > 0 and sigma_slope > 0):
        raise InputError(
            given=f"Standard deviations of {sigma_depth} and {sigma_slope}.",
            needed="Positive numbers.",
            remedy="Take the medians of the prior's sigma and of the normals' uncertainty.",
        )
    return float(2 * np.pi * sigma_depth / sigma_slope)


def reject_by_surface(
    result: Disparity,
    normals: tuple[FloatArray, FloatArray],
    albedo: tuple[FloatArray, FloatArray] | None = None,
    *,
    angle: float = _SAME_ANGLE,
    ratio: float = _SAME_ALBEDO,
) -> Disparity:
    """Take matches back whose two ends have different normals or albedos: they are different points.

    Parameters
    ----------
    result : Disparity
        What was matched.
    normals : (float array (h, w, 3), float array (h, w, 3))
        Of both views, in axes that are parallel, as those of a rectified pair are [1].
    albedo : (float array (h, w), float array (h, w)), optional
        Of both views, on the same scale [1].
    angle : float
        Largest angle between the normals of one point [rad].
    ratio : float
        Largest difference of its albedos over the larger one [1].

    Returns
    -------
    Disparity
        With NaN and the flag REJECTED there. Where one end has no normal nothing is said.

    Raises
    ------
    InputError
        If shapes disagree.
    """
    shape = result.disparity.shape
    maps = [n.shape for n in normals] + [a.shape for a in albedo or ()]
    if maps[:2] != [(*shape, 3)] * 2 or any(found != shape for found in maps[2:]):
        raise InputError(
            given=f"The disparity has the shape {shape}; normals and albedos, {maps}.",
            needed="Normals (h, w, 3) and albedos (h, w) of both views, of the images' size.",
            remedy="Solve both views of the same rectified pair, with gray albedo.",
        )
    rows, columns = np.arange(shape[0])[:, None], np.arange(shape[1])
    known = np.isfinite(result.disparity)
    target = np.rint(columns - np.where(known, result.disparity, 0)).astype(np.intp)
    inside = known & (target >= 0) & (target < shape[1])
    target = np.clip(target, 0, shape[1] - 1)
    one, two = normals[0], normals[1][rows, target]
    wrong = inside & (_angle(one, two) > angle)
    if albedo is not None:
        here, there = albedo[0], albedo[1][rows, target]
        with np.errstate(invalid="ignore"):
            wrong |= inside & (np.abs(here - there) > ratio * np.maximum(here, there))
    return _without(result, wrong)


def _without(result: Disparity, wrong: BoolArray) -> Disparity:
    flags = result.flags.copy()
    flags[wrong] |= np.uint16(MatchFlag.REJECTED)
    return replace(result, disparity=np.where(wrong, np.float32(np.nan), result.disparity), flags=flags)


def _angle(one: FloatArray, two: FloatArray) -> FloatArray:
    """Return the angle between unit vectors, NaN where either is [rad]."""
    with np.errstate(invalid="ignore"):
        apart = np.sqrt(((one - two) ** 2).sum(axis=-1))
        together = np.sqrt(((one + two) ** 2).sum(axis=-1))
        return np.asarray(2 * np.arctan2(apart, together))
