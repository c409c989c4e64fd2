"""Photometric stereo by least squares (Woodham 1980).

A Lambertian pixel shows ``I_i = l_i · b`` under light i, with b the albedo times the normal. Three lights determine b,
more overdetermine it. Where nothing is left out, one factorisation of the light matrix serves all pixels; where shadows
or saturated values are left out, each pixel has its own small system, see :mod:`psstereo.normals.moments`.

The shadow gate works in three passes. The first leaves out what is dark against the pixel's brightest value and fits
the rest. The second judges by that fit instead of by the noisy values themselves: an observation stays if the fit says
that its light is in front of the surface (no attached shadow) and its value is not dark against the albedo (no cast
shadow). The third does the same by the second fit, since the first has still followed some shadows whose noise was
bright. Only pixels whose choice changed are judged and fitted again.

Leaving out every grazing observation that noise has made dark, and none that it has made bright, would pull the fit
and make its error look smaller than it is. What the fit puts in attached shadow shows the noise by itself; an
observation is no cast shadow as long as that noise explains what it lacks.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.flags import Flag, fatal_mask
from psstereo.lights import Rig
from psstereo.normals.moments import (
    Factor,
    RigFactor,
    angular_covariance,
    angular_spread,
    cholesky,
    solve_cholesky,
)
from psstereo.normals.solver import NormalSolver, PixelNormals, Samples
from psstereo.normals.verdict import Verdict, VerdictArray
from psstereo.types import BoolArray, FlagArray, FloatArray, IntArray

__all__ = ["LeastSquares"]

_DARK = 0.02
"""Share of the albedo below which a value counts as shadow, and cosine below which a light counts as grazing."""

_NOISE = 3.0
"""Standard deviations of the noise that an observation may lack before it counts as cast shadow."""
_PART = 256
"""Pixels judged at once; their values stay in the cache, and what is computed on the way stays small."""


@dataclass(frozen=True, kw_only=True)
class LeastSquares(NormalSolver[RigFactor]):
    """Least squares over the observations that the gate leaves.

    Exact on Lambertian surfaces under distant lights. Not for glossy surfaces: a highlight is one strong wrong vote,
    and least squares follows it. Sums over lights run in float64 whatever the type of the images.

    Attributes
    ----------
    gate : Gate
        Which observations are left out; with ``none`` this is the baseline of the literature.

    References
    ----------
    .. [1] R. J. Woodham, "Photometric method for determining surface orientation from multiple images", Optical
       Engineering 19(1), 1980. doi:10.1117/12.7972479
    """

    name: ClassVar[str] = "least-squares"
    summary: ClassVar[str] = "Lambert's law fitted to all observations that are not in shadow or saturated"

    assumes: ClassVar[str] = "the surface is matte"
    avoid: ClassVar[str] = "the surface is glossy, or parts of it shade others"

    def prepare(self, rig: Rig, pixels: int | None = None) -> RigFactor:
        """Factor the light matrix; see :meth:`NormalSolver.prepare`."""
        del pixels  # linear algebra in blocks is as fast without compiled code
        return RigFactor.from_rig(rig)

    def solve(self, state: RigFactor, samples: Samples) -> PixelNormals:
        """Fit every pixel; see :meth:`NormalSolver.solve`."""
        values = state.scratch.copy("values", samples.values)
        usable = _usable(values, samples.weights)
        brightest = values.max(axis=0)
        if not self.gate.shadow:
            return _Fit(state, values, samples.weights, usable, usable).result(brightest, samples)
        kept = np.greater(values, _DARK * brightest, out=state.scratch.array("kept", values.shape, np.bool_))
        if usable is not None:
            kept &= usable
        fit = _Fit(state, values, samples.weights, usable, kept)
        changed = fit.keep(_lit_by_model(fit, state.scratch.array("lit", values.shape, np.bool_)))
        if len(changed):
            fit.keep(_lit_by_model(fit, state.scratch.array("lit again", values.shape, np.bool_), changed))
        poor = np.flatnonzero(fit.singular)
        if len(poor):
            # Dim is not dark: three usable observations of any brightness beat none.
            wider = kept if fit.kept is None else fit.kept.copy()
            wider[:, poor] = values[:, poor] > 0
            fit.keep(wider)
        return fit.result(brightest, samples)


def _usable(values: FloatArray, weights: FloatArray | None) -> BoolArray | None:
    """Return which observations may be used, None for all; the others' values become zero."""
    usable = None
    with np.errstate(invalid="ignore", over="ignore"):
        total = values.sum()
    if not np.isfinite(total):
        usable = np.isfinite(values)
    if weights is not None:
        usable = weights > 0 if usable is None else usable & (weights > 0)
    if usable is not None:
        values[~usable] = 0.0
    return usable


def _lit_by_model(fit: "_Fit", lit: BoolArray, pixels: IntArray | None = None) -> BoolArray:
    """Return in `lit` the observations that a fit calls lit; those of other pixels than `pixels` stay as they were."""
    threshold = _DARK * fit.albedo()
    if pixels is None:
        for start in range(0, lit.shape[1], _PART):
            some = slice(start, start + _PART)
            lit[:, some] = _lit_part(fit, some, threshold[some])
        return lit
    lit[:] = True if fit.kept is None else fit.kept
    for start in range(0, len(pixels), _PART):
        few = pixels[start : start + _PART]
        lit[:, few] = _lit_part(fit, few, threshold[few])
    return lit


def _lit_part(fit: "_Fit", part: slice | IntArray, threshold: FloatArray) -> BoolArray:
    """Return the lit observations of a few pixels, or those of the fit where they would be too few."""
    values, predicted = fit.values[:, part], fit.predicted[:, part]
    usable = None if fit.usable is None else fit.usable[:, part]
    with np.errstate(invalid="ignore"):
        front, bright = predicted > threshold, values > threshold
    torn = front & ~bright
    if usable is not None:
        torn &= usable
    lit = front & bright
    some = np.flatnonzero(torn.any(axis=0))
    if len(some):
        noise = _noise_in_shadow(fit, part, some)
        lit[:, some] |= torn[:, some] & (values[:, some] > predicted[:, some] - noise)
    if usable is not None:
        lit &= usable
    short = np.flatnonzero(_count(lit) < 3)
    if len(short):
        lit[:, short] = True if fit.kept is None else fit.kept[:, part][:, short]
    return lit


def _noise_in_shadow(fit: "_Fit", part: slice | IntArray, some: IntArray) -> FloatArray:
    """Return how much an observation may lack by noise, told from those that the fit puts in attached shadow."""
    values = fit.values[:, part][:, some]
    weights = (fit.predicted[:, part][:, some] < 0).astype(np.float64)
    if fit.usable is not None:
        weights *= fit.usable[:, part][:, some]
    count = weights.sum(axis=0)
    if fit.weights is None:
        squares = np.einsum("mp,mp,mp->p", weights, values, values)
        return np.asarray(_NOISE * np.sqrt(squares / np.maximum(count, 1.0)))
    precision = fit.weights[:, part][:, some]
    squares = np.einsum("mp,mp,mp,mp->p", weights, precision, values, values)
    with np.errstate(divide="ignore", invalid="ignore"):  # what has no weight is not usable
        return np.asarray(_NOISE * np.sqrt(squares / np.maximum(count, 1.0) / precision))


def _count(observations: BoolArray) -> FlagArray:
    return np.asarray(observations.sum(axis=0, dtype=np.uint16))


class _Fit:
    """Fits of all pixels of a block, some of which may be done again with other observations.

    Parameters
    ----------
    rig : RigFactor
        The light matrix, factored.
    values : float64 array (m, p)
        Brightness, zero where not usable.
    weights : float array (m, p) or None
        Weights of the observations.
    usable : bool array (m, p) or None
        Observations that may be used, None for all.
    kept : bool array (m, p) or None
        Observations to fit first, None for all.
    """

    def __init__(
        self,
        rig: RigFactor,
        values: FloatArray,
        weights: FloatArray | None,
        usable: BoolArray | None,
        kept: BoolArray | None,
    ) -> None:
        self.rig = rig
        self.values = values
        self.weights = weights
        self.usable = usable
        self.kept = kept
        self.w: FloatArray | None = None
        self.factor: Factor | None = None
        if weights is None and (kept is None or kept.all()):
            # Nothing is left out: the columns of Q are orthonormal and A is the identity.
            self.x: FloatArray = rig.q.T @ values
            self.singular: BoolArray = np.zeros(values.shape[1], np.bool_)
        else:
            self._solve_all()
        predicted = rig.scratch.array("product", values.shape, np.float64)  # the product was used up above
        self.predicted: FloatArray = np.matmul(rig.q, self.x, out=predicted)

    def _solve_all(self) -> None:
        self.w = self.rig.scratch.array("w", self.values.shape, np.float64)
        self.w[:] = 1.0 if self.kept is None else self.kept
        if self.weights is not None:
            self.w *= self.weights
        product = self.rig.scratch.array("product", self.values.shape, np.float64)
        self.x, self.factor, self.singular = self._solve(self.w, np.multiply(self.w, self.values, out=product))

    def keep(self, kept: BoolArray) -> IntArray:
        """Take other observations, fit those pixels again to which this makes a difference, and return them."""
        changed = np.flatnonzero((kept != self.kept).any(axis=0))
        self.kept = kept
        if len(changed) == 0:
            return changed
        if self.factor is None or 2 * len(changed) > len(self.singular):
            self._solve_all()
            np.matmul(self.rig.q, self.x, out=self.predicted)
            return changed
        w = kept[:, changed].astype(np.float64)
        if self.weights is not None:
            w *= self.weights[:, changed]
        x, factor, singular = self._solve(w, w * self.values[:, changed])
        self.x[:, changed], self.singular[changed] = x, singular
        if self.w is not None:
            self.w[:, changed] = w
        for whole, part in zip(self.factor, factor, strict=True):
            whole[changed] = part
        self.predicted[:, changed] = self.rig.q @ x
        return changed

    def _solve(self, w: FloatArray, weighted: FloatArray) -> tuple[FloatArray, Factor, BoolArray]:
        factor, singular = cholesky(self.rig.moments @ w)
        return solve_cholesky(factor, self.rig.q.T @ weighted), factor, singular

    def albedo(self) -> FloatArray:
        """Return the lengths of the scaled normals, (p,)."""
        b = self.rig.r_inverse @ self.x
        b *= b
        return np.asarray(np.sqrt(b.sum(axis=0)))

    def result(self, brightest: FloatArray, asked: Samples) -> PixelNormals:
        """Correct the fits by one step, and tell normals, spread and flags, and what else was asked for."""
        residual = np.subtract(self.values, self.predicted, out=self.predicted)
        if self.w is None or self.factor is None:  # x is exact to rounding as it is
            squares = np.einsum("mp,mp->p", residual, residual)
        else:
            weighted = np.multiply(self.w, residual, out=self.w)
            squares = np.einsum("mp,mp->p", weighted, residual)
            self.x += solve_cholesky(self.factor, self.rig.q.T @ weighted)
        scaled: FloatArray = self.rig.r_inverse @ self.x
        albedo = self.albedo()
        used = np.full(len(albedo), len(self.values), np.uint16) if self.kept is None else _count(self.kept)
        flags = self._flags(used, ~(brightest > 0))
        lost = fatal_mask(flags)
        flags[~lost & ~((albedo > 0) & (albedo < np.inf))] |= np.uint16(Flag.NOT_FINITE)
        scaled[:, fatal_mask(flags)] = np.nan
        with np.errstate(invalid="ignore", divide="ignore"):
            noise = np.sqrt(squares / np.where(used > 3, used - 3.0, np.nan)) / albedo
            normals = scaled / albedo
            uncertainty = noise * angular_spread(self.rig.r_inverse, self.factor, normals)
            covariance = None
            if asked.covariance:
                covariance = angular_covariance(self.rig.r_inverse, self.factor, normals) * (noise * noise)[:, None]
        verdicts = self._verdicts() if asked.verdicts else None
        return PixelNormals(scaled.T, uncertainty, flags, used, covariance, verdicts)

    def _verdicts(self) -> VerdictArray:
        verdicts = np.full(self.values.shape, Verdict.USED, np.uint8)
        if self.kept is not None:
            verdicts[~self.kept] = Verdict.SHADOW
        if self.usable is not None:
            verdicts[~self.usable] = Verdict.UNUSABLE
        return verdicts

    def _flags(self, used: FlagArray, dark: BoolArray) -> FlagArray:
        flags = np.zeros(len(used), np.uint16)
        count = len(self.values)
        available = np.full(len(used), count, np.uint16) if self.usable is None else _count(self.usable)
        marks = (
            (used < 3, Flag.TOO_FEW_LIGHTS),
            (self.singular & (used >= 3), Flag.RANK_DEFICIENT),
            (used == 3, Flag.NO_REDUNDANCY),
            (dark & (available > 0), Flag.NO_SIGNAL),  # a pixel that nobody looked at need not be black
            (available < count, Flag.UNUSABLE_SAMPLE),
            (used < available, Flag.SHADOWED),
        )
        for where, flag in marks:
            np.bitwise_or(flags, np.uint16(flag), out=flags, where=where)
        return flags
