"""Lambert's law with an unknown level at every pixel: ``I_i = a + max(0, l_i · b)``.

The level a is what the pixel shows without any of the lights. An observation of a light that reaches the pixel has the
row (l_i, 1); one in shadow shows the level alone and has the row (0, 1). Eliminating the level leaves three unknowns,
whose normal matrix is that of the rows with their weighted mean taken off (a Schur complement), so that everything
built for three unknowns serves here too, error bars included.

With the centred light matrix L − 1 μᵀ = Q R the unknowns are x = R b and the level at the mean light, t = a + μ · b. A
lit observation has the row (q_i, 1), one in shadow (s, 1) with s = −R⁻ᵀ μ.

Which observations are in shadow is not known. Two guesses are tried, that all are lit and that the darkest show the
level; from the better one the fit and the choice alternate as long as the residual falls, so that it ends. A choice
that does not contradict itself, by calling lit what its fit puts behind the surface, comes before one that does.
"""

from dataclasses import dataclass, replace

import numpy as np

from psstereo.kernels.robust_losses import weight
from psstereo.kernels.robust_settings import MAD
from psstereo.lights import Rig
from psstereo.normals.moments import Factor, cholesky, solve_cholesky
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["LevelFit", "LevelFactor", "fit_all_lit", "fit_level", "reweighted"]

_DARK = 0.05
"""Share of a pixel's range of brightness within which, as a guess, an observation is in shadow."""
_TINY = 1e-9
"""The same for clean data, where dim is not dark."""
_EXACT = 1e-6
"""Residual, as a share of the range, below which nothing else is tried."""
_CLEARLY = 0.5
"""Share of the squared residual of the guess that all are lit, below which another guess is believed."""
_CHANCE = 0.003
"""The same for few lights: chance at which noise alone would make the other guess look that much better."""
_NOISE = 3.0
"""Standard deviations of the noise that an observation must lack to count as cast shadow; more with few lights, since
the noise is badly known."""
_POOR = 0.01
"""Residual, as a share of the range of brightness, that no rounding to eight bits explains."""
_BEHIND = 0.02
"""Cosine beyond grazing, over the brightest one, from which a light is clearly behind the surface."""
_ROUNDS = 30
_CORRECTIONS = 2
"""Solutions from the residual of the last: eliminating the level squares the condition, and this takes that back."""
_FREE = 10
"""Rounds of reweighting in which scale and shadows follow the fit; they stay then, so that it can settle."""
_SETTLED = 1e-4
"""Change of a fit over its size at which reweighting ends: a hundredth of a degree at most."""
_FALLS = 1.0 - 1e-9
"""A residual has to fall below this share of the last one."""


@dataclass(frozen=True, eq=False)
class LevelFactor:
    """The factorisation of a centred light matrix.

    Attributes
    ----------
    q : float64 array (m, 3)
        Orthonormal columns Q.
    r_inverse : float64 array (3, 3)
        R⁻¹.
    shadow : float64 array (3,)
        Row s of an observation in shadow.
    direct : float64 array (m, 3)
        L R⁻¹, which gives what each light adds to the level where it reaches the pixel.
    moments : float64 array (6, m)
        Products 11, 12, 22, 13, 23, 33 of each row of Q.
    shadow_moments : float64 array (6,)
        The same of s.
    """

    q: FloatArray
    r_inverse: FloatArray
    shadow: FloatArray
    direct: FloatArray
    moments: FloatArray
    shadow_moments: FloatArray

    @classmethod
    def from_rig(cls, rig: Rig) -> "LevelFactor":
        """Factor a rig of distant lights that do not lie on one circle."""
        directions = rig.directions
        mean = directions.mean(axis=0)
        q, r = np.linalg.qr(directions - mean)
        r_inverse = np.linalg.solve(r, np.eye(3))
        shadow = -(mean @ r_inverse)
        # Columns of Q sum to zero but for rounding; the level is eliminated from these rows as they are.
        return cls(q, r_inverse, shadow, directions @ r_inverse, _products(q.T), _products(shadow))


@dataclass(frozen=True, eq=False)
class LevelFit:
    """A fit of some pixels.

    Attributes
    ----------
    lit : bool array (m, p)
        Observations that count as reached by their light.
    weights : float64 array (m, p)
        Weights, zero where not usable.
    x : float64 array (3, p)
        The unknowns, NaN where singular.
    mean_level : float64 array (p,)
        The level at the mean light, t.
    level : float64 array (p,)
        The level a.
    residual : float64 array (m, p)
        Observed less fitted.
    squares : float64 array (p,)
        Weighted sum of squares of the residual; infinite where singular.
    factor : Factor
        Cholesky factors of the normal matrices of x, the level eliminated.
    """

    lit: BoolArray
    weights: FloatArray
    x: FloatArray
    mean_level: FloatArray
    level: FloatArray
    residual: FloatArray
    squares: FloatArray
    factor: Factor

    def take(self, pixels: IntArray) -> "LevelFit":
        """Return the fit of some of the pixels."""
        values = {name: value[..., pixels] for name, value in vars(self).items() if name != "factor"}
        first, second, third, fourth, fifth, sixth = (entry[pixels] for entry in self.factor)
        return LevelFit(**values, factor=(first, second, third, fourth, fifth, sixth))

    def put(self, pixels: IntArray, other: "LevelFit", which: BoolArray) -> None:
        """Replace some pixels by those of another fit of `pixels`, where `which` says so."""
        where = pixels[which]
        for name, value in vars(self).items():
            if name != "factor":
                value[..., where] = getattr(other, name)[..., which]
        for mine, theirs in zip(self.factor, other.factor, strict=True):
            mine[where] = theirs[which]


def fit_all_lit(rig: LevelFactor, values: FloatArray, weights: FloatArray) -> LevelFit:
    """Fit with every observation taken as lit, which is linear.

    Parameters
    ----------
    rig : LevelFactor
        The lights.
    values : float64 array (m, p)
        Brightness, finite everywhere.
    weights : float64 array (m, p)
        Weights, zero where an observation is not usable.

    Returns
    -------
    LevelFit
        The fit.
    """
    return _fit(rig, values, weights, np.ones(values.shape, np.bool_), corrections=_CORRECTIONS)


def fit_level(rig: LevelFactor, values: FloatArray, weights: FloatArray) -> tuple[LevelFit, BoolArray]:
    """Fit normals, levels and the choice of observations in shadow; parameters as in :func:`fit_all_lit`.

    Returns
    -------
    fit : LevelFit
        The fit.
    settled : bool array (p,)
        Whether the alternation ended by itself.
    """
    everything = np.arange(values.shape[1])
    best = fit_all_lit(rig, values, weights)
    circle = np.flatnonzero(~np.isfinite(best.squares))
    _improve(rig, values, best, everything)
    low, span = _range(values, weights)
    guess = (weights > 0) & (values > low + _DARK * span)
    widest = (weights > 0) & (values > low + _TINY * span)
    exact = weights.sum(axis=0) * (_EXACT * span) ** 2
    for lit in (guess, widest):
        inexact = np.flatnonzero((best.squares > exact) & ((lit is guess) | (guess != widest).any(axis=0)))
        if len(inexact):
            _try(rig, values, best, inexact, lit[:, inexact])
    lost = np.flatnonzero(_unexplained(best, span, widest))
    if len(lost):
        best.put(lost, _fit(rig, values[:, lost], weights[:, lost], widest[:, lost]), np.ones(len(lost), np.bool_))
    active = everything
    for _ in range(_ROUNDS):
        active = active[_improve(rig, values, best, active)]
        if len(active) == 0:
            break
    poor = ~np.isfinite(best.squares)
    best = _fit(rig, values, weights, best.lit, corrections=_CORRECTIONS)
    best.squares[poor] = np.inf
    # Lights on one circle tell a level only by a clear shadow: else it could as well be the darkest value.
    best.squares[circle[~_behind(rig, best.take(circle), lit=False)]] = np.inf
    settled = np.ones(values.shape[1], np.bool_)
    settled[active] = False
    return best, settled


def reweighted(
    rig: LevelFactor, values: FloatArray, start: LevelFit, loss: int, tuning: float, *, rounds: int, gate: bool
) -> tuple[LevelFit, FloatArray, BoolArray]:
    """Improve a fit by iteratively reweighted least squares.

    Parameters
    ----------
    rig : LevelFactor
        The lights.
    values : float64 array (m, p)
        Brightness, finite everywhere.
    start : LevelFit
        Where to start.
    loss : int
        Number of the loss in :data:`psstereo.kernels.robust_settings.LOSSES`.
    tuning : float
        Its tuning constant, in scales [1].
    rounds : int
        Most rounds.
    gate : bool
        Whether the choice of observations in shadow follows the fit.

    Returns
    -------
    fit : LevelFit
        The fit; its weights hold those of the loss.
    residual : float64 array (m, p)
        Residuals over the scale of the noise, which the median of their absolute values tells [1].
    settled : bool array (p,)
        Whether the fit settled.
    """
    fit = start.take(np.arange(values.shape[1]))
    relative = np.zeros(values.shape)
    floor = 1e-9 * np.abs(values).max(axis=0, initial=0.0) + np.finfo(np.float64).tiny
    root = np.sqrt(start.weights / np.maximum(start.weights.max(axis=0), np.finfo(np.float64).tiny))
    scale = floor.copy()
    active = np.arange(values.shape[1])
    for number in range(rounds):
        now, given, at = fit.take(active), start.weights[:, active], root[:, active]
        lit = now.lit
        if number < _FREE:
            scale[active] = np.maximum(_noise(at * now.residual, given), floor[active])
            lit = _reached(rig, values[:, active], replace(now, weights=given)) if gate else lit
        t = at * now.residual / (tuning * scale[active])
        following = _fit(rig, values[:, active], given * weight(loss, t), lit)
        moved = np.sqrt(((following.x - now.x) ** 2).sum(axis=0))
        size = np.sqrt((following.x * following.x).sum(axis=0))
        fit.put(active, following, np.ones(len(active), np.bool_))
        relative[:, active] = at * following.residual / scale[active]
        if number >= _FREE:
            active = active[moved > _SETTLED * size]
        if len(active) == 0:
            break
    settled = np.ones(values.shape[1], np.bool_)
    settled[active] = False
    return _fit(rig, values, fit.weights, fit.lit, corrections=_CORRECTIONS), relative, settled


def _improve(rig: LevelFactor, values: FloatArray, fit: LevelFit, pixels: IntArray) -> BoolArray:
    """Choose anew what is lit at some pixels, keep what makes the residual smaller, and say where it did."""
    part = fit.take(pixels)
    lit = _reached(rig, values[:, pixels], part)
    changed = ((lit != part.lit) & (part.weights > 0)).any(axis=0)
    better = np.zeros(len(pixels), np.bool_)
    if changed.any():
        some = pixels[changed]
        again = _fit(rig, values[:, some], fit.weights[:, some], lit[:, changed])
        falls = again.squares < _FALLS * part.squares[changed]
        torn = _behind(rig, again, lit=True).astype(np.int8) - _behind(
            rig, part.take(np.flatnonzero(changed)), lit=True
        )
        falls = np.isfinite(again.squares) & ((torn < 0) | (torn == 0) & falls)
        fit.put(some, again, falls)
        better[changed] = falls
    return better


def _try(rig: LevelFactor, values: FloatArray, best: LevelFit, pixels: IntArray, lit: BoolArray) -> None:
    """Start from another choice of lit observations, and take it where it explains the values much better."""
    part = _fit(rig, values[:, pixels], best.weights[:, pixels], lit)
    _improve(rig, values[:, pixels], part, np.arange(len(pixels)))
    free = np.maximum((part.weights > 0).sum(axis=0) - 4.0, 0.5)
    share = np.minimum(_CLEARLY, _CHANCE ** (2.0 / free))
    # A fit that calls lights lit that it puts behind the surface contradicts itself, and has no such credit.
    share[_behind(rig, best.take(pixels), lit=True)] = 1.0
    share[_behind(rig, part, lit=True)] = _CLEARLY
    best.put(pixels, part, part.squares < share * best.squares[pixels])


def _range(values: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return each pixel's lowest usable value and its range; zeros where there is none."""
    usable = weights > 0
    some = usable.any(axis=0)
    low = np.where(some, np.where(usable, values, np.inf).min(axis=0), 0.0)
    high = np.where(some, np.where(usable, values, -np.inf).max(axis=0), 0.0)
    return low, high - low


def _behind(rig: LevelFactor, fit: LevelFit, *, lit: bool) -> BoolArray:
    """Return where a fit puts a light clearly behind the surface that it calls lit, or one that it calls shadowed."""
    direct = rig.direct @ fit.x
    usable = fit.weights > 0
    with np.errstate(invalid="ignore"):
        far = direct < -_BEHIND * np.where(usable, direct, -np.inf).max(axis=0)
    return np.asarray((far & usable & (fit.lit == lit)).any(axis=0))


def _unexplained(fit: LevelFit, span: FloatArray, above: BoolArray) -> BoolArray:
    """Return where two lights at most stand out, and the fit that calls others lit too is poor: two are too few."""
    poor = fit.squares > fit.weights.sum(axis=0) * (_POOR * span) ** 2
    return np.asarray(poor & (above.sum(axis=0) < 3))


def _reached(rig: LevelFactor, values: FloatArray, fit: LevelFit) -> BoolArray:
    """Return which lights reach the pixels: in front of the surface, and no cast shadow."""
    direct = rig.direct @ fit.x
    usable = fit.weights > 0
    with np.errstate(invalid="ignore"):
        lit = direct > 0
        lack = fit.level + direct - values
        torn = lit & usable & (lack > 0.5 * direct)
        some = np.flatnonzero(torn.any(axis=0))
        if len(some):
            noise = _noise(fit.residual[:, some], fit.weights[:, some])
            free = np.maximum(usable[:, some].sum(axis=0) - 4.0, 0.5)
            lit[:, some] &= ~(torn[:, some] & (lack[:, some] > _NOISE * (1.0 + 4.0 / free) * noise))
    return np.asarray(lit)


def _noise(residual: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the standard deviation of the residuals by their median, zero where four explain everything."""
    usable = weights > 0
    count = usable.sum(axis=0)
    size = np.sort(np.where(usable, np.abs(residual), np.inf), axis=0)
    middle = np.take_along_axis(size, np.maximum((count - 1) // 2, 0)[None], axis=0)[0]
    free = np.sqrt(count / np.maximum(count - 4.0, 1.0))
    return np.asarray(np.where(count > 4, MAD * middle * free, 0.0))


@dataclass(frozen=True, eq=False)
class _System:
    """The normal equations of some pixels for a choice of lit observations, the level eliminated."""

    rig: LevelFactor
    weights: FloatArray
    lit: BoolArray
    bright: FloatArray
    centre: FloatArray
    total: FloatArray
    factor: Factor
    singular: BoolArray

    @classmethod
    def build(cls, rig: LevelFactor, weights: FloatArray, lit: BoolArray) -> "_System":
        bright = weights * lit
        total = weights.sum(axis=0)
        shaded = total - bright.sum(axis=0)
        centre = (rig.q.T @ bright + rig.shadow[:, None] * shaded) / total
        a = rig.moments @ bright + rig.shadow_moments[:, None] * shaded - _products(centre) * total
        return cls(rig, weights, lit, bright, centre, total, *cholesky(a))

    def solve(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return x (3, p) and the level at the mean light (p,) for some values."""
        weighted = self.weights * values
        whole = weighted.sum(axis=0)
        shaded = np.where(self.lit, 0.0, weighted).sum(axis=0)
        rhs = self.rig.q.T @ (self.bright * values) + self.rig.shadow[:, None] * shaded - self.centre * whole
        x = solve_cholesky(self.factor, rhs)
        return x, np.asarray(whole / self.total - (self.centre * x).sum(axis=0))


def _fit(
    rig: LevelFactor, values: FloatArray, weights: FloatArray, lit: BoolArray, *, corrections: int = 0
) -> LevelFit:
    """Fit with a given choice of lit observations."""
    with np.errstate(invalid="ignore", divide="ignore"):
        system = _System.build(rig, weights, lit)
        x, t = system.solve(values)
        residual = values - np.where(lit, rig.q @ x, rig.shadow @ x) - t
        for _ in range(corrections):
            more, level = system.solve(residual)
            x, t = x + more, t + level
            residual = values - np.where(lit, rig.q @ x, rig.shadow @ x) - t
        squares = (weights * residual * residual).sum(axis=0)
    squares[system.singular | ~np.isfinite(squares)] = np.inf
    return LevelFit(lit, weights, x, t, t + rig.shadow @ x, residual, squares, system.factor)


def _products(rows: FloatArray) -> FloatArray:
    """Return the products 11, 12, 22, 13, 23, 33 of three rows."""
    a, b, c = rows
    return np.stack([a * a, a * b, b * b, a * c, b * c, c * c])
