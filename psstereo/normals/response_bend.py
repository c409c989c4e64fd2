"""Photometric stereo on surfaces that are not matte: the response to light may be bent, and ambient light is allowed.

The brightness of a pixel is taken for a rising function of the cosine, whose inverse is a straight line plus a few
tents that are tied to zero. Where the residuals of Lambert's law are noise nothing is bent, and the answer is that of
the robust solver; :mod:`psstereo.kernels.response_bend` has the steps and their reasons.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from psstereo.errors import OptionError
from psstereo.flags import Flag
from psstereo.kernels.dispatch import kernel
from psstereo.kernels.response_bend import BendFit, Settings, design
from psstereo.lights import Rig
from psstereo.normals.moments import angular_covariance, cholesky
from psstereo.normals.robust import Robust, RobustState
from psstereo.normals.solver import NormalSolver, PixelNormals, Samples
from psstereo.normals.verdict import Verdict, VerdictArray
from psstereo.types import FloatArray, IntArray

__all__ = ["ResponseBend", "ResponseBendState"]

_BREAK_EVEN = 9e5
"""Samples from which compiled code is sooner done: about 1.2 µs each without it, 0.14 µs and 1 s with it."""

_STIFF = 1e12
"""Tie that leaves a bend of a billionth at most, as good as an infinite one."""

_NEIGHBOURS = 3
"""Lights nearest to a light whose residuals should have nothing to do with its own."""

_EQUALLY_NEAR = 1e-9
"""Cosines that differ by less are the same."""


@dataclass(frozen=True, eq=False)
class ResponseBendState:
    """What all pixels share.

    Attributes
    ----------
    matte : RobustState
        What the robust solver needs, the factored light matrix in it.
    pairs : int array (k, 2)
        Lights and those nearest to them; a pair stands twice where each is among the nearest of the other.
    settings : Settings
        Numbers of the fit.
    fit : callable
        The hot loop, compiled or not.
    """

    matte: RobustState
    pairs: IntArray
    settings: Settings
    fit: Callable[..., BendFit]


@dataclass(frozen=True, kw_only=True)
class ResponseBend(NormalSolver[ResponseBendState]):
    """Lambert's law with a bent response and ambient light, where the data ask for it.

    Robust regression of the normal together with a curve from brightness to cosine and an offset, pixel by pixel. It is
    the several-piece model of [1]_ with the curve's bend tied to zero, which makes it usable with a hundred lights and
    less: with a strong tie it is Lambert's law. Where a robust Lambertian fit leaves nothing but noise, its normal
    stands, so that matte surfaces lose nothing. Not with few lights: a pixel with fewer than nine that reach it gets
    the robust solver's answer, and with fewer than twelve in all it refuses. Not on rough surfaces that throw light
    back to where it comes from, whose brightness is no function of the cosine; there least squares is better.

    Attributes
    ----------
    gate : Gate
        Whether saturated observations are left out; shadows always are.
    segments : int
        Pieces of the curve, 2 to 6.
    tie : float
        Weight of the squared bend at each knot, against a squared residual with brightness scaled to one;
        infinite for none [1].
    offset_tie : float
        Weight of the squared offset, infinite for none [1].
    rounds : int
        Rounds of the bent fit at most.

    References
    ----------
    .. [1] S. Ikehata, D. Wipf, Y. Matsushita, K. Aizawa, "Photometric Stereo Using Sparse Bayesian Regression for
       General Diffuse Surfaces", IEEE TPAMI 36(9), 2014. doi:10.1109/TPAMI.2014.2299798
    """

    name: ClassVar[str] = "response-bend"
    summary: ClassVar[str] = "Brightness as a bent function of Lambert's cosine plus ambient light, fitted robustly"
    assumes: ClassVar[str] = "brightness rises with the cosine at most lights, in whatever way"
    avoid: ClassVar[str] = (
        "there are fewer than sixteen lights, or the surface is rough and throws light back, as plaster"
    )
    least_lights: ClassVar[int] = 12
    pays_from: ClassVar[int] = 16
    segments: int = 3
    tie: float = 0.001
    offset_tie: float = 0.01
    rounds: int = 16

    def __post_init__(self) -> None:
        sound = 2 <= self.segments <= 6 and self.tie > 0 and self.offset_tie > 0 and self.rounds >= 1
        if not sound:
            raise OptionError(
                given=f"The response bend is given {self.segments} segments, the ties {self.tie} and "
                f"{self.offset_tie}, and {self.rounds} rounds.",
                needed="Two to six segments, ties above 0, and one round or more.",
                remedy="Correct them, or leave them out.",
            )

    def prepare(self, rig: Rig, pixels: int | None = None) -> ResponseBendState:
        """Factor the light matrix, find neighbouring lights, choose the loops; see :meth:`NormalSolver.prepare`."""
        self.require_lights(rig)
        matte = Robust(gate=self.gate).prepare(rig, pixels)
        work = None if pixels is None else float(pixels) * len(rig)
        return ResponseBendState(
            matte=matte,
            pairs=_pairs(rig.directions),
            settings=self._settings(),
            fit=kernel("response_bend", "response_bend", work, _BREAK_EVEN),
        )

    def solve(self, state: ResponseBendState, samples: Samples) -> PixelNormals:
        """Fit every pixel; see :meth:`NormalSolver.solve`."""
        rig = state.matte.rig
        found = Robust(gate=self.gate).solve(state.matte, replace(samples, covariance=True))
        fit = state.fit(samples.values, samples.weights, rig.q, rig.r_inverse, state.pairs, state.settings)
        bent = np.flatnonzero((fit.share > 0) & np.isfinite(found.scaled[:, 0]))
        if len(bent):
            _mix(found, bent, fit, rig.r_inverse)
            if found.verdicts is not None:
                most = bent[fit.share[bent] >= 0.5]
                found.verdicts[:, most] = _verdicts(state, samples, fit, most)
        return found if samples.covariance else replace(found, covariance=None)

    def _settings(self) -> Settings:
        return Settings(
            segments=self.segments,
            tie=min(self.tie, _STIFF),
            offset_tie=min(self.offset_tie, _STIFF),
            level=0.02,
            dark=0.02,
            white=0.12,
            ramp=0.2,
            rounds=self.rounds,
        )


def _pairs(directions: FloatArray) -> IntArray:
    """Return each light with each of those nearest to it, (k, 2).

    As many as are equally near count, so that turning the rig changes nothing.
    """
    alike: FloatArray = directions @ directions.T
    np.fill_diagonal(alike, -np.inf)
    nearest = np.sort(alike, axis=1)[:, -_NEIGHBOURS]
    return np.argwhere(alike >= nearest[:, None] - _EQUALLY_NEAR)


def _mix(found: PixelNormals, bent: IntArray, fit: BendFit, r_inverse: FloatArray) -> None:
    """Give the bend its share in the answer, in place."""
    share = fit.share[bent, None]
    scaled = fit.solution[bent, -3:] @ r_inverse.T * fit.top[bent, None]
    albedo = np.sqrt((scaled * scaled).sum(axis=1))
    factor, _ = cholesky(fit.matrix[bent].T)
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = angular_covariance(r_inverse, factor, (scaled / albedo[:, None]).T)
        covariance = unit * (fit.variance[bent] * (fit.top[bent] / albedo) ** 2)[:, None]
    found.scaled[bent] = (1.0 - share) * found.scaled[bent] + share * scaled
    if found.covariance is not None:
        # However the two errors hang together, their mean spreads no more than this.
        mixed = (1.0 - share) * found.covariance[bent] + share * covariance
        found.covariance[bent] = mixed
        found.uncertainty[bent] = np.sqrt(mixed[:, 0] + mixed[:, 2] + mixed[:, 5])
    whole = fit.share[bent] == 1
    found.flags[bent[whole]] &= ~np.uint16(Flag.NOT_CONVERGED)  # the robust fit has no part in it
    found.flags[bent[~fit.converged[bent]]] |= np.uint16(Flag.NOT_CONVERGED)
    found.used[bent] = fit.lit[bent]


def _verdicts(state: ResponseBendState, samples: Samples, fit: BendFit, pixels: IntArray) -> VerdictArray:
    """Return what the bent fit made of the observations of some pixels, (m, len(pixels))."""
    rig, s = state.matte.rig, state.settings
    values = samples.values[:, pixels]
    usable = np.isfinite(values)
    g = np.ones(values.shape)
    if samples.weights is not None:
        g = samples.weights[:, pixels].astype(np.float64)
        usable &= g > 0
    g = np.where(usable, g, 0.0)
    g *= usable.sum(axis=0) / g.sum(axis=0)
    y = np.where(usable, values, 0.0) / fit.top[pixels]
    solution = fit.solution[pixels].T
    r = y - np.einsum("pcm,cp->mp", design(y.T, rig.q, s.segments), solution)
    front = rig.q @ solution[-3:]
    dark = s.dark * np.linalg.norm(rig.r_inverse @ solution[-3:], axis=0)
    t = r * np.sqrt(g) / fit.scale[pixels]
    choices = (
        (~usable, Verdict.UNUSABLE),
        ((front <= dark) | (y <= s.level), Verdict.SHADOW),
        (np.abs(t) <= 1.0, Verdict.USED),
        (t > 3.0, Verdict.HIGHLIGHT),
        (t < -3.0, Verdict.DARK_OUTLIER),
    )
    picked = np.select([c for c, _ in choices], [np.uint8(v) for _, v in choices], np.uint8(Verdict.USED))
    return np.asarray(picked, np.uint8)
