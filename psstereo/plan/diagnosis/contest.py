"""Which reading of the lights fits the images best: their order, and the signs of their axes.

Residuals tell an order from another where there are more lights than unknowns, and the other order is not just a turn
or a reflection of all lights. Where they cannot tell, as with three lights, the normals must still belong to a surface.
"""

from dataclasses import dataclass

import numpy as np

from psstereo.normals.low_rank_fit import LowRankFit, fit_normals, reweighted
from psstereo.plan.diagnosis.curl import curls, tiles
from psstereo.plan.diagnosis.orders import best_orders
from psstereo.plan.sample import Sample
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Contest", "Reading", "Seen", "contest"]

_MOST = 60_000
"""Observations that are fitted anew for each order."""
_SIDES = (16, 8)
_LEAST_BLOCKS = 6
"""Blocks that must have an opinion."""
_BETTER = 0.6
"""Share of the figure as given below which another reading is believed."""
_FEW_MOVED = 4
"""Lights up to which an order is a slip of single rows."""
_POOR = 0.05
"""Curl as given below which nothing is wrong with it."""
_MIDDLING = 0.25
"""Curl as given below which another reading must be better still: mirrored, a ball's middle has little."""
_MUCH_BETTER = 0.3
"""Share of the figure as given for these, and for orders that move many lights."""
_AGREE = 0.8
"""Share of blocks that must be of the same opinion."""
_ALIKE = 1.1
"""Ratio of misfits up to which residuals cannot tell."""
_DIM = 0.1
"""Albedo over that of bright pixels below which a pixel is not asked: noise, or background."""
_SIMPLE = 0.25
"""Share of the best order's gain that may be lost for an order that moves fewer lights."""
_SHADOW = 0.05
"""Share of a pixel's brightest value below which it is in shadow."""


@dataclass(frozen=True, eq=False)
class Reading:
    """How one order of the lights fits.

    Attributes
    ----------
    order : int array (m,)
        Which of the given lights belongs to each image.
    misfit : float64 array (m, b)
        Mean magnitude of the residual over albedo, by image and block; all zero with three lights.
    curl : float64 array (4, b)
        See :func:`psstereo.plan.diagnosis.curl.curls`.
    scale : float64 array (b,)
        What to divide it by.
    """

    order: IntArray
    misfit: FloatArray
    curl: FloatArray
    scale: FloatArray

    def curl_of(self, axes: int) -> float:
        """Return the relative curl for one reading of the axes; NaN without data [1]."""
        total = float(self.scale.sum())
        return float(self.curl[axes].sum()) / total if total > 0 else float("nan")


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen:
    """Normals of the pixels that were looked at.

    Attributes
    ----------
    normals : float64 array (3, n)
        Scaled normals by the lights as given.
    places : float64 array (2, n)
        x and y of these pixels [px].
    """

    normals: FloatArray
    places: FloatArray


@dataclass(frozen=True, eq=False)
class Contest:
    """Readings of the lights, and the one that is believed.

    Attributes
    ----------
    given : Reading
        The order as given.
    winner : Reading
        The order that is believed.
    seen : Seen
        Normals by the lights as given.
    axes : int
        Which of :data:`psstereo.plan.diagnosis.curl.READINGS` is believed; 0 as given.
    by : str
        ``"residual"``, ``"curl"``, or ``""`` if the lights are believed as they are.
    before, after : float
        The figure that decided, as given and for the winner [1].
    agreement : float
        Share of blocks that agree [1].
    """

    given: Reading
    winner: Reading
    seen: Seen
    axes: int = 0
    by: str = ""
    before: float = float("nan")
    after: float = float("nan")
    agreement: float = float("nan")

    @property
    def moved(self) -> tuple[int, ...]:
        """Images whose light is another one than given."""
        return tuple(int(i) for i in np.flatnonzero(self.winner.order != np.arange(len(self.winner.order))))


@dataclass(frozen=True, eq=False)
class _Field:
    """The pixels that all readings are tried on."""

    values: FloatArray
    usable: BoolArray
    lights: FloatArray
    blocks: IntArray
    grid: IntArray
    places: FloatArray


def contest(sample: Sample) -> Contest:
    """Weigh other orders and other axes against the lights as given.

    Parameters
    ----------
    sample : Sample
        The sample.

    Returns
    -------
    Contest
        What is believed; the lights as given unless another reading is clearly better in nearly all blocks.
    """
    ground = _field(sample)
    whole = ground.usable.all(axis=0)
    orders = best_orders(ground.values[:, whole], ground.lights, sample.names)
    orders.sort(key=lambda order: bool((order != np.arange(len(order))).any()))  # the given one first
    readings, fits = [], []
    for order in orders:
        reading, fit = _read(ground, order)
        readings.append(reading)
        fits.append(fit)
    given = readings[0]
    seen = Seen(normals=fits[0].normals, places=ground.places)
    best = min(readings, key=lambda r: float(r.misfit.sum()))
    by_residual = _by_residual(given, best) if len(sample.directions) > 3 else None
    if by_residual is not None:
        best = _simplest(given, best, readings)
        before, after, agreement = _by_residual(given, best) or by_residual
        return Contest(given, best, seen, 0, "residual", before, after, agreement)
    equal = [r for r in readings if r.misfit.sum() <= _ALIKE * given.misfit.sum()]
    return _by_curl(given, equal, seen)


def _field(sample: Sample) -> _Field:
    """Choose whole blocks, cut to their middle if there are many lights."""
    count = len(sample.directions)
    side = next((s for s in _SIDES if len(sample) * (s / _SIDES[0]) ** 2 * count <= _MOST), _SIDES[-1])
    grid = tiles(sample.pixels, sample.blocks, side)
    most = max(_MOST // (count * side * side), _LEAST_BLOCKS)
    if len(grid) > most:
        grid = grid[((np.arange(most) + 0.5) * len(grid) / most).astype(np.int64)]
    chosen, inverse = np.unique(grid[grid >= 0], return_inverse=True)
    renumbered = np.full(grid.shape, -1, np.int64)
    renumbered[grid >= 0] = inverse.reshape(-1)
    owner = np.broadcast_to(np.arange(len(grid))[:, None, None], grid.shape)[grid >= 0]
    blocks = np.zeros(len(chosen), np.int64)
    blocks[inverse.reshape(-1)] = owner
    with np.errstate(invalid="ignore", divide="ignore"):
        values = sample.values[:, chosen] / sample.albedo[chosen]
    usable = np.isfinite(values) & (sample.albedo[chosen] > _DIM * _bright(sample.albedo))
    rows, columns = sample.pixels[chosen].T.astype(np.float64)
    return _Field(
        values=np.where(usable, values, 0.0),
        usable=usable,
        lights=sample.directions,
        blocks=blocks,
        grid=renumbered,
        places=np.stack([columns, -rows]),
    )


def _read(ground: _Field, order: IntArray) -> tuple[Reading, LowRankFit]:
    """Fit all pixels with the lights in another order."""
    lights = ground.lights[order]
    top = ground.values.max(axis=0)
    bright = ground.values > _SHADOW * top
    weights = np.asarray(ground.usable & bright, np.float64)
    fit = fit_normals(ground.values, lights, weights)
    if len(lights) > 3:
        fit = fit_normals(ground.values, lights, reweighted(ground.values, ground.usable, fit))
    fitted = np.isfinite(fit.spread)
    if len(lights) == 3:
        fitted = fitted & bright.all(axis=0)
    count = len(ground.grid)
    misfit = np.zeros((len(lights), count))
    if len(lights) > 3:
        left = np.abs(ground.values - np.maximum(fit.model, 0.0)) * (ground.usable & fitted)
        for i, row in enumerate(left):
            misfit[i] = np.bincount(ground.blocks, row, count)
        misfit /= max(int(fitted.sum()), 1)
    side = ground.grid.shape[1]
    seen = fit.normals[2, fitted]
    toward = -1.0 if len(seen) and np.median(np.sign(seen)) < 0 else 1.0  # slopes do not change with it
    curl, scale = curls(toward * fit.normals, fitted, ground.grid, side // 4)
    if np.count_nonzero(scale) < _LEAST_BLOCKS:
        curl, scale = curls(toward * fit.normals, fitted, ground.grid, max(side // 8, 1))
    return Reading(order=order, misfit=misfit, curl=curl, scale=scale), fit


def _simplest(given: Reading, best: Reading, readings: list[Reading]) -> Reading:
    """Return, of the orders that gain about as much as the best, the one that moves fewest lights; then by the curl."""
    low, high = float(best.misfit.sum()), float(given.misfit.sum())
    enough = [r for r in readings if r.misfit.sum() <= max(low + _SIMPLE * (high - low), _ALIKE * low)]
    enough = [r for r in enough if r is best or _by_residual(given, r) is not None]

    def rank(reading: Reading) -> tuple[int, float]:
        moved = int((reading.order != given.order).sum())
        return moved, float(np.nan_to_num(reading.curl_of(0), nan=np.inf))

    return min(enough, key=rank)


def _bright(albedo: FloatArray) -> float:
    known = albedo[np.isfinite(albedo)]
    return float(np.quantile(known, 0.9)) if len(known) else float("nan")


def _by_residual(given: Reading, best: Reading) -> tuple[float, float, float] | None:
    """Return misfit before and after and the blocks' agreement, if residuals are for the other order."""
    moved = given.order != best.order
    if not moved.any():
        return None
    before, after = given.misfit[moved].sum(axis=0), best.misfit[moved].sum(axis=0)
    told = before > 0
    number = max(int(moved.sum()), 1)
    agreement = float((after < before)[told].mean()) if told.any() else 0.0
    # among many orders some suit any flaw of the images, so one that moves many lights must be far better
    limit = _BETTER if number <= _FEW_MOVED else _MUCH_BETTER
    clear = after.sum() < limit * before.sum() and best.misfit.sum() < given.misfit.sum()
    if not clear or agreement < _AGREE or told.sum() < min(_LEAST_BLOCKS, len(before)):
        return None
    return float(before.sum()) / number, float(after.sum()) / number, agreement


def _by_curl(given: Reading, equal: list[Reading], seen: Seen) -> Contest:
    """Let the blocks' curl choose among orders that residuals cannot tell apart, and among the axes."""
    before = given.curl_of(0)
    stay = Contest(given, given, seen)
    if not before >= _POOR:
        return stay
    limit = _BETTER if before >= _MIDDLING else _MUCH_BETTER
    found = []
    for reading in equal:
        for axes in range(4):
            after = reading.curl_of(axes)
            both = (given.scale > 0) & (reading.scale > 0)
            if not after < limit * before or both.sum() < _LEAST_BLOCKS or (reading is not given and axes > 0):
                continue
            own, other = given.curl[0][both] / given.scale[both], reading.curl[axes][both] / reading.scale[both]
            agreement = float((other < own).mean())
            if agreement >= _AGREE:
                found.append(Contest(given, reading, seen, axes, "curl", before, after, agreement))
    # some rigs are their own mirror image: a mirrored axis is the simpler reading of exchanged rows
    return min(found, key=lambda c: (round(c.after, 3), len(c.moved)), default=stay)
