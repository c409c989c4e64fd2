"""Low-rank photometric stereo: brightness is a low-rank matrix plus sparse errors, shadows are entries not observed.

Under distant lights the brightness of a matte surface, lights by pixels, is a matrix D of rank three. What is measured,
M, differs from it by errors E in few entries, the highlights, and says nothing in others, the shadows. D is found by
making it simple and Σ|E| over the observed entries small, subject to D + E = M there, with an augmented Lagrangian
whose penalty grows (inexact ALM [1]_ [2]_). Each round

1. makes D from X = M − E + Y/μ,
2. takes Z = M − D + Y/μ; the multipliers become Y = clip(μ Z, ±λ), zero where nothing is observed, and E = Z − Y/μ,

and multiplies μ. Three ways to make D:

* ``nuclear``: singular values shrunk by 1/μ, as published, with λ = 1/√(larger side) where a share of the singular
  values and Σ|E| compete;
* ``rank-3``: the best matrix of rank three;
* ``lights``: the matrix nearest on the observed entries whose columns are combinations of the lights. With known
  lights this is known, and it is much: the problem falls apart into one of three unknowns a pixel, so that other
  pixels' errors stay theirs.

The first two need the singular vectors of a wide matrix, which are those of its m × m Gram matrix. They look at all
pixels that are given at once: blocks of a fixed number, counted from the first pixel of the mask, so that threads and
tiles change nothing, but another order of pixels does.

At last the measured values that agree with D are fitted by least squares, since Σ|E| pulls on each of them alike
whatever its error.

References
----------
.. [1] L. Wu, A. Ganesh, B. Shi, Y. Matsushita, Y. Wang, Y. Ma, "Robust photometric stereo via low-rank matrix completion
   and recovery", ACCV 2010. doi:10.1007/978-3-642-19318-7_55
.. [2] Z. Lin, M. Chen, Y. Ma, "The augmented Lagrange multiplier method for exact recovery of corrupted low-rank
   matrices", 2010. arXiv:1009.5055
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.catalogue import choose
from psstereo.errors import OptionError
from psstereo.flags import Flag, fatal_mask
from psstereo.lights import Rig
from psstereo.normals.gate import GATES
from psstereo.normals.least_squares import LeastSquares
from psstereo.normals.moments import RigFactor, cholesky, solve_cholesky
from psstereo.normals.solver import NormalSolver, PixelNormals, Samples
from psstereo.normals.verdict import Verdict, VerdictArray
from psstereo.types import BoolArray, FloatArray

__all__ = ["FORMS", "LowRank", "recover"]

FORMS: dict[str, str] = {
    "lights": "columns are combinations of the lights",
    "rank-3": "rank three",
    "nuclear": "small singular values are shrunk away",
}
"""What D may be, by name."""

_DARK = 0.02
"""Share of the brightest value below which nothing is observed, and cosine below which a light is grazing."""

_AGREES = 3.0
"""Standard deviations of the noise within which a measured value agrees with D."""

_CUT = 0.9733
"""Variance of a normal variable cut off there."""

_FLOOR = 1e-3
"""Least standard deviation of the noise that is believed, as a share of the brightest value."""

_ENOUGH = 5
"""Observed values from which errors can be told from D."""

_MOST_DARK = 0.4
"""Share of the lit observations from which dark ones are no rare errors any more; plain least squares judges better."""
_PART = 256
"""Pixels recovered at once where each stands alone; they stay in the cache."""


@dataclass(frozen=True, kw_only=True)
class LowRank(NormalSolver[RigFactor]):
    """Low rank plus sparse errors, with shadows as missing entries.

    A baseline of the literature, better than least squares where highlights are rare, and slower and less sharp than
    the robust and the sparse Bayesian solver, which use the same knowledge pixel by pixel. With the form ``lights`` it
    is a fit by least absolute values followed by one by least squares. Not for broad highlights, which are no sparse
    errors; the forms ``rank-3`` and ``nuclear`` not for small or flat objects either, where a block has no rank three.

    Attributes
    ----------
    gate : Gate
        Which observations are left out.
    form : str
        What D may be, a name in `FORMS`.
    sparsity : float
        λ in units of its usual value; larger makes errors rarer. Only for the form ``nuclear`` [1].
    growth : float
        Factor by which the penalty grows each round; smaller is more exact and slower [1].
    rounds : int
        Most rounds; pixels of a block that needs more are flagged.
    tolerance : float
        Misfit of D + E over M, in lengths, below which a block or pixel is done [1].
    """

    name: ClassVar[str] = "low-rank"
    summary: ClassVar[str] = "images as a matrix of rank three with sparse errors, shadows as entries not observed"
    assumes: ClassVar[str] = "the surface is matte but for rare and narrow highlights"
    avoid: ClassVar[str] = "highlights are broad, or there are fewer than eight lights; robust does the same and better"
    pays_from: ClassVar[int] = 8
    form: str = "lights"
    sparsity: float = 1.0
    growth: float = 1.4
    rounds: int = 100
    tolerance: float = 1e-7

    def __post_init__(self) -> None:
        choose(FORMS, self.form, "form")
        sound = 0 < self.sparsity < np.inf and 1 < self.growth < np.inf and self.rounds >= 1 and 0 < self.tolerance < 1
        if not sound or (self.sparsity != 1 and self.form != "nuclear"):
            raise OptionError(
                given=f"The low-rank solver is given sparsity {self.sparsity}, growth {self.growth}, {self.rounds} "
                f"rounds and the tolerance {self.tolerance} with the form {self.form}.",
                needed="A sparsity above 0, and other than 1 only with the form nuclear; a growth above 1; one round or "
                "more; a tolerance between 0 and 1.",
                remedy="Correct them, or leave them out.",
            )

    def prepare(self, rig: Rig, pixels: int | None = None) -> RigFactor:
        """Factor the light matrix; see :meth:`NormalSolver.prepare`."""
        del pixels  # the work is in products of matrices, which are as fast without compiled code
        self.require_lights(rig)
        return RigFactor.from_rig(rig)

    def solve(self, state: RigFactor, samples: Samples) -> PixelNormals:
        """Recover D, then fit what agrees with it; see :meth:`NormalSolver.solve`."""
        usable = np.isfinite(samples.values)
        if samples.weights is not None:
            usable &= samples.weights > 0
        values = np.where(usable, samples.values, 0.0)
        brightest = values.max(axis=0)
        scale = np.where(brightest > 0, brightest, 1.0)
        values /= scale
        observed = usable & (values > _DARK) if self.gate.shadow else usable
        d, converged = recover(
            values,
            observed,
            form=self.form,
            rig=state,
            sparsity=self.sparsity,
            growth=self.growth,
            rounds=self.rounds,
            tolerance=self.tolerance,
        )
        lit, kept = self._agreeing(state, values, usable, observed, d)
        weights = kept.astype(np.float64) if samples.weights is None else kept * samples.weights
        found = _PLAIN.solve(state, Samples(samples.values, weights, covariance=samples.covariance))
        return self._assemble(state, samples, found, usable, lit, kept, ~(d >= values), converged)

    def _agreeing(
        self, rig: RigFactor, values: FloatArray, usable: BoolArray, observed: BoolArray, d: FloatArray
    ) -> tuple[BoolArray, BoolArray]:
        """Return what is lit according to D, and what of that agrees with it."""
        x = rig.q.T @ d
        model = rig.q @ x
        lit = observed
        if self.gate.shadow:
            b = rig.r_inverse @ x
            with np.errstate(invalid="ignore"):  # NaN agrees with nothing
                lit = usable & (model > _DARK * np.sqrt((b * b).sum(axis=0)))
            few = lit.sum(axis=0) < 3
            lit[:, few] = observed[:, few]
        size = np.abs(values - model)
        ranked = np.sort(np.where(lit, size, np.inf), axis=0)
        count = lit.sum(axis=0)
        # the middle of those residuals that are not small because three unknowns are fitted to them
        middle = np.where(count >= _ENOUGH, (count - 3) // 2 + 2, 0)
        at = np.take_along_axis(ranked, middle[None], axis=0)[0]
        noise = np.where(count >= _ENOUGH, np.maximum(1.4826 * at, _FLOOR), np.inf)
        with np.errstate(invalid="ignore"):
            return lit, lit & (size <= _AGREES * noise)

    def _assemble(
        self,
        rig: RigFactor,
        samples: Samples,
        found: PixelNormals,
        usable: BoolArray,
        lit: BoolArray,
        kept: BoolArray,
        bright: BoolArray,
        converged: BoolArray,
    ) -> PixelNormals:
        """Correct the spread for what was cut off, set flags, and solve again where too little agreed."""
        widen = np.where(lit.sum(axis=0) >= _ENOUGH, 1 / _CUT, 1.0)
        scaled, flags, used = found.scaled, found.flags, found.used
        uncertainty = found.uncertainty * np.sqrt(widen)
        covariance = None if found.covariance is None else found.covariance * widen[:, None]
        lost = fatal_mask(flags)
        flags &= np.uint16(~(Flag.UNUSABLE_SAMPLE | Flag.SHADOWED) & 0xFFFF)
        available = usable.sum(axis=0)
        for where, flag in (
            (available < len(usable), Flag.UNUSABLE_SAMPLE),
            (lit.sum(axis=0) < available, Flag.SHADOWED),
            (~converged, Flag.NOT_CONVERGED),
        ):
            flags[where] |= np.uint16(flag)
        verdicts = _verdicts(usable, lit, kept, bright) if samples.verdicts else None
        # Where most of what the model calls lit is dark, the dark ones would be taken for the sparse errors' opposite.
        dark = lit & (samples.values <= _DARK * np.where(usable, samples.values, 0.0).max(axis=0))
        again = np.flatnonzero(lost | (self.gate.shadow & (dark.sum(axis=0) > _MOST_DARK * lit.sum(axis=0))))
        if len(again):
            part = Samples(
                samples.values[:, again],
                None if samples.weights is None else samples.weights[:, again],
                verdicts=samples.verdicts,
                covariance=samples.covariance,
            )
            plain = LeastSquares(gate=self.gate).solve(rig, part)
            scaled[again], flags[again], used[again] = plain.scaled, plain.flags, plain.used
            uncertainty[again] = plain.uncertainty
            if covariance is not None and plain.covariance is not None:
                covariance[again] = plain.covariance
            if verdicts is not None and plain.verdicts is not None:
                verdicts[:, again] = plain.verdicts
        return PixelNormals(scaled, uncertainty, flags, used, covariance, verdicts)


_PLAIN = LeastSquares(gate=GATES["none"])


def _verdicts(usable: BoolArray, lit: BoolArray, kept: BoolArray, bright: BoolArray) -> VerdictArray:
    verdicts = np.full(usable.shape, Verdict.USED, np.uint8)
    verdicts[lit & ~kept & bright] = Verdict.HIGHLIGHT
    verdicts[lit & ~kept & ~bright] = Verdict.DARK_OUTLIER
    verdicts[~lit] = Verdict.SHADOW
    verdicts[~usable] = Verdict.UNUSABLE
    return verdicts


def recover(
    values: FloatArray,
    observed: BoolArray,
    *,
    form: str = "rank-3",
    rig: RigFactor | None = None,
    sparsity: float = 1.0,
    growth: float = 1.4,
    rounds: int = 100,
    tolerance: float = 1e-7,
) -> tuple[FloatArray, BoolArray]:
    """Split a matrix with missing entries into a simple one and sparse errors.

    Parameters
    ----------
    values : float64 array (m, p)
        The matrix; where it is not observed, any number.
    observed : bool array (m, p)
        Which entries are known.
    form : str
        What the simple one may be, a name in `FORMS`.
    rig : RigFactor, optional
        The light matrix, factored, for the form ``lights``.
    sparsity, growth, rounds, tolerance
        See :class:`LowRank`.

    Returns
    -------
    d : float64 array (m, p)
        The simple matrix, all entries, in the units of `values`; NaN in columns that the form ``lights`` leaves open,
        since what is observed does not span space.
    converged : bool array (p,)
        Which columns are within the tolerance.

    Raises
    ------
    OptionError
        If the form is unknown, or ``lights`` without lights.
    """
    choose(FORMS, form, "form")
    m, p = values.shape
    if form != "lights":
        make = _shrunk if form == "nuclear" else _truncated
        d, done = _alternate(values, observed, make, sparsity / np.sqrt(max(m, p)), growth, rounds, tolerance)
        return d, np.full(p, done)
    if rig is None:
        raise OptionError(
            given="The form lights is chosen without lights.",
            needed="It needs their matrix, factored.",
            remedy="Give it, or choose the form rank-3.",
        )
    d, converged = np.zeros((m, p)), np.zeros(p, np.bool_)
    for start in range(0, p, _PART):
        part = slice(start, start + _PART)
        d[:, part], converged[part] = _apart(values[:, part], observed[:, part], rig, growth, rounds, tolerance)
    return d, converged


def _eigen(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return singular values, rising, and left singular vectors of a wide matrix, by its Gram matrix."""
    squares, vectors = np.linalg.eigh(x @ x.T)
    return np.sqrt(np.maximum(squares, 0.0)), vectors


def _shrunk(x: FloatArray, threshold: float) -> FloatArray:
    """Return the matrix with all singular values made smaller by the threshold, those below it zero."""
    size, vectors = _eigen(x)
    left = vectors[:, size > threshold]
    size = size[size > threshold]
    return np.asarray((left * ((size - threshold) / size)) @ (left.T @ x))


def _truncated(x: FloatArray, threshold: float) -> FloatArray:
    """Return the nearest matrix of rank three."""
    del threshold
    left = _eigen(x)[1][:, -3:]
    return np.asarray(left @ (left.T @ x))


def _alternate(
    values: FloatArray,
    observed: BoolArray,
    make: Callable[[FloatArray, float], FloatArray],
    lam: float,
    growth: float,
    rounds: int,
    tolerance: float,
) -> tuple[FloatArray, bool]:
    """Inexact ALM on a whole block."""
    m = np.where(observed, values, 0.0)
    length, spectral = float(np.linalg.norm(m)), float(_eigen(m)[0][-1])
    if not length > 0:
        return np.zeros_like(m), True
    bound = np.where(observed, lam, 0.0)
    y = m / max(spectral, float(np.abs(m).max()) / lam)
    mu = 1.25 / spectral
    x = m + y / mu
    d = np.zeros_like(m)
    for _ in range(rounds):
        d = make(x, 1.0 / mu)
        z = m - d + y / mu
        before, y = y, np.clip(mu * z, -bound, bound)
        if np.linalg.norm(y - before) <= tolerance * length * mu:
            return d, True
        x = m - z + y / mu
        mu *= growth
        x += y / mu
    return d, False


def _apart(
    values: FloatArray, observed: BoolArray, rig: RigFactor, growth: float, rounds: int, tolerance: float
) -> tuple[FloatArray, BoolArray]:
    """Inexact ALM where each column stands alone; lengths are those of the columns, and λ is 1."""
    m = np.where(observed, values, 0.0)
    length = np.sqrt((m * m).sum(axis=0))
    length[~(length > 0)] = 1.0
    m /= length
    bound = observed.astype(np.float64)
    factor, singular = cholesky(rig.moments @ bound)
    y, mu = m.copy(), 1.25
    x = m + y / mu
    found = np.zeros_like(m)
    converged = singular
    found[:, singular] = np.nan
    for _ in range(rounds):
        d = rig.q @ solve_cholesky(factor, rig.q.T @ (bound * x))
        z = m - d + y / mu
        before, y = y, np.clip(mu * z, -bound, bound)
        before -= y
        with np.errstate(invalid="ignore"):
            now = ~converged & ((before * before).sum(axis=0) <= (tolerance * mu) ** 2)
        found[:, now] = d[:, now]  # as it is, so that it does not depend on how long its neighbours take
        converged = converged | now
        x = m - z + y / mu
        mu *= growth
        x += y / mu
        if converged.all():
            break
    found[:, ~converged] = d[:, ~converged]
    return found * length, converged
