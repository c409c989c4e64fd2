"""Photometric stereo by least squares (Woodham 1980).

A Lambertian pixel shows ``I_i = l_i · b`` under light i, with b the albedo times the normal. Three lights determine b,
more overdetermine it. Where nothing is left out, one factorisation of the light matrix serves all pixels; where shadows
or saturated values are left out, each pixel has its own small system, see :mod:`psstereo.normals.moments`.

The shadow gate works in two passes. The first leaves out what is dark against the pixel's brightest value and fits the
rest. The second judges by that fit instead of by the noisy values themselves: an observation stays if the fit says that
its light is in front of the surface (no attached shadow) and its value is not dark against the albedo (no cast shadow).
Only pixels whose choice changed are fitted again.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.flags import Flag, fatal_mask
from psstereo.lights import Rig
from psstereo.normals.moments import Factor, RigFactor, angular_spread, cholesky, solve_cholesky
from psstereo.normals.solver import NormalSolver, PixelNormals, Samples
from psstereo.types import BoolArray, FlagArray, FloatArray

__all__ = ["LeastSquares"]

_DARK = 0.02
"""Share of the albedo below which a value counts as shadow, and cosine below which a light counts as grazing."""


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
            return _Fit(state, values, samples.weights, usable, usable).result(brightest)
        kept = np.greater(values, _DARK * brightest, out=state.scratch.array("kept", values.shape, np.bool_))
        if usable is not None:
            kept &= usable
        fit = _Fit(state, values, samples.weights, usable, kept)
        fit.keep(_lit_by_model(fit))
        poor = np.flatnonzero(fit.singular)
        if len(poor):
            # Dim is not dark: three usable observations of any brightness beat none.
            wider = kept if fit.kept is None else fit.kept.copy()
            wider[:, poor] = values[:, poor] > 0
            fit.keep(wider)
        return fit.result(brightest)


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


def _lit_by_model(fit: "_Fit") -> BoolArray:
    """Return the observations that are lit according to a first fit, or its own where they would be too few."""
    lit: BoolArray = fit.rig.scratch.array("lit", fit.values.shape, np.bool_)
    with np.errstate(invalid="ignore"):
        threshold = _DARK * fit.albedo()
        np.greater(fit.values, threshold, out=lit)
        lit &= np.greater(fit.predicted, threshold, out=fit.rig.scratch.array("front", lit.shape, np.bool_))
    if fit.usable is not None:
        lit &= fit.usable
    few = np.flatnonzero(_count(lit) < 3)
    if len(few):
        lit[:, few] = True if fit.kept is None else fit.kept[:, few]
    return lit


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

    def keep(self, kept: BoolArray) -> None:
        """Take other observations, and fit those pixels again to which this makes a difference."""
        changed = np.flatnonzero((kept != self.kept).any(axis=0))
        self.kept = kept
        if len(changed) == 0:
            return
        if self.factor is None or 2 * len(changed) > len(self.singular):
            self._solve_all()
            np.matmul(self.rig.q, self.x, out=self.predicted)
            return
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

    def _solve(self, w: FloatArray, weighted: FloatArray) -> tuple[FloatArray, Factor, BoolArray]:
        factor, singular = cholesky(self.rig.moments @ w)
        return solve_cholesky(factor, self.rig.q.T @ weighted), factor, singular

    def albedo(self) -> FloatArray:
        """Return the lengths of the scaled normals, (p,)."""
        b = self.rig.r_inverse @ self.x
        b *= b
        return np.asarray(np.sqrt(b.sum(axis=0)))

    def result(self, brightest: FloatArray) -> PixelNormals:
        """Correct the fits by one step, and tell normals, spread and flags."""
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
        return PixelNormals(scaled.T, self._uncertainty(scaled, albedo, squares, used), flags, used)

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

    def _uncertainty(self, scaled: FloatArray, albedo: FloatArray, squares: FloatArray, used: FlagArray) -> FloatArray:
        with np.errstate(invalid="ignore", divide="ignore"):
            noise = np.sqrt(squares / np.where(used > 3, used - 3.0, np.nan))
            spread = angular_spread(self.rig.r_inverse, self.factor, scaled / albedo)
            return np.asarray(noise / albedo * spread)
