"""Constrained bivariate inverse regression at every pixel: the readable reference.

Seen from one place, an isotropic surface shows a brightness I that depends on n·l and l·v alone; so where brightness
rises with n·l there is an inverse, ``n·l = g(I, l·v)``. In z, the brightness over the highest one looked at, and t, the
height of the light from 0 for the lowest to 1 for the highest,

    g = Σ_k (a_k + t b_k) C_k(z),    a_k ≥ 0, b_k ≥ 0,

with C_k = Σ_{j ≥ k} of the Bernstein polynomials of order K, for k from 1: a_k and b_k are increments of the control
values. So g is zero in the dark, never falls with brightness and never falls with the height of the light; with 1 - t
in place of t it never rises. Lambert's law has all a_k equal and b_k = 0, and all are tied to these, by a fixed ridge
and one that grows with the variance of the residuals.

``Σ w (n·l − g)²`` is least over n and the increments, whose sum is fixed since all zero would fit as well. The normal
is eliminated, and the increments solve a convex quadratic programme in a few exchanges, see :func:`programme`; weights
by Tukey's loss follow, and so on until the normal rests. Of the two directions that one is kept whose n·l follow
brightness closer by a plain proportion, as published, unless the other one's loss is less than half as great: where
noise is all there is to fit, the loss would choose by chance, and where a reflectance is, the proportion would.
"""

import math
from typing import NamedTuple

import numpy as np

from psstereo.kernels.bipolynomial import (
    DEVIATION,
    FAILED,
    FLOOR,
    JITTER,
    LEAST_SLOPE,
    NOTHING,
    SETTLED,
    SHORT,
    TUKEY,
    UNSETTLED,
    Fit,
    lower_ranks,
    tangents,
)
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Settings", "cumulative_bernstein", "fit_pixels", "programme"]

WRONG_SIGN = -1e-9
"""Multiplier over the diagonal below which a bound is let go."""
CLEARLY = 0.5
"""Ratio of two losses below which the smaller one counts."""
_PART = 256


class Settings(NamedTuple):
    """Numbers of a fit; a plain tuple, so that compiled code takes it as it is."""

    order: int  # of the Bernstein polynomials
    share: float  # of the lit observations, from the darkest
    least: int  # observations that a fit has at least
    dark: float  # share of the albedo, and cosine, below which an observation counts as shadow
    ridge: float
    noise_ridge: float  # times the residuals' variance
    hold: int  # rounds in which the scale follows
    rounds: int
    tolerance: float  # change of the normal in a round below which a pixel is done


def cumulative_bernstein(z: FloatArray, order: int) -> FloatArray:
    """Return ``C_k(z) = Σ_{j ≥ k} B_j(z)`` for k = 1 … order, as a new last axis."""
    basis = np.zeros((*z.shape, order + 1))
    basis[..., 0] = 1.0
    for _ in range(order):
        raised = z[..., None] * basis[..., :-1]
        basis *= (1 - z)[..., None]
        basis[..., 1:] += raised
    return np.ascontiguousarray(np.cumsum(basis[..., ::-1], axis=-1)[..., -2::-1])


def programme(m: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, free: BoolArray) -> BoolArray:
    """Minimise ``½ dᵀ M d − bᵀ d`` with ``cᵀ d = 1`` and ``d ≥ 0``, in place, by an active set.

    Parameters
    ----------
    m : float64 array (p, k, k)
        Positive definite matrices.
    b, c : float64 arrays (p, k)
        Right-hand sides, and weights of the sum.
    d : float64 array (p, k)
        A feasible point to start from; the solution.
    free : bool array (p, k)
        Entries that are not held at zero; those of the solution.

    Returns
    -------
    bool array (p,)
        Where the solution was reached.
    """
    p, size = d.shape
    done = np.zeros(p, np.bool_)
    left = np.arange(p)
    diagonal = np.arange(size)
    for _ in range(4 * size):
        if len(left) == 0:
            break
        open_, at = free[left], d[left]
        a = np.where(open_[:, :, None] & open_[:, None, :], m[left], 0.0)
        a[:, diagonal, diagonal] += ~open_
        both = np.linalg.solve(a, np.stack([np.where(open_, b[left], 0.0), np.where(open_, c[left], 0.0)], axis=2))
        u, v = both[..., 0], both[..., 1]
        multiplier = (1 - (c[left] * u).sum(axis=1)) / (c[left] * v).sum(axis=1)
        target = u + multiplier[:, None] * v
        below = open_ & (target < 0)
        with np.errstate(invalid="ignore", divide="ignore"):
            step = np.where(below, at / (at - target), 1.0)
        block = np.argmin(step, axis=1)
        step = np.minimum(step[np.arange(len(left)), block], 1.0)
        blocked = below[np.arange(len(left)), block]
        d[left] = np.where(open_, at + step[:, None] * (target - at), 0.0)
        d[left[blocked], block[blocked]] = 0.0
        free[left[blocked], block[blocked]] = False
        gradient = (m[left] @ d[left][..., None])[..., 0] - b[left] - multiplier[:, None] * c[left]
        ratio = np.where(open_, 0.0, gradient / m[left][:, diagonal, diagonal])
        worst = np.argmin(ratio, axis=1)
        wrong = ~blocked & (ratio[np.arange(len(left)), worst] < WRONG_SIGN)
        free[left[wrong], worst[wrong]] = True
        done[left[~blocked & ~wrong]] = True
        left = left[blocked | wrong]
    return done


def fit_pixels(
    values: FloatArray,
    weights: FloatArray,
    start: FloatArray,
    directions: FloatArray,
    heights: FloatArray,
    settings: Settings,
) -> Fit:
    """Fit pixels.

    Parameters
    ----------
    values : float64 array (p, m)
        Brightness, a row a pixel; what is not finite is left out.
    weights : float64 array (p, m) or (0, 0)
        Inverse variances up to a factor; all 1 if empty.
    start : float64 array (p, 3)
        Scaled normals that say which lights are in front.
    directions : float64 array (m, 3)
        Unit vectors to the lights.
    heights : float64 array (m,)
        Of the lights, 0 … 1.
    settings : Settings
        Numbers of the fit.

    Returns
    -------
    Fit
        As of the bi-polynomial fit; `brightness` is the slope of brightness with n·l over the values looked at.
    """
    p, m = values.shape
    out = Fit(
        np.full((p, 3), np.nan), np.full(p, np.nan), np.full((p, 3), np.nan), np.full(p, SHORT), np.full((p, m), np.nan)
    )
    for first in range(0, p, _PART):
        part = slice(first, first + _PART)
        base = np.ones_like(values[part]) if weights.size == 0 else weights[part]
        _fit_part(values[part], base, start[part], directions, heights, settings, out.part(part))
    return out


def _fit_part(
    values: FloatArray,
    weights: FloatArray,
    start: FloatArray,
    directions: FloatArray,
    heights: FloatArray,
    settings: Settings,
    out: Fit,
) -> None:
    chosen = lower_ranks(values, weights, start, directions, settings.share, settings.least, settings.dark)
    out.share[:] = chosen.share
    rows = chosen.rows
    if len(rows) == 0:
        return
    scores, losses = [], []
    for rising in (True, False):
        t = heights if rising else 1 - heights
        fit = _Regression(chosen.y, chosen.u, chosen.start, directions[chosen.at], t[chosen.at], settings)
        fit.run()
        scores.append(fit.score())
        losses.append(fit.loss())
        better = np.ones(len(rows), np.bool_)
        if not rising:
            better = scores[1] < scores[0]
            better = np.where(losses[1] < CLEARLY * losses[0], True, better)
            better &= ~(losses[0] < CLEARLY * losses[1])
        length = np.sqrt((fit.n * fit.n).sum(axis=1))
        spread, weight = fit.spread(length)
        to = rows[better]
        out.normal[to], out.brightness[to] = (fit.n / length[:, None])[better], (length * chosen.rho)[better]
        out.spread[to], out.outcome[to] = spread[better], fit.outcome[better]
        which, place = np.nonzero((chosen.u > 0) & better[:, None])
        out.share[rows[which], chosen.at[which, place]] = weight[which, place]


class _Regression:
    """The state of some pixels between two rounds, for one of the two directions.

    Parameters
    ----------
    y, u : float64 arrays (p, k)
        Chosen values over the start's albedo, and their weights with the greatest 1; zero where there are fewer than k.
    n : float64 array (p, 3)
        Normals to start from.
    lights, t : float64 arrays (p, k, 3), (p, k)
        Their lights and heights.
    settings : Settings
        Numbers of the fit.
    """

    def __init__(
        self, y: FloatArray, u: FloatArray, n: FloatArray, lights: FloatArray, t: FloatArray, settings: Settings
    ) -> None:
        self.y, self.u, self.n, self.lights, self.settings = y, u, n.copy(), lights, settings
        p, order = len(y), settings.order
        top = y.max(axis=1)
        curves = cumulative_bernstein(y / top[:, None], order)
        self.basis = np.concatenate([curves, curves * t[..., None]], axis=2)
        one, zero = np.ones(order), np.zeros(order)
        self.lambert = top[:, None] / order * np.concatenate([one, zero])
        self.c = np.concatenate([one, 0.5 * one]) / top[:, None]
        self.d = self.lambert.copy()
        self.free = np.ones(self.d.shape, np.bool_)
        self.total, self.count = u.sum(axis=1), (u > 0).sum(axis=1)
        self.scale = np.full(p, FLOOR)
        self.outcome = np.full(p, UNSETTLED)

    def run(self) -> None:
        """Take rounds until all are settled or none is left."""
        for k in range(self.settings.rounds):
            rows = np.flatnonzero(self.outcome == UNSETTLED)
            if len(rows) == 0:
                return
            self._round(rows, k)

    def _residuals(self, rows: IntArray) -> FloatArray:
        shading = (self.lights[rows] @ self.n[rows][..., None])[..., 0]
        return np.asarray(shading - (self.basis[rows] @ self.d[rows][..., None])[..., 0])

    def _scale(self, r: FloatArray, rows: IntArray) -> FloatArray:
        u, count = self.u[rows], self.count[rows]
        ordered = np.sort(np.where(u > 0, np.abs(r) * np.sqrt(u), np.inf), axis=1)
        # The fit makes residuals small; about half of the increments are bound.
        rank = np.minimum((count + self.settings.order + 3) / 2, count - 1.0).astype(np.intp)
        return np.maximum(FLOOR, np.take_along_axis(ordered, rank[:, None], axis=1)[:, 0] * DEVIATION)

    def _weights(self, r: FloatArray, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        z2 = r * r * self.u[rows] / (TUKEY * self.scale[rows][:, None]) ** 2
        return np.where(z2 < 1, (1 - z2) ** 2, 0.0), z2

    def _tie(self, rows: IntArray) -> FloatArray:
        ridge = self.settings.ridge + self.settings.noise_ridge * self.scale[rows] ** 2 + JITTER
        return np.asarray((ridge * self.total[rows])[:, None])

    def _round(self, rows: IntArray, k: int) -> None:
        r = self._residuals(rows)
        if k < self.settings.hold:
            self.scale[rows] = self._scale(r, rows)
        w = self._weights(r, rows)[0] * self.u[rows]
        lights, basis, tie = self.lights[rows], self.basis[rows], self._tie(rows)
        weighted = (w[..., None] * lights).transpose(0, 2, 1)
        a = weighted @ lights
        trace = a[:, 0, 0] + a[:, 1, 1] + a[:, 2, 2]
        # The tiny multiple of the trace matters only where the fit has already failed.
        a[:, np.arange(3), np.arange(3)] += (1e-14 * trace + 1e-300)[:, None]
        g = weighted @ basis
        x = np.linalg.solve(a, g)
        m = (w[..., None] * basis).transpose(0, 2, 1) @ basis - x.transpose(0, 2, 1) @ g
        diagonal = np.arange(m.shape[1])
        m[:, diagonal, diagonal] += tie
        d, free = self.d[rows], self.free[rows]
        solved = programme(m, tie * self.lambert[rows], self.c[rows], d, free)
        n = (x @ d[..., None])[..., 0]
        before, after = self.n[rows], n
        with np.errstate(invalid="ignore", divide="ignore"):
            change = after / np.linalg.norm(after, axis=1, keepdims=True)
            change = change - before / np.linalg.norm(before, axis=1, keepdims=True)
            size = np.sqrt((change * change).sum(axis=1))
        good = solved & np.isfinite(size)
        self.n[rows[good]], self.d[rows[good]], self.free[rows[good]] = n[good], d[good], free[good]
        still = (k + 1 >= self.settings.hold) & (size <= self.settings.tolerance)
        self.outcome[rows] = np.where(good, np.where(still, SETTLED, UNSETTLED), FAILED)

    def loss(self) -> FloatArray:
        """Return the sum of Tukey's loss."""
        rows = np.arange(len(self.y))
        z2 = self._weights(self._residuals(rows), rows)[1]
        each = np.where(z2 < 1, 1 - (1 - np.minimum(z2, 1.0)) ** 3, 1.0) * (self.u > 0)
        loss = each.sum(axis=1) * self.scale**2 + NOTHING * self.total
        return np.where(self.outcome == FAILED, np.inf, loss)

    def score(self) -> FloatArray:
        """Return how far n·l is from a multiple of brightness, as the squared sine of an angle."""
        rows = np.arange(len(self.y))
        w = self._weights(self._residuals(rows), rows)[0] * self.u
        shading = (self.lights @ self.n[..., None])[..., 0]
        product = (w * shading * self.y).sum(axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            score = 1 - product**2 / ((w * self.y**2).sum(axis=1) * (w * shading**2).sum(axis=1))
        return np.where((self.outcome == FAILED) | np.isnan(score), np.inf, score)

    def spread(self, length: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the covariance along the tangents, with the free increments unknown, and signed weights.

        The sum of the increments is known. Of an M-estimate: the mean square of the influence over the square of its
        mean slope, times the inverse of the undiminished normal matrix.
        """
        rows = np.arange(len(self.y))
        r = self._residuals(rows)
        weight, z2 = self._weights(r, rows)
        tie, free = self._tie(rows), np.concatenate([np.ones((len(rows), 3), np.bool_), self.free], axis=1)
        columns = np.concatenate([self.lights, -self.basis], axis=2) * free[:, None, :]
        p = (self.u[..., None] * columns).transpose(0, 2, 1) @ columns
        diagonal = np.arange(p.shape[1])
        p[:, diagonal, diagonal] += ~free
        p[:, diagonal[3:], diagonal[3:]] += tie
        p[:, diagonal[:3], diagonal[:3]] += JITTER * self.total[:, None]
        inverse = np.linalg.inv(p)
        c = np.concatenate([np.zeros((len(rows), 3)), self.c * self.free], axis=1)
        along = (inverse @ c[..., None])[..., 0]
        inverse -= along[:, :, None] * along[:, None, :] / (along * c).sum(axis=1)[:, None, None]
        freedom = self.count - 2.0 - self.free.sum(axis=1)
        freedom += (tie * self.free * inverse[:, diagonal[3:], diagonal[3:]]).sum(axis=1)
        inner = (weight * weight * r * r * self.u).sum(axis=1)
        slope = np.where((z2 < 1) & (self.u > 0), (1 - z2) * (1 - 5 * z2), 0.0).sum(axis=1) / self.count
        turn = tangents(self.n / length[:, None])
        flat = turn @ inverse[:, :3, :3] @ turn.transpose(0, 2, 1) / (length * length)[:, None, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            factor = np.where((freedom > 0) & (slope > LEAST_SLOPE), inner / freedom / (slope * slope), math.nan)
        spread = np.stack([flat[:, 0, 0], flat[:, 0, 1], flat[:, 1, 1]], axis=1) * factor[:, None]
        # A value above the fit is one whose n·l falls short of what its brightness asks for.
        return spread, np.where(r > 0, -weight, weight)
