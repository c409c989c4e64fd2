"""Fits under sun and sky: what is in the sun, and the scaled normal, in turn.

A sky of spherical harmonics up to order 2 gives the irradiance ``E(n) = a + h·n + nᵀ Q n`` with a number a, a vector h
and a traceless Q for each image. Times the albedo |b| that is homogeneous of first degree in the scaled normal b, so
that the model is its own gradient times b, and Gauss–Newton on b is plain least squares with rows that follow n.
"""

from dataclasses import dataclass

import numpy as np

from psstereo.flags import Flag, fatal_mask
from psstereo.lights.sphere_rule import sphere_rule
from psstereo.normals.solver import PixelNormals
from psstereo.normals.verdict import Verdict
from psstereo.types import BoolArray, FlagArray, FloatArray, IntArray

__all__ = ["SkyFit", "SkyState", "SkyTerms", "sky_terms"]

_FAN = 1024
"""Normals over the whole sphere, some 6 degrees apart, of which those that face the camera are tried as a start."""
_ROUNDS = 40
_FREE = 20
"""Rounds after which what is lit stays, so that the iteration can settle."""
_SETTLED = 1e-9
_HALF = 0.5
"""Share of the sun's part from which an observation counts as in the sun: midway between none and all of it."""
_GRAIN = 1e-9
"""Least determinant of a pixel's matrix over the cube of its mean eigenvalue that counts as told [1]."""


@dataclass(frozen=True, eq=False)
class SkyTerms:
    """The sky of each image as polynomials of the normal, over the sun's strength.

    Attributes
    ----------
    level : float64 array (m,)
        a.
    slope : float64 array (m, 3)
        h.
    curve : float64 array (m, 3, 3)
        Q, symmetric.
    """

    level: FloatArray
    slope: FloatArray
    curve: FloatArray


def sky_terms(coefficients: FloatArray) -> SkyTerms:
    """Return the irradiance of skies as polynomials of the normal.

    Parameters
    ----------
    coefficients : float64 array (m, 1 or 4 or 9)
        Radiances L_lm in the order of :func:`psstereo.lights.real_harmonics`, over the sun's strength.

    Returns
    -------
    SkyTerms
        a, h, Q.
    """
    given = np.asarray(coefficients, np.float64)
    c = np.zeros((len(given), 9))
    c[:, : given.shape[1]] = given
    flat, linear, mixed = 0.5 * np.sqrt(1 / np.pi), np.sqrt(0.75 / np.pi), 0.5 * np.sqrt(15 / np.pi)
    round_, quarter = 0.25 * np.sqrt(5 / np.pi), 0.25 * np.pi
    curve = np.zeros((len(c), 3, 3))
    curve[:, 0, 0] = quarter * (0.5 * mixed * c[:, 8] - round_ * c[:, 6])
    curve[:, 1, 1] = quarter * (-0.5 * mixed * c[:, 8] - round_ * c[:, 6])
    curve[:, 2, 2] = quarter * 2.0 * round_ * c[:, 6]
    for (i, j), k in (((0, 1), 4), ((1, 2), 5), ((0, 2), 7)):
        curve[:, i, j] = curve[:, j, i] = 0.5 * quarter * mixed * c[:, k]
    return SkyTerms(
        level=np.pi * flat * c[:, 0],
        slope=(2.0 * np.pi / 3.0) * linear * c[:, [3, 1, 2]],
        curve=curve,
    )


@dataclass(frozen=True, eq=False)
class SkyState:
    """Suns and skies.

    Attributes
    ----------
    directions : float64 array (m, 3)
        Toward the suns [1].
    terms : SkyTerms
        Skies.
    """

    directions: FloatArray
    terms: SkyTerms


class SkyFit:
    """Some pixels, being fitted; unlike elsewhere one row a pixel, since each has a matrix of its own.

    Parameters
    ----------
    state : SkyState
        Suns and skies.
    values, weights : float64 array (p, m)
        Brightness, and weights that are 0 where it is not usable.
    gated : bool
        Whether shadows are looked for.
    """

    def __init__(self, state: SkyState, values: FloatArray, weights: FloatArray, *, gated: bool) -> None:
        count = len(values)
        self.state, self.y, self.w, self.gated = state, values, weights, gated
        self.b: FloatArray = np.zeros((count, 3))
        self.sky: FloatArray = np.zeros((*values.shape, 3))
        self.lit: BoolArray = np.ones(values.shape, np.bool_)
        self.moments: FloatArray = np.zeros((count, 3, 3))
        self.loss: FloatArray = np.full(count, np.inf)
        self.settled: BoolArray = np.zeros(count, np.bool_)

    def run(self) -> None:
        """Fit from the normal that explains each pixel best among a fan, then let shadows and normal follow the fit.

        What is lit can swing to where nothing is; of all rounds the one with the least residual counts.
        """
        unit = self._start()
        self.sky, self.lit = self._sky_rows(unit), np.asarray(unit @ self.state.directions.T > 0)
        self._step()
        index = np.arange(len(self.b))
        part = self._some(index)
        for k in range(_ROUNDS):
            part._round(free=k < _FREE)
            better = part.loss <= self.loss[index] * (1.0 + 1e-9)
            for name in ("b", "sky", "lit", "moments", "loss"):
                getattr(self, name)[index[better]] = getattr(part, name)[better]
            self.settled[index] = part.settled
            index, part = index[~part.settled], part._some(np.flatnonzero(~part.settled))
            if len(index) == 0:
                break

    def _some(self, index: IntArray) -> "SkyFit":
        """Return a copy of some of the pixels."""
        part = SkyFit(self.state, self.y[index], self.w[index], gated=self.gated)
        part.b, part.sky, part.lit = self.b[index], self.sky[index], self.lit[index]
        part.moments, part.loss = self.moments[index], self.loss[index]
        return part

    def _start(self) -> FloatArray:
        """Return for each pixel the normal of a fan whose brightness is most nearly proportional to what is seen."""
        terms, fan = self.state.terms, _fan()
        bent = np.einsum("mij,fj,fi->mf", terms.curve, fan, fan)
        shape = np.maximum(self.state.directions @ fan.T, 0.0) + terms.level[:, None] + terms.slope @ fan.T + bent
        with np.errstate(divide="ignore", invalid="ignore"):
            match = ((self.w * self.y) @ shape) / np.sqrt(self.w @ shape**2)
        return np.asarray(fan[np.nan_to_num(match, nan=-np.inf).argmax(axis=1)])

    def _round(self, *, free: bool) -> None:
        """Choose what is in the sun, if that is free, and solve."""
        before, was = self.b, self.lit
        if free:
            sun = self.b @ self.state.directions.T
            self.lit = np.asarray(sun > 0)
            if self.gated:
                # In the sun is what faces it and shows more than half of what it adds.
                self.lit &= self.y - self.sky_part() > _HALF * sun
        self._step()
        still = np.abs(self.b - before).max(axis=1) <= _SETTLED * np.linalg.norm(self.b, axis=1)
        self.settled = still & (self.lit == was).all(axis=1)

    def _sky_rows(self, unit: FloatArray) -> FloatArray:
        """Return the gradient of the sky's part by b, (p, m, 3)."""
        terms = self.state.terms
        bent = (unit @ terms.curve).transpose(1, 0, 2)
        inner = (bent * unit[:, None]).sum(axis=2)
        return np.asarray((terms.level - inner)[..., None] * unit[:, None] + terms.slope + 2.0 * bent)

    def sky_part(self) -> FloatArray:
        """Return what the sky adds to each observation, (p, m)."""
        return np.asarray((self.sky @ self.b[:, :, None])[..., 0])

    def residual(self) -> FloatArray:
        """Return brightness less the model, (p, m)."""
        return np.asarray(self.y - self.sky_part() - self.lit * (self.b @ self.state.directions.T))

    def _step(self) -> None:
        """Solve for b with the rows at the last normals; the sky's rows are those of the new ones then."""
        rows = self.sky + self.lit[..., None] * self.state.directions
        weighted = (rows * self.w[..., None]).transpose(0, 2, 1)
        self.moments = weighted @ rows
        size = np.einsum("pii->p", self.moments) / 3.0
        singular = ~(np.linalg.det(self.moments) > _GRAIN * size**3)
        safe = np.where(singular[:, None, None], np.eye(3), self.moments)
        solved = np.linalg.solve(safe, weighted @ self.y[..., None])[..., 0]
        self.b = np.where(singular[:, None], 0.0, solved)
        self.sky = self._sky_rows(_unit(self.b))
        self.loss = np.where(singular, np.inf, (self.w * self.residual() ** 2).sum(axis=1))

    def write(self, found: PixelNormals, where: slice) -> None:
        """Put normals, errors, flags and what else was asked for into the answer."""
        albedo, usable = np.linalg.norm(self.b, axis=1), self.w > 0
        available = usable.sum(axis=1)
        flags = self._flags(albedo, available)
        lost = fatal_mask(flags)
        found.scaled[where] = np.where(lost[:, None], np.nan, self.b)
        found.flags[where], found.used[where] = flags, available.astype(np.uint16)
        power = (self.w * self.residual() ** 2).sum(axis=1) / np.where(available > 3, available - 3.0, np.nan)
        unit = _unit(self.b)
        across = np.eye(3) - unit[:, :, None] * unit[:, None, :]
        safe = np.where(np.isinf(self.loss)[:, None, None], np.eye(3), self.moments)
        with np.errstate(divide="ignore", invalid="ignore"):
            spread = across @ np.linalg.inv(safe) @ across * (power / albedo**2)[:, None, None]
        spread[lost] = np.nan
        found.uncertainty[where] = np.sqrt(np.einsum("pii->p", spread))
        if found.covariance is not None:
            found.covariance[where] = spread[:, [0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
        if found.ambient is not None:
            found.ambient[where] = np.where(lost, np.nan, self.sky_part().mean(axis=1))
        if found.verdicts is not None:
            verdicts = np.where(self.lit, np.uint8(Verdict.USED), np.uint8(Verdict.SHADOW))
            found.verdicts[:, where] = np.where(usable, verdicts, np.uint8(Verdict.UNUSABLE)).T

    def _flags(self, albedo: FloatArray, available: FlagArray) -> FlagArray:
        usable = self.w > 0
        high = np.where(usable, self.y, 0.0).max(axis=1)
        few = (self.lit & usable).sum(axis=1) < 3
        marks = (
            (few, Flag.TOO_FEW_LIGHTS),
            (np.isinf(self.loss) & ~few, Flag.RANK_DEFICIENT),
            (available == 3, Flag.NO_REDUNDANCY),
            ((high <= 0) & (available > 0), Flag.NO_SIGNAL),
            (available < usable.shape[1], Flag.UNUSABLE_SAMPLE),
            ((~self.lit & usable).any(axis=1), Flag.SHADOWED),
            (~self.settled, Flag.NOT_CONVERGED),
        )
        flags = np.zeros(len(available), np.uint16)
        for condition, flag in marks:
            np.bitwise_or(flags, np.uint16(flag), out=flags, where=condition)
        flags[~fatal_mask(flags) & ~((albedo > 0) & (albedo < np.inf))] |= np.uint16(Flag.NOT_FINITE)
        return flags


def _fan() -> FloatArray:
    """Return normals that face the camera, the same after a quarter turn of the picture, (f, 3)."""
    x, y, z = sphere_rule(_FAN // 4)[0].T
    x, y, z = x[z > 0], y[z > 0], z[z > 0]
    return np.concatenate([np.stack(turned, axis=1) for turned in ((x, y, z), (-y, x, z), (-x, -y, z), (y, -x, z))])


def _unit(b: FloatArray) -> FloatArray:
    length = np.linalg.norm(b, axis=1, keepdims=True)
    return np.asarray(b / np.where(length > 0, length, 1.0))
