"""Robust photometric stereo: Lambert's law fitted to the observations that agree with it.

Shadows are gated by the fit itself, highlights and other outliers lose their weight, and the loss is chosen pixel by
pixel by what the residuals look like; :mod:`psstereo.kernels.robust` has the steps and their reasons.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.catalogue import choose
from psstereo.errors import OptionError
from psstereo.flags import Flag
from psstereo.kernels.dispatch import kernel
from psstereo.kernels.robust_settings import ADAPTIVE, LOSSES, Kind, RobustFit, Settings
from psstereo.lights import Rig
from psstereo.normals.least_squares import LeastSquares
from psstereo.normals.moments import RigFactor, angular_covariance, cholesky
from psstereo.normals.parts import fill, some
from psstereo.normals.solver import NormalSolver, PixelNormals, Samples
from psstereo.types import FlagArray, FloatArray, IntArray

__all__ = ["Robust", "RobustState"]

_BREAK_EVEN = 1.5e6
"""Samples from which compiled code is sooner done: 50 µs a pixel of 96 lights without it, 4 µs and 0.6 s with it."""

_NEIGHBOURS = 3
"""Lights nearest to a light whose residuals should have nothing to do with its own."""

_EQUALLY_NEAR = 1e-9
"""Cosines that differ by less are the same."""

_DARK = 0.02
"""Share of the albedo below which a prediction counts as shadow."""

_NEVER = -1e30
"""The same where no observation counts as shadow."""

_LEAST_FOR_STEP = 6
"""Lit observations from which a robust step is taken; with fewer the outliers outvote the rest."""


@dataclass(frozen=True, eq=False)
class RobustState:
    """What all pixels share.

    Attributes
    ----------
    rig : RigFactor
        The light matrix, factored.
    neighbours : uint32 array (3, k)
        Pairs of a light and one that is near it, and how often each counts.
    settings : Settings
        Numbers of the fit.
    fit : callable
        The hot loop, compiled or not.
    """

    rig: RigFactor
    neighbours: IntArray
    settings: Settings
    fit: Callable[..., RobustFit]


@dataclass(frozen=True, kw_only=True)
class Robust(NormalSolver[RobustState]):
    """Iteratively reweighted least squares with shadows gated by the fit [1]_.

    The default loss tells three cases apart at each pixel: noise alone (Tukey's loss, nearly as sharp as least squares
    told which observations are lit), a matte surface with highlights or cast shadows (Geman–McClure's, which finds the
    majority), and a surface that is not matte (Geman–McClure's over the middle ranks of brightness, where it is
    nearest to matte). Not where most observations of a pixel disagree with Lambert's law, as on metal; and with fewer
    than six lit lights a pixel gets plain least squares, as it does where the rounds do not settle.

    Attributes
    ----------
    gate : Gate
        Whether saturated observations are left out, and those that the fit itself sees in shadow.
    loss : str
        ``"auto"``, or one of l1, huber, cauchy, geman-mcclure, tukey, welsch.
    scale : float or None
        Standard deviation of the noise of a brightness divided by its light's strength, in shares of full scale over
        strength; estimated at each pixel if absent.
    tuning : float or None
        Where the loss turns, in scales; the usual constant of the loss if absent [1].
    rounds : int
        Rounds of each stage; where they do not settle, many times as many with the lit set and the scale held.

    References
    ----------
    .. [1] P. W. Holland, R. E. Welsch, "Robust regression using iteratively reweighted least-squares", Commun. Stat.
       Theory Methods 6, 813-827, 1977. doi:10.1080/03610927708827533
    """

    name: ClassVar[str] = "robust"
    summary: ClassVar[str] = (
        "Lambert's law fitted to the observations that agree with it; highlights and shadows drop out"
    )
    assumes: ClassVar[str] = "most observations of a pixel are matte, lit and unsaturated"
    avoid: ClassVar[str] = "the surface is metal, or there are fewer than eight lights"
    pays_from: ClassVar[int] = 8
    loss: str = "auto"
    scale: float | None = None
    tuning: float | None = None
    rounds: int = 14

    def __post_init__(self) -> None:
        if self.loss != "auto":
            choose(LOSSES, self.loss, "loss")
        wrong = [
            what
            for what, value in (("scale", self.scale), ("tuning", self.tuning))
            if value is not None and not 0 < value < np.inf
        ]
        if wrong or self.rounds < 1 or (self.loss == "auto" and self.tuning is not None):
            raise OptionError(
                given=f"The robust solver is given loss {self.loss}, scale {self.scale}, tuning {self.tuning} and "
                f"{self.rounds} rounds.",
                needed="Positive numbers, one round or more, and a tuning constant only with a loss that is named.",
                remedy="Correct them, or leave them out.",
            )

    def prepare(self, rig: Rig, pixels: int | None = None) -> RobustState:
        """Factor the light matrix, find neighbouring lights, choose the loop; see :meth:`NormalSolver.prepare`."""
        self.require_lights(rig)
        factor = RigFactor.from_rig(rig)
        work = None if pixels is None else float(pixels) * len(rig)
        return RobustState(
            rig=factor,
            neighbours=_neighbours(rig.directions),
            settings=self._settings(),
            fit=kernel("robust", "robust_fit", work, _BREAK_EVEN),
        )

    def solve(self, state: RobustState, samples: Samples) -> PixelNormals:
        """Fit every pixel; see :meth:`NormalSolver.solve`."""
        rig = state.rig
        fit = state.fit(
            samples.values, samples.weights, rig.q, rig.r_inverse, state.neighbours, state.settings, samples.verdicts
        )
        scaled = np.ascontiguousarray(fit.x @ rig.r_inverse.T)
        albedo = np.sqrt((scaled * scaled).sum(axis=1))
        covariance = _covariance(fit, rig.r_inverse, scaled, albedo)
        found = PixelNormals(
            scaled=scaled,
            uncertainty=np.sqrt(covariance[:, 0] + covariance[:, 2] + covariance[:, 5]),
            flags=_flags(fit, samples),
            used=fit.looked_at.astype(np.uint16),
            covariance=covariance if samples.covariance else None,
            verdicts=fit.verdicts if samples.verdicts else None,
        )
        rest = np.flatnonzero(fit.kind >= Kind.PLAIN)
        if len(rest):
            fill(found, rest, LeastSquares(gate=self.gate).solve(rig, some(samples, rest)))
        return found

    def _settings(self) -> Settings:
        adaptive = self.loss == "auto"
        return Settings(
            loss=ADAPTIVE if adaptive else list(LOSSES).index(self.loss),
            tuning=1.0 if adaptive else float(self.tuning or LOSSES[self.loss]),
            scale=float(self.scale or 0.0),
            low=0.15,
            high=0.9,
            dark=_DARK if self.gate.shadow else _NEVER,
            floor=1e-3,
            structure=0.2,
            piled=0.5,
            small=3e-3,
            middle=0.475,
            width=0.25,
            keep=24.0,
            rounds=self.rounds,
            tolerance=1e-3,
            least=_LEAST_FOR_STEP,
        )


def _neighbours(directions: FloatArray) -> IntArray:
    """Return pairs of a light and one of those nearest to it, and how often each pair counts, (3, k).

    A pair counts twice where each is among the nearest of the other. As many as are equally near count, so that turning
    the rig changes nothing.
    """
    alike: FloatArray = directions @ directions.T
    np.fill_diagonal(alike, -np.inf)
    nearest = np.sort(alike, axis=1)[:, -min(_NEIGHBOURS, len(directions) - 1)]
    near = (alike >= nearest[:, None] - _EQUALLY_NEAR).astype(np.uint32)
    times = np.triu(near + near.T)
    one, other = np.nonzero(times)
    return np.stack([one, other, times[one, other]]).astype(np.uint32)  # unsigned: compiled code wraps signed ones


def _flags(fit: RobustFit, samples: Samples) -> FlagArray:
    flags = np.zeros(len(fit.usable), np.uint16)
    marks = (
        (fit.usable < len(samples.values), Flag.UNUSABLE_SAMPLE),
        (fit.looked_at < fit.usable, Flag.SHADOWED),
    )
    for where, flag in marks:
        flags[where] |= np.uint16(flag)
    return flags


def _covariance(fit: RobustFit, r_inverse: FloatArray, scaled: FloatArray, albedo: FloatArray) -> FloatArray:
    """Return the covariance of the unit normals, (p, 6)."""
    factor, _ = cholesky(fit.matrix.T)
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = angular_covariance(r_inverse, factor, (scaled / albedo[:, None]).T)
        return np.asarray(unit * (fit.variance / albedo**2)[:, None])
