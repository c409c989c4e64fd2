"""Photometric stereo with a response of its own at every pixel: Lambert's law bent as far as the data ask for it.

:mod:`psstereo.kernels.response_bend` has the steps and their reasons.
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
from psstereo.types import FlagArray, FloatArray, IntArray

__all__ = ["ResponseBend", "ResponseBendState"]

_BREAK_EVEN = 5e5
"""Samples from which compiled code is sooner done: 100 to 400 µs a pixel of 96 lights without it, 5 to 17 µs with."""

_NEIGHBOURS = 3
"""Lights nearest to a light whose residuals should have nothing to do with its own."""

_LEVEL = 0.02
"""Share of the top brightness below which a value counts as shadow, and cosine below which a light counts as grazing."""

_WHITE, _STRUCTURED = 0.1, 0.3
"""Moran's statistic of residuals up to which they are noise, and from which they are none."""

_TIGHTEST = 1e12
"""An infinite tie in numbers that a matrix can hold."""


@dataclass(frozen=True, eq=False)
class ResponseBendState:
    """What all pixels share.

    Attributes
    ----------
    matte : RobustState
        What the robust solver prepared.
    pairs : int array (k, 2)
        Neighbouring lights.
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
    """Lambert's law with a bent response and an offset, both tied to none, where the residuals ask for it.

    The piecewise linear inverse of the response is fitted with the normal, as in [1]_; here as a departure from a
    straight line with a penalty instead of a prior on every slope, with an offset for ambient light and first bounces,
    and with the loss of Geman and McClure against highlights and cast shadows. Where the residuals of a matte fit look
    like noise, neighbouring lights having unrelated ones, the answer is that of the robust solver; where they vary
    smoothly over the dome it is the bend's, and in between the two are mixed.

    The error bars are those of noise. Residuals that are an error of the model move neighbouring lights together, and
    the true error is then larger: on photographs of glossy objects several times. Not for surfaces whose brightness
    depends on more than the angle between normal and light even without highlights: rough matte ones that throw light
    back to the lamp (plaster, the moon; twice the error of the robust solver on those of Oren and Nayar), brushed
    metal, satin. The scale of the albedo is that of the brightest observations where the response is bent.

    Attributes
    ----------
    gate : Gate
        Which observations are left out.
    tie : float
        How strongly the bend at each knot is tied to none; infinite for Lambert's law with an offset [1].
    offset_tie : float
        The same for the offset [1].
    segments : int
        Pieces of the bent response, 2 … 8.
    rounds : int
        Rounds of the bent fit at most; a pixel that needs more is flagged.

    References
    ----------
    .. [1] S. Ikehata, D. Wipf, Y. Matsushita, K. Aizawa, "Photometric stereo using sparse Bayesian regression for
       general diffuse surfaces", IEEE Trans. Pattern Analysis and Machine Intelligence 36(9), 2014.
       doi:10.1109/TPAMI.2014.2299798
    """

    name: ClassVar[str] = "response-bend"
    summary: ClassVar[str] = "Lambert's law with a response that bends where the residuals ask for it"
    assumes: ClassVar[str] = "brightness rises with the cosine between normal and light, but for highlights and shadows"
    avoid: ClassVar[str] = "the surface throws light back to the lamp, as plaster does, or there are under twelve lights"
    least_lights: ClassVar[int] = 12
    pays_from: ClassVar[int] = 12
    tie: float = 0.002
    offset_tie: float = 0.01
    segments: int = 3
    rounds: int = 16

    def __post_init__(self) -> None:
        if not (self.tie > 0 and self.offset_tie > 0 and 2 <= self.segments <= 8 and self.rounds >= 1):
            raise OptionError(
                given=f"The response bend is given the ties {self.tie} and {self.offset_tie}, {self.segments} segments "
                f"and {self.rounds} rounds.",
                needed="Ties above 0, 2 to 8 segments, one round or more.",
                remedy="Correct them, or leave them out.",
            )

    def prepare(self, rig: Rig, pixels: int | None = None) -> ResponseBendState:
        """Factor the light matrix, find neighbouring lights, choose the loop; see :meth:`NormalSolver.prepare`."""
        self.require_lights(rig)
        matte = Robust(gate=self.gate).prepare(rig, pixels)
        work = None if pixels is None else float(pixels) * len(rig)
        settings = Settings(
            segments=int(self.segments),
            tie=float(min(self.tie, _TIGHTEST)),
            offset_tie=float(min(self.offset_tie, _TIGHTEST)),
            level=_LEVEL if self.gate.shadow else -np.inf,
            dark=_LEVEL if self.gate.shadow else -np.inf,
            white=_WHITE,
            structured=_STRUCTURED,
            rounds=int(self.rounds),
        )
        fit = kernel("response_bend", "response_bend", work, _BREAK_EVEN)
        return ResponseBendState(matte, _pairs(rig.directions), settings, fit)

    def solve(self, state: ResponseBendState, samples: Samples) -> PixelNormals:
        """Fit every pixel; see :meth:`NormalSolver.solve`."""
        rig = state.matte.rig
        fit = state.fit(samples.values, samples.weights, rig.q, rig.r_inverse, state.pairs, state.settings)
        answer = _bent(fit, rig.r_inverse, samples, state, rig.q)
        mixed = np.flatnonzero(~(fit.share == 1))
        if len(mixed):
            robust = Robust(gate=self.gate)
            _mix(answer, mixed, fit.share[mixed], robust.solve(state.matte, _some(samples, mixed)))
        if not samples.covariance:
            return replace(answer, covariance=None)
        return answer


def _pairs(directions: FloatArray) -> IntArray:
    """Return pairs of neighbouring lights, (k, 2); lights as near as the last one taken are all taken."""
    alike: FloatArray = directions @ directions.T
    np.fill_diagonal(alike, -np.inf)
    reach = np.sort(alike, axis=1)[:, -_NEIGHBOURS]
    return np.argwhere(alike >= reach[:, None] - 1e-9).astype(np.int64)


def _some(samples: Samples, pixels: IntArray) -> Samples:
    """Return some pixels, with all that a mixture needs asked for."""
    weights = None if samples.weights is None else samples.weights[:, pixels]
    return replace(samples, values=samples.values[:, pixels], weights=weights, covariance=True)


def _bent(fit: BendFit, r_inverse: FloatArray, samples: Samples, state: ResponseBendState, q: FloatArray) -> PixelNormals:
    """Return the bend's answer, nothing where it has no share."""
    scaled = np.ascontiguousarray((fit.solution[:, -3:] * fit.top[:, None]) @ r_inverse.T)
    albedo = np.sqrt((scaled * scaled).sum(axis=1))
    with np.errstate(invalid="ignore", divide="ignore"):
        factor, _ = cholesky(fit.matrix.T)
        unit = angular_covariance(r_inverse, factor, (scaled / albedo[:, None]).T)
        covariance = unit * (fit.variance * (fit.top / albedo) ** 2)[:, None]
    verdicts = _verdicts(fit, samples, state.settings, q, r_inverse) if samples.verdicts else None
    return PixelNormals(
        scaled=scaled,
        uncertainty=np.sqrt(_trace(covariance)),
        flags=_flags(fit, samples),
        used=fit.used.astype(np.uint16),
        covariance=covariance,
        verdicts=verdicts,
    )


def _trace(covariance: FloatArray) -> FloatArray:
    return np.asarray(covariance[:, 0] + covariance[:, 2] + covariance[:, 5])


def _mix(answer: PixelNormals, pixels: IntArray, share: FloatArray, matte: PixelNormals) -> None:
    """Put a mixture of the bend's answer and the robust solver's in the bend's place."""
    none = share == 0
    bent = np.where(none[:, None], matte.scaled, answer.scaled[pixels])
    scaled = matte.scaled + share[:, None] * (bent - matte.scaled)
    with np.errstate(invalid="ignore", divide="ignore"):
        apart = _unit(bent) - _unit(matte.scaled)
        normal = _unit(scaled)
    apart -= normal * (apart * normal).sum(axis=1)[:, None]
    x, y, z = apart.T
    between = np.stack([x * x, x * y, y * y, x * z, y * z, z * z], axis=1) * (share * (1.0 - share))[:, None]
    own = np.where(none[:, None], 0.0, answer.covariance[pixels])  # type: ignore[index]
    covariance = (1.0 - share)[:, None] * matte.covariance + share[:, None] * own + between
    answer.scaled[pixels] = scaled
    answer.uncertainty[pixels] = np.where(none, matte.uncertainty, np.sqrt(_trace(covariance)))
    answer.flags[pixels] = matte.flags | np.where(none, np.uint16(0), answer.flags[pixels])
    minor = share < 0.5
    answer.used[pixels[minor]] = matte.used[minor]
    answer.covariance[pixels] = covariance  # type: ignore[index]
    if answer.verdicts is not None and matte.verdicts is not None:
        answer.verdicts[:, pixels[minor]] = matte.verdicts[:, minor]


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.sqrt((vectors * vectors).sum(axis=1))[:, None])


def _usable(samples: Samples) -> FlagArray:
    usable = np.isfinite(samples.values)
    if samples.weights is not None:
        usable &= samples.weights > 0
    return np.asarray(usable)


def _flags(fit: BendFit, samples: Samples) -> FlagArray:
    usable = _usable(samples)
    available = usable.sum(axis=0)
    flags = np.zeros(len(available), np.uint16)
    marks = (
        (~fit.converged, Flag.NOT_CONVERGED),
        (available < len(usable), Flag.UNUSABLE_SAMPLE),
        (fit.lit < available, Flag.SHADOWED),
    )
    for where, flag in marks:
        flags[where] |= np.uint16(flag)
    return flags


def _verdicts(
    fit: BendFit, samples: Samples, settings: Settings, q: FloatArray, r_inverse: FloatArray
) -> VerdictArray:
    """Return what the bent fit made of each observation; of no meaning where it has no share."""
    usable = _usable(samples)
    y = np.where(usable, samples.values, 0.0) / fit.top
    weights = np.ones(y.shape) if samples.weights is None else np.where(usable, samples.weights, 0.0)
    weights = weights / (weights.sum(axis=0) / np.maximum(usable.sum(axis=0), 1))
    columns = design(y, q, settings.segments)
    x = fit.solution[:, -3:].T
    r = y - (columns * fit.solution.T[:, None]).sum(axis=0)
    dark = settings.dark * np.linalg.norm(r_inverse @ x, axis=0)
    t = r * np.sqrt(weights) / fit.scale
    verdicts = np.full(y.shape, Verdict.USED, np.uint8)
    verdicts[t > 3] = Verdict.HIGHLIGHT
    verdicts[t < -3] = Verdict.DARK_OUTLIER
    verdicts[(y <= settings.level) | (q @ x <= dark)] = Verdict.SHADOW
    verdicts[~usable] = Verdict.UNUSABLE
    return verdicts
