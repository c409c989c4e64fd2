"""Where rays first meet a surface z = f(x, y)."""

from dataclasses import dataclass

import numpy as np

from psstereo.types import BoolArray, FloatArray, IntArray
from psstereo_synth.shapes.finite import FiniteRelief

__all__ = ["first_hits"]

_EPS = float(np.finfo(np.float64).eps)
_ROUNDS = 200
"""Steps of the search for a root; bisection alone ends in about 60."""
_HALVINGS = 50
"""Steps of the search for the edge of a surface, or the lowest point of a dip, between two samples."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Rays:
    """Rays origin + t · direction over a surface, (p, 3) each."""

    relief: FiniteRelief
    origins: FloatArray
    directions: FloatArray

    def of(self, which: BoolArray | IntArray) -> "_Rays":
        return _Rays(relief=self.relief, origins=self.origins[which], directions=self.directions[which])

    def gap(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return height over the surface, its change with t, and the surface's slope, NaN beside the surface."""
        at = self.origins + t[:, None] * self.directions
        e = self.relief.evaluate(at[:, 0], at[:, 1])
        dx, dy, dz = self.directions.T
        return at[:, 2] - e.height, dz - e.slope_x * dx - e.slope_y * dy, np.hypot(e.slope_x, e.slope_y)

    def size(self, t: FloatArray) -> FloatArray:
        """Return the size of the numbers of which points at t are made, for tolerances [length]."""
        size = np.abs(self.origins).max(axis=1) + np.abs(t) * np.abs(self.directions).max(axis=1)
        return np.asarray(size)


def first_hits(
    relief: FiniteRelief, origins: FloatArray, directions: FloatArray, nearest: FloatArray, *, samples: int
) -> FloatArray:
    """Return where rays from above first meet a surface.

    A ray is followed through the box of the surface's extent and bounds in equal steps, whose ground length is at most
    the longer side over `samples`. In the first step in which it ends below the surface, or leaves it below its edge,
    or dips below it and rises again, the crossing is found by Newton's method inside a bracket that shrinks at least
    like bisection's. What is thinner than a step along the ray and has more than one dip in it can be missed.

    Parameters
    ----------
    relief : FiniteRelief
        The surface.
    origins, directions : float64 array (p, 3)
        Rays; directions of any length [length].
    nearest : float64 array (p,)
        Parameters at which rays begin, −∞ for lines [1].
    samples : int
        Least number of steps along the longer side of the surface.

    Returns
    -------
    float64 array (p,)
        Parameters of the points; NaN where the ray misses the surface, comes to it from below, or meets a wall: an edge
        of the outline or a jump of the heights [1].
    """
    rays = _Rays(relief=relief, origins=origins, directions=directions)
    enter, leave = _through_box(rays)
    enter = np.maximum(enter, nearest)
    hits = np.full(len(origins), np.nan)
    crossing = np.flatnonzero(enter <= leave)
    above, below = _march(rays.of(crossing), enter[crossing], leave[crossing], samples)
    found = np.isfinite(below)
    crossing = crossing[found]
    hits[crossing] = _root(rays.of(crossing), above[found], below[found])
    return hits


def _through_box(rays: _Rays) -> tuple[FloatArray, FloatArray]:
    """Return the parameters between which rays are in the box of extent and bounds; the first is larger if never."""
    low, high = rays.relief.bounds
    half = np.array(rays.relief.extent)
    # Rays must begin above and end below even a level surface, whose bounds are one.
    pad = 1e-3 * max(high - low, *half)
    lower, upper = np.array([*-half, low - pad]), np.array([*half, high + pad])
    o, d = rays.origins, rays.directions
    across = d == 0.0
    divisor = np.where(across, 1.0, d)
    first, second = (lower - o) / divisor, (upper - o) / divisor
    inside = (lower <= o) & (o <= upper)
    enter = np.where(across, np.where(inside, -np.inf, np.inf), np.minimum(first, second))
    leave = np.where(across, np.where(inside, np.inf, -np.inf), np.maximum(first, second))
    return enter.max(axis=1), leave.min(axis=1)


def _march(rays: _Rays, enter: FloatArray, leave: FloatArray, samples: int) -> tuple[FloatArray, FloatArray]:
    """Return, for each ray, a parameter above or beside the surface and the next one below it; NaN if there is none."""
    count = len(enter)
    above, below = np.full((2, count), np.nan)
    ground = np.hypot(rays.directions[:, 0], rays.directions[:, 1]) * (leave - enter)
    steps = np.maximum(np.ceil(ground * samples / (2 * max(rays.relief.extent))), 1.0)
    active = np.arange(count)
    t = enter.copy()
    gap, rate, _ = rays.gap(t)
    number = 0
    while active.size:
        number += 1
        # Those that have met it are done, and so are those that begin below: they come through the open side.
        on = ~(gap <= 0.0) & (number <= steps[active])
        active, t, gap, rate = active[on], t[on], gap[on], rate[on]
        share = number / steps[active]
        t_next = np.where(share < 1.0, enter[active] + (leave - enter)[active] * share, leave[active])
        those = rays.of(active)
        gap_next, rate_next, _ = those.gap(t_next)
        start, end = _crossing(those, np.stack([t, gap, rate]), np.stack([t_next, gap_next, rate_next]))
        met = np.isfinite(end)
        above[active[met]], below[active[met]] = start[met], end[met]
        t, gap, rate = t_next, np.where(np.isnan(start) | met, -1.0, gap_next), rate_next
    return above, below


def _crossing(rays: _Rays, first: FloatArray, second: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where rays are above the surface and then below it within a step.

    The step is between two samples (3, p) of t, gap and rate, which are changed. Both results are finite where rays
    cross the surface; the second is NaN where they do not, and both are where they come out of nowhere below it.
    """
    # A surface that ends within the step is judged up to its edge, however steep it is there.
    entering, leaving = np.isnan(first[1]) & ~np.isnan(second[1]), ~np.isnan(first[1]) & np.isnan(second[1])
    first[:, entering] = _edge(rays.of(entering), second[0, entering], first[0, entering])
    second[:, leaving] = _edge(rays.of(leaving), first[0, leaving], second[0, leaving])
    (t, gap, rate), (t_next, gap_next, rate_next) = first, second
    end = np.where(gap_next <= 0.0, t_next, np.nan)
    dips = np.flatnonzero((gap > 0.0) & (gap_next > 0.0) & (rate < 0.0) & (rate_next > 0.0))
    end[dips] = _dip(rays.of(dips), t[dips], t_next[dips])
    lost = gap <= 0.0
    return np.where(lost, np.nan, t), np.where(lost, np.nan, end)


def _edge(rays: _Rays, known: FloatArray, unknown: FloatArray) -> FloatArray:
    """Return the last sample of the surface toward places where there is none: t, gap and rate, (3, p)."""
    for _ in range(_HALVINGS if len(known) else 0):
        middle = 0.5 * (known + unknown)
        there = np.isfinite(rays.gap(middle)[0])
        known, unknown = np.where(there, middle, known), np.where(there, unknown, middle)
    gap, rate, _ = rays.gap(known)
    return np.stack([known, gap, rate])


def _dip(rays: _Rays, left: FloatArray, right: FloatArray) -> FloatArray:
    """Return where rays that come closer to the surface and leave again are below it, NaN where they stay above."""
    found = np.full(len(left), np.nan)
    for _ in range(_HALVINGS if len(left) else 0):
        middle = 0.5 * (left + right)
        gap, rate, _ = rays.gap(middle)
        found = np.where(np.isnan(found) & (gap <= 0.0), middle, found)
        falling = rate < 0.0
        left, right = np.where(falling, middle, left), np.where(falling, right, middle)
    return found


def _root(rays: _Rays, above: FloatArray, below: FloatArray) -> FloatArray:
    """Return the crossings from above to below inside brackets, NaN where there is a wall instead of a surface."""
    roots = np.full(len(above), np.nan)
    active = np.arange(len(above))
    t = 0.5 * (above + below)
    last = np.abs(below - above)
    for _ in range(_ROUNDS):
        if not active.size:
            break
        here = rays.of(active)
        gap, rate, _ = here.gap(t)
        low = gap <= 0.0
        below[active], above[active] = np.where(low, t, below[active]), np.where(low, above[active], t)
        start, end = above[active], below[active]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            newton = t - gap / rate
        # Outside the bracket, or shrinking more slowly than bisection would: bisect.
        good = (newton >= start) & (newton <= end) & (np.abs(newton - t) <= 0.5 * last)
        after = np.where(good, newton, 0.5 * (start + end))
        last = np.abs(after - t)
        longest = np.abs(here.directions).max(axis=1)
        done = (last * longest <= _EPS * here.size(t)) | (gap == 0.0)
        roots[active[done]] = np.where(gap == 0.0, t, after)[done]
        active, t, last = active[~done], after[~done], last[~done]
    roots[active] = t
    gap, rate, slope = rays.gap(roots)
    on_surface = np.abs(gap) <= 64 * _EPS * (rays.size(roots) + max(map(abs, rays.relief.bounds))) * (1.0 + slope)
    return np.where(on_surface & (rate < 0.0), roots, np.nan)
