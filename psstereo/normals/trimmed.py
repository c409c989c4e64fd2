"""Least squares over the middle ranks of each pixel's brightness."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from psstereo.errors import OptionError
from psstereo.flags import Flag, fatal_mask
from psstereo.lights import Rig
from psstereo.normals.least_squares import LeastSquares
from psstereo.normals.moments import RigFactor
from psstereo.normals.parts import fill, some
from psstereo.normals.solver import NormalSolver, PixelNormals, Samples
from psstereo.types import BoolArray, FloatArray
from psstereo.verdict import Verdict

__all__ = ["Trimmed"]

_LEAST = 4
"""Observations that stay."""
_DARK = 0.02
"""Share of the brightest value below which an observation takes no rank: it is in shadow."""


@dataclass(frozen=True, kw_only=True)
class Trimmed(NormalSolver[RigFactor]):
    """Least squares over the observations of middle brightness, pixel by pixel: position thresholds [1]_.

    Of the observations that are not black, the darkest are likely to be in a half shadow and the brightest in a
    highlight, so both are left out without asking. Cheap, and hard to fool; but good observations go too, so noise
    weighs more than with the robust solver, and with few lights nothing is left. At least four observations stay.

    Attributes
    ----------
    gate : Gate
        Whether saturated observations are left out.
    low : float
        Rank from which an observation is kept, 0 the darkest and 1 the brightest [1].
    high : float
        Rank up to which one is kept [1].

    References
    ----------
    .. [1] B. Shi, P. Tan, Y. Matsushita, K. Ikeuchi, "Bi-Polynomial Modeling of Low-Frequency Reflectances", IEEE
       TPAMI 36(6), 2014. doi:10.1109/TPAMI.2013.196
    """

    name: ClassVar[str] = "trimmed"
    summary: ClassVar[str] = "Lambert's law fitted to the observations of middle brightness at each pixel"
    assumes: ClassVar[str] = "less than a quarter of the lights shade a pixel, and less than a quarter make it shine"
    avoid: ClassVar[str] = "there are fewer than twelve lights, or the images are noisy"
    pays_from: ClassVar[int] = 12
    low: float = 0.25
    high: float = 0.75

    def __post_init__(self) -> None:
        if not 0 <= self.low < self.high <= 1:
            raise OptionError(
                given=f"The trimmed solver is to keep ranks from {self.low} to {self.high}.",
                needed="Two ranks, the first below the second, from 0 (darkest) to 1 (brightest).",
                remedy="Give, for example, low=0.25 and high=0.75.",
            )

    def prepare(self, rig: Rig, pixels: int | None = None) -> RigFactor:
        """Factor the light matrix; see :meth:`NormalSolver.prepare`."""
        self.require_lights(rig)
        return LeastSquares(gate=self.gate).prepare(rig, pixels)

    def solve(self, state: RigFactor, samples: Samples) -> PixelNormals:
        """Fit every pixel; see :meth:`NormalSolver.solve`."""
        usable = np.isfinite(samples.values)
        if samples.weights is not None:
            usable &= samples.weights > 0
        kept = self._kept(samples.values, usable)
        inner = LeastSquares(gate=self.gate)
        weights = kept.astype(np.float64) if samples.weights is None else kept * samples.weights
        found = inner.solve(state, replace(samples, weights=weights))
        # What was left out by rank was usable all the same.
        found.flags[usable.all(axis=0)] &= ~np.uint16(Flag.UNUSABLE_SAMPLE)
        found.flags[(found.used < usable.sum(axis=0))] |= np.uint16(Flag.SHADOWED)
        if found.verdicts is not None:
            found.verdicts[~kept & usable] = Verdict.NOT_NEEDED
        lost = np.flatnonzero(fatal_mask(found.flags))
        if len(lost):
            fill(found, lost, inner.solve(state, some(samples, lost)))
        return found

    def _kept(self, values: FloatArray, usable: BoolArray) -> BoolArray:
        """Return which observations have a middle rank among those of their pixel that are usable and not dark."""
        if self.gate.shadow:
            brightest = np.where(usable, values, -np.inf).max(axis=0)
            with np.errstate(invalid="ignore"):
                usable = usable & (values > _DARK * brightest)
        count = usable.sum(axis=0)
        ordered = np.sort(np.where(usable, values, np.inf), axis=0)
        last = np.maximum(count - 1, 0)
        first = np.ceil(self.low * last).astype(np.intp)
        final = np.floor(self.high * last).astype(np.intp)
        # Where four observations would not stay, the window grows, evenly on both sides.
        lack = np.maximum(_LEAST - (final - first + 1), 0)
        first = np.maximum(first - (lack + 1) // 2, 0)
        final = np.minimum(np.maximum(final + lack // 2, first + _LEAST - 1), last)
        first = np.minimum(first, np.maximum(final - _LEAST + 1, 0))
        low = np.take_along_axis(ordered, first[None], axis=0)
        high = np.take_along_axis(ordered, final[None], axis=0)
        return np.asarray(usable & (values >= low) & (values <= high))
