"""The answer at the final surface: normals with error bars and flags."""

from typing import NamedTuple

import numpy as np

from psstereo.flags import Flag, fatal_mask
from psstereo.kernels.near import FEW, NearFit
from psstereo.near.alternate import Alternation
from psstereo.near.exemplars import Exemplars, blended, fit_exemplars
from psstereo.near.fit import fit_level
from psstereo.near.level import Level
from psstereo.near.reflectance import Reflectance
from psstereo.normals.moments import angular_spread, cholesky
from psstereo.normals.solver import PixelNormals
from psstereo.types import FlagArray, FloatArray, IntArray

__all__ = ["FinalFit", "final_fit"]

_NORMAL = 1.4826
"""Standard deviation of Gaussian noise over the median of its magnitude [1]."""

_LEAST_NOISE = 1e-4
"""Scale below which residuals are taken for rounding, as a share of the mean brightness."""

_ROUNDS = 5

_MOST = 0.5
"""Share from which a pixel's remarks are those of the exemplars [1]."""

_WIDER = 1.127
"""Factor on error bars where Tukey's weights were used: they shrink what is far out, even where all of it is noise. The
estimate's variance is E[ψ²]/E[ψ′]² = 1.053 of that of least squares, while weighted residuals over weighted moments
promise E[wr²]/E[w] = 0.828 (Gaussian noise, end at 4.685 deviations)."""


class FinalFit(NamedTuple):
    """The answer at the final surface.

    Attributes
    ----------
    channels : list of PixelNormals
        Scaled normals, uncertainty and flags, one a value of the samples.
    noise : float
        Median over the pixels of a residual's standard deviation, as a share of the mean brightness [1].
    residual : float
        Length of all residuals over that of all values, both weighted as in the fit by Lambert's law [1].
    glossy : float or None
        Share of the pixels whose normals are mostly those of exemplars; None if there are none [1].
    """

    channels: list[PixelNormals]
    noise: float
    residual: float
    glossy: float | None = None


def final_fit(
    alternation: Alternation, level: Level, q: FloatArray, fit: NearFit, reflectance: Reflectance
) -> FinalFit:
    """Fit all pixels once more, with a scale from their own residuals.

    While the geometry was looked for, a residual of a tenth of the brightness counted as large, whatever the noise. Now
    that the surface is known, each pixel's residuals tell its noise; where few lamps make that uncertain it is not
    taken for less than is usual in the image. The loss is Tukey's, and begins from the former fit. Exemplars are fitted
    last, from there.

    Parameters
    ----------
    alternation : Alternation
        Lamps and method.
    level : Level
        The full image.
    q : float64 array (p,)
        The surface.
    fit : NearFit
        The former fit.
    reflectance : Reflectance
        What the surface is taken for.

    Returns
    -------
    FinalFit
        The answer.
    """
    channels: list[int | None] = [None] if level.store.shape[0] == 1 else list(range(level.store.shape[0]))
    found, usual, squares, power, glossy = [], 0.0, 0.0, 0.0, 0.0
    state = reflectance.state
    begun = fit if state is None else alternation.fit(level, q)
    for channel in channels:
        now, start = begun, begun.scaled
        for _ in range(2):
            scale, usual = _scale(now, level.level)
            now = fit_level(
                level,
                alternation.lamps,
                q,
                start=start,
                scale=scale,
                rounds=_ROUNDS,
                work=alternation.work,
                channel=channel,
                over=alternation.over,
            )
            start = now.scaled
        found.append(_pixel_normals(now, level))
        if state is not None:
            scaled = found[-1].scaled
            more = fit_exemplars(
                level,
                alternation.lamps,
                q,
                scaled,
                state,
                pull=False,
                noise=reflectance.noise,
                channel=channel,
                over=alternation.over,
            )
            found[-1] = _mixed(found[-1], more, now.usable)
            glossy += float(np.mean(more.share >= _MOST)) / len(channels)
        squares, power = squares + float(np.nansum(now.squares)), power + float(np.nansum(now.power))
    residual = float(np.sqrt(squares / power)) if power > 0 else 0.0
    return FinalFit(found, usual, residual, None if state is None else glossy)


def _mixed(matte: PixelNormals, found: Exemplars, usable: IntArray) -> PixelNormals:
    """Return a channel's answer with the exemplars' share in it."""
    s, most = found.share, found.share >= _MOST
    used = np.where(most, found.used, matte.used).astype(np.uint16)
    flags = matte.flags.copy()
    flags[most] &= ~np.uint16(Flag.SHADOWED | Flag.NO_REDUNDANCY)
    flags[most & (used < usable)] |= np.uint16(Flag.SHADOWED)
    flags[most & ~found.settled] |= np.uint16(Flag.NOT_CONVERGED)
    # However the two errors hang together, their mean spreads no more than this.
    with np.errstate(invalid="ignore"):
        both = np.sqrt((1.0 - s) * matte.uncertainty**2 + s * found.uncertainty**2)
    uncertainty = np.where(s > 0, np.where(s < 1, both, found.uncertainty), matte.uncertainty)
    return PixelNormals(blended(matte.scaled, found), uncertainty, flags, used)


def _scale(fit: NearFit, brightness: FloatArray) -> tuple[FloatArray, float]:
    """Return each pixel's scale, and what is usual as a share of the brightness."""
    freedom = np.where(fit.used > 3, fit.used / np.maximum(fit.used - 3.0, 1.0), np.nan)
    own = _NORMAL * fit.deviation * np.sqrt(freedom)
    known = np.isfinite(own)
    usual = float(np.median(own[known] / brightness[known])) if known.any() else 0.0
    usual = max(usual, _LEAST_NOISE)
    return np.fmax(own, usual * brightness), usual


def _pixel_normals(fit: NearFit, level: Level) -> PixelNormals:
    scaled = fit.scaled.copy()
    albedo = np.sqrt((scaled * scaled).sum(axis=1))
    flags = _flags(fit, albedo, level)
    scaled[fatal_mask(flags)] = np.nan
    factor, _ = cholesky(fit.moments.T)
    with np.errstate(invalid="ignore", divide="ignore"):
        noise = np.sqrt(fit.squares / np.where(fit.used > 3, fit.used - 3.0, np.nan))
        spread = angular_spread(np.eye(3), factor, scaled.T / albedo)
        uncertainty = noise / albedo * spread * np.where(fit.used > FEW, _WIDER, 1.0)
    return PixelNormals(scaled, np.asarray(uncertainty), flags, fit.used.astype(np.uint16))


def _flags(fit: NearFit, albedo: FloatArray, level: Level) -> FlagArray:
    lamps = level.store.shape[1]
    flags = np.zeros(len(albedo), np.uint16)
    solved = np.isfinite(albedo)
    dark = level.level <= 1e-6 * level.level.max()
    marks = (
        (fit.used < 3, Flag.TOO_FEW_LIGHTS),
        (~solved & (fit.used >= 3), Flag.RANK_DEFICIENT),
        (fit.used == 3, Flag.NO_REDUNDANCY),
        (dark & (fit.usable > 0), Flag.NO_SIGNAL),
        (fit.usable < lamps, Flag.UNUSABLE_SAMPLE),
        (fit.used < fit.usable, Flag.SHADOWED),
    )
    for where, flag in marks:
        np.bitwise_or(flags, np.uint16(flag), out=flags, where=where)
    flags[~fatal_mask(flags) & ~(solved & (albedo > 0))] |= np.uint16(Flag.NOT_FINITE)
    return flags
