"""Bi-polynomial reflectance over the darker lit observations of every pixel: the readable reference.

A pixel's brightness over its start albedo is modelled as ``y_i = s_i f(x_i, z_i)`` with ``s_i = n·l_i``, the heights
``x_i = n·h_i`` and ``z_i = v·h_i`` over the half vector between light and view, and ``f = Σ c_jk x^j z^k`` a polynomial
about a middle angle. The normal (two unknowns across it) and the coefficients are sought together by damped
Gauss–Newton steps.

* Only the lower ranks of the lit observations take part: there a reflectance is smooth and a highlight is not.
* All coefficients but the constant are tied to zero, which is Lambert's law, by a fixed ridge and by one that grows
  with the variance of the residuals: noise is not explained by reflectance.
* Tukey's loss leaves out cast shadows and light from neighbours. Its scale follows the median of the residuals for
  some rounds and is then held, so that from there on every step lowers the same sum.

A step is kept if the weighted sum of squares does not rise; otherwise the next one is damped more. An observation takes
part or not by the start normal alone.
"""

import math
from typing import NamedTuple

import numpy as np

from psstereo.types import FloatArray, IntArray

__all__ = [
    "FAILED",
    "SETTLED",
    "SHORT",
    "UNSETTLED",
    "Chosen",
    "Fit",
    "Settings",
    "across",
    "fit_pixels",
    "lower_ranks",
    "tangents",
]

SETTLED, UNSETTLED, FAILED, SHORT = 0, 1, 2, 3
"""Outcomes: converged; not; no positive reflectance; too few lit observations or no start."""

DEVIATION = 1.4826022185056018
"""Standard deviation over the median of the absolute value, of Gaussian noise [1]."""
FLOOR = 1e-3
"""Least scale of the residuals, as a share of the albedo."""
TUKEY = 4.685
"""Where Tukey's loss ends, in scales [1]."""
LONGEST = 0.2
"""Longest step of the normal in a round [rad]."""
JITTER = 1e-12
"""Added to the diagonal against exact singularity, times the number of observations."""
FIRST_DAMPING, LEAST_SLOPE = 1e-3, 0.25
CLOSE = 1 + 1e-9
"""A sum of squares that rises by less has not risen."""
NOTHING = 1e-24
"""Square of a residual that is rounding."""
_PART = 256
"""Pixels worked on at once, so that the working arrays stay small."""


class Settings(NamedTuple):
    """Numbers of a fit; a plain tuple, so that compiled code takes it as it is."""

    share: float  # of the lit observations, from the darkest
    least: int  # observations that a fit has at least
    dark: float  # share of the albedo, and cosine, below which an observation counts as shadow
    ridge: float
    noise_ridge: float  # times the residuals' variance
    hold: int  # rounds in which the scale follows
    rounds: int
    tolerance: float  # step of the normal below which a pixel is done


class Fit(NamedTuple):
    """What was found at some pixels.

    Attributes
    ----------
    normal : float64 array (p, 3)
        Unit normals; NaN where the outcome is `SHORT`.
    brightness : float64 array (p,)
        The start's albedo times the constant of the polynomial.
    spread : float64 array (p, 3)
        Covariance of the normal along the two :func:`tangents`, entries 11, 12, 22; NaN where it cannot be told.
    outcome : int64 array (p,)
        `SETTLED`, `UNSETTLED`, `FAILED` or `SHORT`.
    share : float64 array (p, m)
        Weight of each observation, 0 … 1, negative for values below the fit; 2 where it is lit but above the ranks,
        3 where it is dark, NaN where it is not usable.
    """

    normal: FloatArray
    brightness: FloatArray
    spread: FloatArray
    outcome: IntArray
    share: FloatArray

    def part(self, pixels: slice) -> "Fit":
        """Return views of some pixels' arrays."""
        normal, brightness, spread = self.normal[pixels], self.brightness[pixels], self.spread[pixels]
        return Fit(normal, brightness, spread, self.outcome[pixels], self.share[pixels])


def tangents(normals: FloatArray) -> FloatArray:
    """Return two unit vectors across each normal, (p, 2, 3): the axis most across it, set upright, and a turn."""
    axis = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    one = axis - (axis * normals).sum(axis=1, keepdims=True) * normals
    one /= np.sqrt((one * one).sum(axis=1, keepdims=True))
    return np.stack([one, np.cross(normals, one)], axis=1)


def across(normals: FloatArray, spread: FloatArray) -> FloatArray:
    """Return covariances (p, 6), entries xx, xy, yy, xz, yz, zz, from those along the tangents, (p, 3)."""
    one, two = tangents(normals).transpose(1, 2, 0)
    a, b, c = spread.T
    pairs = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
    return np.stack(
        [a * one[i] * one[k] + b * (one[i] * two[k] + two[i] * one[k]) + c * two[i] * two[k] for i, k in pairs], axis=1
    )


def fit_pixels(
    values: FloatArray,
    weights: FloatArray,
    start: FloatArray,
    geometry: FloatArray,
    powers: FloatArray,
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
        Scaled normals to start from.
    geometry : float64 array (m, 7)
        Directions, half vectors over the unit of x, and the middle of x in that unit.
    powers : float64 array (m, d + 1)
        Powers of z from 0.
    settings : Settings
        Numbers of the fit.

    Returns
    -------
    Fit
        Normals and what is known of them.
    """
    p, m = values.shape
    out = Fit(
        np.full((p, 3), np.nan), np.full(p, np.nan), np.full((p, 3), np.nan), np.full(p, SHORT), np.full((p, m), np.nan)
    )
    for first in range(0, p, _PART):
        part = slice(first, first + _PART)
        base = np.ones_like(values[part]) if weights.size == 0 else weights[part]
        _fit_part(values[part], base, start[part], geometry, powers, settings, out.part(part))
    return out


def _fit_part(
    values: FloatArray,
    weights: FloatArray,
    start: FloatArray,
    geometry: FloatArray,
    powers: FloatArray,
    settings: Settings,
    out: Fit,
) -> None:
    chosen = lower_ranks(values, weights, start, geometry[:, :3], settings.share, settings.least, settings.dark)
    out.share[:] = chosen.share
    rows, at = chosen.rows, chosen.at
    if len(rows) == 0:
        return
    fit = _Newton(chosen.y, chosen.u, chosen.start, geometry[at], powers[at], settings)
    fit.run()
    out.normal[rows], out.brightness[rows] = fit.n, fit.c[:, 0] * chosen.rho
    out.spread[rows], weight = fit.spread()
    out.outcome[rows] = np.where(fit.c[:, 0] > 0, np.where(fit.settled, SETTLED, UNSETTLED), FAILED)
    which, place = np.nonzero(chosen.u > 0)
    out.share[rows[which], at[which, place]] = weight[which, place]


class Chosen(NamedTuple):
    """The observations that a fit looks at.

    Attributes
    ----------
    rows : int array (q,)
        Pixels that have enough of them.
    at : int array (q, k)
        The lights of these pixels' observations; those that count come first.
    y, u : float64 arrays (q, k)
        Values over the start's albedo, and weights with the greatest 1; zero where there are fewer than k.
    start : float64 array (q, 3)
        Unit normals at the start.
    rho : float64 array (q,)
        The start's albedo.
    share : float64 array (p, m)
        2 where lit, 3 where dark, NaN where not usable, of all pixels.
    """

    rows: IntArray
    at: IntArray
    y: FloatArray
    u: FloatArray
    start: FloatArray
    rho: FloatArray
    share: FloatArray


def lower_ranks(
    values: FloatArray,
    weights: FloatArray,
    start: FloatArray,
    directions: FloatArray,
    share: float,
    least: int,
    dark: float,
) -> Chosen:
    """Choose the darkest of the lit observations of some pixels; see :class:`Settings` and :func:`fit_pixels`."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        rho = np.sqrt((start * start).sum(axis=1))
        y, normals = values / rho[:, None], start / rho[:, None]
        usable = np.isfinite(y) & (weights > 0)
        lit = usable & (normals @ directions.T > dark) & (y > dark)
    told = np.where(lit, 2.0, np.where(usable, 3.0, np.nan))
    count = lit.sum(axis=1)
    rows = np.flatnonzero((rho > 0) & (rho < np.inf) & (count >= least))
    y, lit = y[rows], lit[rows]
    ordered = np.sort(np.where(lit, y, np.inf), axis=1)
    rank = np.maximum(np.ceil(share * (count[rows] - 1)).astype(np.intp), least - 1)
    with np.errstate(invalid="ignore"):
        chosen = lit & (y <= np.take_along_axis(ordered, rank[:, None], axis=1))
    # Those that count in front, so that work goes by their number.
    most = int(chosen.sum(axis=1).max(initial=0))
    at = np.argsort(~chosen, axis=1, kind="stable")[:, :most]
    taken = np.take_along_axis(chosen, at, axis=1)
    u = np.where(taken, np.take_along_axis(weights[rows], at, axis=1), 0.0)
    if len(rows):
        u /= u.max(axis=1, keepdims=True)
    return Chosen(rows, at, np.where(taken, np.take_along_axis(y, at, axis=1), 0.0), u, normals[rows], rho[rows], told)


class _Newton:
    """The state of some pixels between two rounds.

    Parameters
    ----------
    y, u : float64 arrays (p, k)
        Chosen values, and their weights with the greatest 1; zero where there are fewer than k.
    n : float64 array (p, 3)
        Normals to start from.
    geometry, powers : float64 arrays (p, k, 7), (p, k, d + 1)
        See :func:`fit_pixels`.
    settings : Settings
        Numbers of the fit.
    """

    def __init__(
        self,
        y: FloatArray,
        u: FloatArray,
        n: FloatArray,
        geometry: FloatArray,
        powers: FloatArray,
        settings: Settings,
    ) -> None:
        self.y, self.u, self.n, self.settings = y, u, n.copy(), settings
        self.geometry, self.powers = geometry, powers
        p, terms = len(y), powers.shape[2] ** 2
        self.c = np.zeros((p, terms))
        self.c[:, 0] = 1.0
        self.size = terms + 2
        self.total, self.count = u.sum(axis=1), (u > 0).sum(axis=1)
        self.damping = np.full(p, FIRST_DAMPING)
        self.scale = np.full(p, FLOOR)
        self.settled = np.zeros(p, np.bool_)

    def run(self) -> None:
        """Take rounds until all are settled or none is left."""
        for k in range(self.settings.rounds):
            rows = np.flatnonzero(~self.settled)
            if len(rows) == 0:
                return
            self._round(rows, k)

    def _model(self, rows: IntArray, n: FloatArray, c: FloatArray) -> tuple[FloatArray, ...]:
        """Return cosines, terms (p, k, t), values of the polynomial and its slopes in x."""
        geometry, powers = self.geometry[rows], self.powers[rows]
        s = (geometry[:, :, :3] @ n[:, :, None])[:, :, 0]
        x = (geometry[:, :, 3:6] @ n[:, :, None])[:, :, 0] - geometry[:, :, 6]
        degrees = np.arange(powers.shape[2])
        xs = x[..., None] ** degrees
        slopes = np.concatenate([np.zeros_like(x)[..., None], degrees[1:] * xs[..., :-1]], axis=2)
        shape = (*x.shape, self.size - 2)
        terms = (xs[..., :, None] * powers[..., None, :]).reshape(shape)
        tilt = (slopes[..., :, None] * powers[..., None, :]).reshape(shape)
        return s, terms, (terms @ c[:, :, None])[..., 0], (tilt @ c[:, :, None])[..., 0]

    def _rows(self, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return derivatives (p, k, t + 2) and residuals."""
        n, geometry = self.n[rows], self.geometry[rows]
        s, terms, value, slope = self._model(rows, n, self.c[rows])
        turn = tangents(n).transpose(0, 2, 1)
        first = (geometry[:, :, :3] @ turn) * value[..., None]
        first += (geometry[:, :, 3:6] @ turn) * (s * slope)[..., None]
        return np.concatenate([first, s[..., None] * terms], axis=2), self.y[rows] - s * value

    def _tie(self, rows: IntArray) -> FloatArray:
        tie = np.repeat(
            ((self.settings.ridge + self.settings.noise_ridge * self.scale[rows] ** 2) * self.total[rows])[:, None],
            self.size - 2,
            axis=1,
        )
        tie[:, 0] = 0.0
        return tie

    def _scale(self, r: FloatArray, rows: IntArray) -> FloatArray:
        u, count = self.u[rows], self.count[rows]
        ordered = np.sort(np.where(u > 0, np.abs(r) * np.sqrt(u), np.inf), axis=1)
        # The fit makes as many residuals small as it has unknowns.
        rank = np.minimum((count + self.size) / 2, count - 1.0).astype(np.intp)
        return np.maximum(FLOOR, np.take_along_axis(ordered, rank[:, None], axis=1)[:, 0] * DEVIATION)

    def _weights(self, r: FloatArray, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return Tukey's weights, and the squares of residuals where the loss ends at 1."""
        z2 = r * r * self.u[rows] / (TUKEY * self.scale[rows][:, None]) ** 2
        return np.where(z2 < 1, (1 - z2) ** 2, 0.0), z2

    def _round(self, rows: IntArray, k: int) -> None:
        j, r = self._rows(rows)
        if k < self.settings.hold:
            self.scale[rows] = self._scale(r, rows)
        w = self._weights(r, rows)[0] * self.u[rows]
        tie, c = self._tie(rows), self.c[rows]
        energy = (w * r * r).sum(axis=1) + (tie * c * c).sum(axis=1)
        a, b = self._matrix(j, w, tie), ((w * r)[:, None] @ j)[:, 0]
        b[:, 2:] -= tie * c
        diagonal = np.arange(self.size)
        a[:, diagonal, diagonal] *= 1 + self.damping[rows][:, None]
        a[:, diagonal, diagonal] += JITTER * self.total[rows][:, None]
        step = np.linalg.solve(a, b[..., None])[..., 0]
        length = np.hypot(step[:, 0], step[:, 1])
        cut = np.minimum(1.0, LONGEST / np.maximum(length, 1e-300))
        n = self.n[rows] + cut[:, None] * (step[:, None, :2] @ tangents(self.n[rows]))[:, 0]
        n /= np.sqrt((n * n).sum(axis=1, keepdims=True))
        c = c + step[:, 2:]
        s, _, value, _ = self._model(rows, n, c)
        d = self.y[rows] - s * value
        better = (w * d * d).sum(axis=1) + (tie * c * c).sum(axis=1) <= energy * CLOSE + NOTHING * self.total[rows]
        self.n[rows[better]], self.c[rows[better]] = n[better], c[better]
        mu = self.damping[rows]
        self.damping[rows] = np.where(better, 0.1 * mu, 10 * mu + FIRST_DAMPING)
        self.settled[rows] = better & (k + 1 >= self.settings.hold) & (length <= self.settings.tolerance)

    def _matrix(self, j: FloatArray, w: FloatArray, tie: FloatArray) -> FloatArray:
        a: FloatArray = (j * w[..., None]).transpose(0, 2, 1) @ j
        diagonal = np.arange(2, self.size)
        a[:, diagonal, diagonal] += tie
        return a

    def spread(self) -> tuple[FloatArray, FloatArray]:
        """Return the covariance along the tangents, with all coefficients unknown, and signed weights.

        Of an M-estimate: the mean square of the influence over the square of its mean slope, times the inverse of the
        undiminished normal matrix; the degrees of freedom that the ties leave are taken off.
        """
        rows = np.arange(len(self.y))
        j, r = self._rows(rows)
        weight, z2 = self._weights(r, rows)
        tie = self._tie(rows)
        a = self._matrix(j, self.u, tie)
        diagonal = np.arange(self.size)
        a[:, diagonal, diagonal] += JITTER * self.total[:, None]
        inverse = np.linalg.inv(a)
        freedom = self.count - self.size + (tie * inverse[:, diagonal[2:], diagonal[2:]]).sum(axis=1)
        inner = (weight * weight * r * r * self.u).sum(axis=1)
        slope = np.where((z2 < 1) & (self.u > 0), (1 - z2) * (1 - 5 * z2), 0.0).sum(axis=1) / self.count
        with np.errstate(invalid="ignore", divide="ignore"):
            factor = np.where((freedom > 0) & (slope > LEAST_SLOPE), inner / freedom / (slope * slope), math.nan)
        spread = np.stack([inverse[:, 0, 0], inverse[:, 0, 1], inverse[:, 1, 1]], axis=1) * factor[:, None]
        return spread, np.where(r < 0, -weight, weight)
