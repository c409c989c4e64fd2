"""Sparse Bayesian photometric stereo: every observation may err by as much as it needs to, but few need to.

:mod:`psstereo.kernels.sparse_bayesian` has the steps and their reasons.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from psstereo.errors import OptionError
from psstereo.flags import Flag, fatal_mask
from psstereo.kernels.dispatch import kernel
from psstereo.kernels.sparse_bayesian import BARE, DARK, ENOUGH, FAILED, IGNORED, UNSETTLED
from psstereo.lights import Rig
from psstereo.normals.least_squares import LeastSquares
from psstereo.normals.moments import RigFactor, angular_covariance, cholesky
from psstereo.normals.parts import fill, some
from psstereo.normals.solver import NormalSolver, PixelNormals, Samples
from psstereo.normals.verdict import Verdict, VerdictArray
from psstereo.types import BoolArray, FlagArray, FloatArray, IntArray

__all__ = ["SparseBayesian", "SparseBayesianState"]

_BREAK_EVEN = 5e5
"""Samples from which compiled code is sooner done: about 0.3 ms a pixel of 96 lights without it, 10 µs and 1 s with."""

_FLOOR = 1e-3
"""Least standard deviation that an estimate of the noise may reach, as a share of the pixel's brightest value."""


@dataclass(frozen=True, eq=False)
class SparseBayesianState:
    """What all pixels share.

    Attributes
    ----------
    rig : RigFactor
        The light matrix, factored.
    iterate : callable
        The hot loop, compiled or not.
    """

    rig: RigFactor
    iterate: Callable[..., Any]


@dataclass(frozen=True, kw_only=True)
class SparseBayesian(NormalSolver[SparseBayesianState]):
    """Lambert's law with an error of unknown variance in each observation [1]_.

    The variances are those under which the data are most probable; most turn out as the noise alone, and highlights and
    cast shadows stand out. Attached shadows are gated by the fit. The noise is told from each pixel's lower residuals,
    so that the same default serves noisy and perfect images: with it held at a thousandth of the brightest value, as
    was published for synthetic images, noisy observations are taken for errors. Not where more than about 40 % of the
    lit observations of a pixel disagree with Lambert's law; with fewer than five of them it is least squares.

    Attributes
    ----------
    gate : Gate
        Which observations are left out; without shadow gate shadows are errors like others.
    noise : float or None
        Standard deviation of the noise, as a share of the pixel's brightest value; told from the pixel if absent [1].
    rounds : int
        Most rounds; a pixel that needs more is flagged.
    tolerance : float
        Change of the scaled normal in a round, over its length, below which a pixel is done [1].

    References
    ----------
    .. [1] S. Ikehata, D. Wipf, Y. Matsushita, K. Aizawa, "Robust photometric stereo using sparse regression",
       CVPR 2012.
       doi:10.1109/CVPR.2012.6247691
    """

    name: ClassVar[str] = "sparse-bayesian"
    summary: ClassVar[str] = (
        "Lambert's law with an error of its own in each observation, most of them no more than noise"
    )
    assumes: ClassVar[str] = "the surface is matte but for highlights and cast shadows in less than 40 % of its images"
    avoid: ClassVar[str] = "the surface is metal, or there are fewer than eight lights"
    pays_from: ClassVar[int] = 8
    noise: float | None = None
    rounds: int = 100
    tolerance: float = 1e-5

    def __post_init__(self) -> None:
        sound = (self.noise is None or 0 < self.noise < np.inf) and self.rounds >= 1 and 0 < self.tolerance < 1
        if not sound:
            raise OptionError(
                given=f"The sparse Bayesian solver is given noise {self.noise}, {self.rounds} rounds and the tolerance "
                f"{self.tolerance}.",
                needed="Noise above 0, one round or more, and a tolerance between 0 and 1.",
                remedy="Correct them, or leave them out.",
            )

    def prepare(self, rig: Rig, pixels: int | None = None) -> SparseBayesianState:
        """Factor the light matrix and choose the loop; see :meth:`NormalSolver.prepare`."""
        self.require_lights(rig)
        work = None if pixels is None else float(pixels) * len(rig)
        return SparseBayesianState(RigFactor.from_rig(rig), kernel("sparse_bayesian", "iterate", work, _BREAK_EVEN))

    def solve(self, state: SparseBayesianState, samples: Samples) -> PixelNormals:
        """Fit every pixel; see :meth:`NormalSolver.solve`."""
        rig = state.rig
        values = np.ascontiguousarray(samples.values.T, np.float64)
        weights = np.zeros((0, 0))
        if samples.weights is not None:
            weights = np.ascontiguousarray(samples.weights.T, np.float64)
        x, a, spread, counts, shares = state.iterate(
            values,
            weights,
            np.ascontiguousarray(rig.q.T),
            rig.moments,
            rig.r_inverse,
            self.gate.shadow,
            -1.0 if self.noise is None else self.noise,
            _FLOOR,
            self.rounds,
            self.tolerance,
        )
        scaled: FloatArray = np.ascontiguousarray(x @ rig.r_inverse.T)
        albedo = np.sqrt((scaled * scaled).sum(axis=1))
        flags = _flags(values, counts)
        flags[~fatal_mask(flags) & ~((albedo > 0) & (albedo < np.inf))] |= np.uint16(Flag.NOT_FINITE)
        scaled[fatal_mask(flags)] = np.nan
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            unit = angular_covariance(rig.r_inverse, cholesky(a.T)[0], (scaled / albedo[:, None]).T)
            covariance = unit * (spread / albedo / albedo)[:, None]
        found = PixelNormals(
            scaled=scaled,
            uncertainty=np.sqrt(covariance[:, 0] + covariance[:, 2] + covariance[:, 5]),
            flags=flags,
            used=counts[:, 4].astype(np.uint16),
            covariance=covariance if samples.covariance else None,
            verdicts=_verdicts(shares) if samples.verdicts else None,
        )
        if self.gate.shadow:
            # Shadows that are no rare errors any more are the least-squares gate's to judge, and so are those among so
            # few observations that none can be told to err: the model may call a shadow lit, and then it stays in.
            unsure = _against(values, x @ rig.q.T, albedo, shares) | (counts[:, 3] < ENOUGH)
            again = np.flatnonzero(unsure & ~fatal_mask(flags))
            if len(again):
                fill(found, again, LeastSquares(gate=self.gate).solve(rig, some(samples, again)))
        return found


def _against(values: FloatArray, predicted: FloatArray, albedo: FloatArray, shares: FloatArray) -> BoolArray:
    """Return where too many observations are dark though the model (p, m) calls them lit, or the reverse, (p,)."""
    with np.errstate(invalid="ignore"):
        front = (predicted > DARK * albedo[:, None]) & np.isfinite(values)
        bright = values > DARK * np.fmax.reduce(values, axis=1)[:, None]
        fitted = np.abs(shares) < 1.5  # the choice was held while the fit still moved, so it may be another one
    against = (front ^ bright) | (fitted ^ bright)
    return np.asarray(3 * against.sum(axis=1) >= np.maximum((front | bright | fitted).sum(axis=1), 1))


def _flags(values: FloatArray, counts: IntArray) -> FlagArray:
    outcome, _, available, lit, _ = counts.T
    with np.errstate(invalid="ignore"):
        enough = lit >= 3
    flags = np.zeros(len(values), np.uint16)
    marks = (
        ((outcome == BARE) & (available > 0), Flag.NO_SIGNAL),
        ((outcome >= FAILED) & ~enough, Flag.TOO_FEW_LIGHTS),
        ((outcome == FAILED) & enough, Flag.RANK_DEFICIENT),
        (outcome == UNSETTLED, Flag.NOT_CONVERGED),
        ((outcome < FAILED) & (lit == 3), Flag.NO_REDUNDANCY),
        (available < values.shape[1], Flag.UNUSABLE_SAMPLE),
        (lit < available, Flag.SHADOWED),
    )
    for where, flag in marks:
        flags[where] |= np.uint16(flag)
    return flags


def _verdicts(shares: FloatArray) -> VerdictArray:
    """Return what was made of each observation, (m, p), from its share; see the kernel."""
    verdicts = np.full(shares.shape, Verdict.USED, np.uint8)
    with np.errstate(invalid="ignore"):
        size = np.abs(shares)
        verdicts[(size < IGNORED) & (shares > 0)] = Verdict.HIGHLIGHT
        verdicts[(size < IGNORED) & (shares <= 0)] = Verdict.DARK_OUTLIER
        verdicts[size > 1.5] = Verdict.SHADOW
    verdicts[np.isnan(shares)] = Verdict.UNUSABLE
    return np.ascontiguousarray(verdicts.T)
