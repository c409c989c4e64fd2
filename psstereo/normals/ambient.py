"""Least squares with ambient light, or a dark level, as a fourth unknown of every pixel."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from psstereo.errors import OptionError, RigError
from psstereo.flags import Flag, fatal_mask
from psstereo.kernels.robust_losses import weight_slope
from psstereo.kernels.robust_settings import LOSSES
from psstereo.lights import Rig
from psstereo.normals.ambient_fit import LevelFactor, LevelFit, fit_all_lit, fit_level, reweighted
from psstereo.normals.moments import angular_covariance
from psstereo.normals.solver import NormalSolver, PixelNormals, Samples
from psstereo.normals.verdict import Verdict, VerdictArray
from psstereo.types import BoolArray, FlagArray, FloatArray

__all__ = ["AmbientLeastSquares"]

_PART = 256
"""Pixels fitted at once; their values stay in the cache, and what is computed on the way stays small."""

_ONE_CIRCLE = 1e-3
"""Least over largest singular value of the lights about their mean, below which they count as one circle."""

_GRAZING = 1e-6
"""Share of the strongest light's part below which a light does not help to tell the normal."""

_IGNORED = 0.25
"""Share of its weight that an observation must keep to count as used."""

_ROUNDS = 300


@dataclass(frozen=True, kw_only=True)
class AmbientLeastSquares(NormalSolver[LevelFactor]):
    """Least squares for normal, albedo and a constant: ``I_i = a + max(0, l_i · b)`` [1]_.

    The constant a takes up room light, stray light and a dark level, which need not be the same at any two pixels.
    Observations in shadow show it alone, so they help instead of being left out. Lights of different strength must be
    those of equal exposure: brightness is divided by each light's strength, and the constant with it.

    Not where a dark image can be taken: subtracting it costs no unknown. The fourth unknown makes normals noisier, much
    so if all lights stand at about the same elevation, which the error bars show; a ring of lights at one elevation is
    refused, since tilting all normals alike would do what the constant does.

    Attributes
    ----------
    gate : Gate
        Whether shadows are looked for, and saturated observations left out; without the former all observations are
        fitted as lit.
    loss : {"none", "huber", "cauchy"}
        Weighting of large residuals, of highlights for instance: ``none`` for plain least squares.

    References
    ----------
    .. [1] A. Yuille, D. Snow, R. Epstein, P. Belhumeur, "Determining Generative Models of Objects Under Varying
       Illumination: Shape and Albedo from Multiple Images Using SVD and Integrability", International Journal of
       Computer Vision 35(3), 1999.
    """

    name: ClassVar[str] = "ambient"
    summary: ClassVar[str] = "Lambert's law and an unknown level of ambient light or dark current at each pixel"
    assumes: ClassVar[str] = "the surface is matte, and something adds the same to all images of a pixel"
    avoid: ClassVar[str] = "a dark image was subtracted, or all lights stand at about the same elevation"
    least_lights: ClassVar[int] = 4
    pays_from: ClassVar[int] = 6
    unknowns: ClassVar[int] = 4
    loss: Literal["none", "huber", "cauchy"] = "none"

    def __post_init__(self) -> None:
        if self.loss not in ("none", "huber", "cauchy"):
            raise OptionError(
                given=f"The loss is {self.loss!r}.", needed="none, huber or cauchy.", remedy="Choose one of them."
            )

    def prepare(self, rig: Rig, pixels: int | None = None) -> LevelFactor:
        """Factor the light matrix about its mean; see :meth:`NormalSolver.prepare`."""
        del pixels  # linear algebra in parts is as fast without compiled code
        self.require_lights(rig)
        spread = np.linalg.svd(rig.directions - rig.directions.mean(axis=0), compute_uv=False)
        if not spread[2] > _ONE_CIRCLE * spread[0]:
            raise RigError(
                given=f"The {len(rig)} lights stand on one circle, such as a ring at one elevation.",
                needed="With ambient light unknown, lights of different elevation are needed: on one circle a constant"
                " cannot be told from a tilt of the normals.",
                remedy="Take a dark image and subtract it, add a light at another elevation (straight above, for"
                " instance), or use the solver least-squares.",
            )
        return LevelFactor.from_rig(rig)

    def solve(self, state: LevelFactor, samples: Samples) -> PixelNormals:
        """Fit every pixel; see :meth:`NormalSolver.solve`."""
        count = samples.values.shape[1]
        found = _nothing_yet(samples)
        for start in range(0, count, _PART):
            where = slice(start, min(start + _PART, count))
            self._solve_part(state, samples, where, found)
        return found

    def _solve_part(self, rig: LevelFactor, samples: Samples, where: slice, found: PixelNormals) -> None:
        raw = np.asarray(samples.values[:, where], np.float64)
        usable = np.isfinite(raw)
        given = np.ones(raw.shape) if samples.weights is None else np.asarray(samples.weights[:, where], np.float64)
        usable &= given > 0
        given = np.where(usable, given, 0.0)
        values = np.where(usable, raw, 0.0)
        if self.gate.shadow:
            fit, settled = fit_level(rig, values, given)
        else:
            fit, settled = fit_all_lit(rig, values, given), np.ones(values.shape[1], np.bool_)
        free = np.maximum(usable.sum(axis=0) - 4.0, np.finfo(np.float64).tiny)
        power = fit.squares / free
        if self.loss != "none":
            fit, power, calm = self._reweight(rig, values, fit, free)
            settled = settled & calm
        _Part(rig, values, usable, given, fit, power, settled, self.gate.shadow).write(found, where)

    def _reweight(
        self, rig: LevelFactor, values: FloatArray, plain: LevelFit, free: FloatArray
    ) -> tuple[LevelFit, FloatArray, BoolArray]:
        """Return the robust fit, the variance that goes with its matrix, and where it settled."""
        number, tuning = list(LOSSES).index(self.loss), LOSSES[self.loss]
        fit, relative, settled = reweighted(rig, values, plain, number, tuning, rounds=_ROUNDS, gate=self.gate.shadow)
        usable = plain.weights > 0
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.where(usable, fit.weights / plain.weights, 0.0)
            # Huber's variance of an M-estimate: the mean of (w r)² over the square of the mean slope, times the inverse
            # of the matrix without w. That with w is smaller by about the mean of w.
            slope = np.where(usable, weight_slope(number, relative / tuning), 0.0)
            power = (plain.weights * (share * fit.residual) ** 2).sum(axis=0) / free
            power *= usable.sum(axis=0) * share.sum(axis=0) / slope.sum(axis=0) ** 2
        return fit, np.asarray(power), settled


def _nothing_yet(samples: Samples) -> PixelNormals:
    shape = samples.values.shape
    return PixelNormals(
        scaled=np.full((shape[1], 3), np.nan),
        uncertainty=np.full(shape[1], np.nan),
        flags=np.zeros(shape[1], np.uint16),
        used=np.zeros(shape[1], np.uint16),
        covariance=np.full((shape[1], 6), np.nan) if samples.covariance else None,
        verdicts=np.full(shape, Verdict.USED, np.uint8) if samples.verdicts else None,
        ambient=np.full(shape[1], np.nan),
    )


@dataclass(frozen=True, eq=False)
class _Part:
    """Some pixels, fitted."""

    rig: LevelFactor
    values: FloatArray
    usable: BoolArray
    given: FloatArray
    fit: LevelFit
    power: FloatArray
    settled: BoolArray
    gated: bool

    def write(self, found: PixelNormals, where: slice) -> None:
        """Put normals, levels, spread, flags and what else was asked for into the answer."""
        scaled = self.rig.r_inverse @ self.fit.x
        albedo = np.sqrt((scaled * scaled).sum(axis=0))
        flags = self.flags()
        flags[~fatal_mask(flags) & ~((albedo > 0) & (albedo < np.inf))] |= np.uint16(Flag.NOT_FINITE)
        lost = fatal_mask(flags)
        scaled[:, lost] = np.nan
        available = self.usable.sum(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            unit = angular_covariance(self.rig.r_inverse, self.fit.factor, scaled / albedo)
            covariance = unit * (np.where(available > 4, self.power, np.nan) / albedo**2)[:, None]
        found.scaled[where], found.flags[where] = scaled.T, flags
        found.uncertainty[where] = np.sqrt(covariance[:, 0] + covariance[:, 2] + covariance[:, 5])
        # the level takes one observation, so that three less than this are the degrees of freedom
        found.used[where] = np.maximum(available - 1, 0)
        if found.ambient is not None:
            found.ambient[where] = np.where(lost, np.nan, self.fit.level)
        if found.covariance is not None:
            found.covariance[where] = covariance
        if found.verdicts is not None:
            found.verdicts[:, where] = self.verdicts()

    def verdicts(self) -> VerdictArray:
        """Say what was made of each observation; those in shadow told the level."""
        lit, residual = self.fit.lit, self.fit.residual
        verdicts = np.where(lit, np.uint8(Verdict.USED), np.uint8(Verdict.SHADOW))
        ignored = lit & (self.fit.weights < _IGNORED * self.given)
        verdicts[ignored & (residual > 0)] = Verdict.HIGHLIGHT
        verdicts[ignored & (residual <= 0)] = Verdict.DARK_OUTLIER
        verdicts[~self.usable] = Verdict.UNUSABLE
        return np.asarray(verdicts)

    def flags(self) -> FlagArray:
        """Say why there is no normal, or what to be careful with."""
        usable, lit = self.usable, self.fit.lit
        available = usable.sum(axis=0)
        direct = np.where(lit & usable, self.rig.direct @ self.fit.x, 0.0)
        direct = direct if self.gated else np.abs(direct)
        high = np.where(usable, self.values, -np.inf).max(axis=0)
        low = np.where(usable, self.values, np.inf).min(axis=0)
        with np.errstate(invalid="ignore"):
            few = ((direct > _GRAZING * direct.max(axis=0)).sum(axis=0) < 3) | (available < 4)
            unlit = (available > 1) & (high <= low)
            few |= unlit
        marks = (
            (few, Flag.TOO_FEW_LIGHTS),
            (~np.isfinite(self.fit.squares) & ~few, Flag.RANK_DEFICIENT),
            (available == 4, Flag.NO_REDUNDANCY),
            (unlit, Flag.NO_SIGNAL),
            (available < len(usable), Flag.UNUSABLE_SAMPLE),
            ((~lit & usable).any(axis=0), Flag.SHADOWED),
            (~self.settled, Flag.NOT_CONVERGED),
        )
        flags = np.zeros(len(available), np.uint16)
        for condition, flag in marks:
            np.bitwise_or(flags, np.uint16(flag), out=flags, where=condition)
        return flags
