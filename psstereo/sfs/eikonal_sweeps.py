"""Sweeps over tiles until nothing changes, on any number of threads with the same result."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial

import numpy as np

from psstereo.kernels.dispatch import kernel
from psstereo.kernels.sweeping_conic import BIG, GIVEN, OPEN, RESTLESS
from psstereo.types import Array, FloatArray, IntArray, Progress

__all__ = ["Marched", "Problem", "march"]

_TILE = 128
"""Rows and columns of a tile: small enough for the caches, large enough that handing it to a thread costs nothing."""
_ORDERS = ((True, True), (False, False), (True, False), (False, True))
_BREAK_EVEN = 400.0
"""Pixels from which compiled sweeps are sooner done."""
_REFINEMENTS = 64
_NOTABLE = 10.0
"""Changes of this many tolerances are worth a new choice of paths."""
_PIECE = 15


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """What is solved, in the arrays of :mod:`psstereo.kernels.sweeping`.

    Attributes
    ----------
    values : float64 array (h, w)
        What is given, and where a lamp's sweeps begin.
    state : uint8 array (h, w)
        Open, given or outside.
    bright : float64 array (h, w)
        Cosines, or flux over irradiance.
    frame : float64 array (11,)
        Camera and light.
    tolerance : float
        Changes up to this end the iteration [unit of the values].
    limit : int
        Sweeps at most, in each phase.
    threads : int
        Threads.
    """

    values: FloatArray
    state: Array
    bright: FloatArray
    frame: FloatArray
    tolerance: float
    limit: int
    threads: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Marched:
    """What the sweeps found.

    Attributes
    ----------
    values : float64 array (h, w)
        The solution, ``BIG`` where no path leads.
    normals : float64 array (h, w, 3)
        Unit normals, NaN where there is no value.
    sweeps : int
        Sweeps of all phases.
    change : float
        Share of the pixels that still changed when the limit was reached.
    converged : bool
        Whether nothing did.
    phase : str
        The last phase that settled: the values are its.
    """

    values: FloatArray
    normals: FloatArray
    sweeps: int
    change: float
    converged: bool
    phase: str


def _turned(function: Callable[[IntArray, bool, bool], int], down: bool, right: bool, window: IntArray) -> int:
    return function(window, down, right)


class _Tiles:
    """The tiles of an image, visited by diagonals, so that each waits for those before it and for no other."""

    def __init__(self, shape: tuple[int, int], pool: ThreadPoolExecutor | None) -> None:
        rows, columns = (list(range(0, size, _TILE)) for size in shape)
        self.size = len(rows), len(columns)
        self.windows = {
            (a, b): np.array([i, min(shape[0], i + _TILE), j, min(shape[1], j + _TILE)])
            for a, i in enumerate(rows)
            for b, j in enumerate(columns)
        }
        self.pool = pool

    def each(self, function: Callable[[IntArray], int | None], keys: list[tuple[int, int]]) -> list[int]:
        """Call a function with the windows of some tiles that do not depend on each other."""
        windows = [self.windows[key] for key in keys]
        if self.pool is None or len(keys) == 1:
            return [function(window) or 0 for window in windows]
        return [found or 0 for found in self.pool.map(function, windows)]

    def all(self, function: Callable[[IntArray], int | None]) -> None:
        """Call a function with every window."""
        self.each(function, list(self.windows))

    def sweep(self, function: Callable[[IntArray, bool, bool], int], limit: int) -> tuple[int, bool]:
        """Sweep until no tile changes; return the number of sweeps, and whether that was reached.

        It is given up when the function says that a pixel does not settle.
        """
        down_size, right_size = self.size
        waiting = set(self.windows)
        for done in range(limit):
            down, right = _ORDERS[done % 4]
            for diagonal in range(down_size + right_size - 1):
                keys = [
                    (a if down else down_size - 1 - a, b if right else right_size - 1 - b)
                    for a in range(max(0, diagonal - right_size + 1), min(down_size, diagonal + 1))
                    for b in (diagonal - a,)
                ]
                keys = [key for key in keys if key in waiting]
                if not keys:
                    continue
                found = self.each(partial(_turned, function, down, right), keys)
                if any(bits & RESTLESS for bits in found):
                    return done + 1, False
                waiting.difference_update(keys)
                for (a, b), bits in zip(keys, found, strict=True):
                    near = ((1, a, b), (2, a - 1, b), (4, a + 1, b), (8, a, b - 1), (16, a, b + 1))
                    waiting.update((i, j) for bit, i, j in near if bits & bit and (i, j) in self.windows)
            if not waiting:
                return done + 1, True
        return limit, False


class _March:
    """The phases of one solution and the arrays that they share."""

    def __init__(self, problem: Problem, tiles: _Tiles) -> None:
        height, width = problem.state.shape
        self.problem, self.tiles, self.sweeps, self.converged = problem, tiles, 0, True
        self.u = np.full((height + 4, width + 4), BIG)
        lamp = problem.frame[10] > 0
        known = problem.state == GIVEN
        inner = self.u[2:-2, 2:-2]
        np.copyto(inner, problem.values, where=(problem.state == OPEN) | known if lamp else known)
        self.active = np.zeros((height + 4, width + 4), np.uint8)
        if lamp:
            self.active[...] = 1
        else:
            self._wake(known, (1,))
        self.code = np.zeros((height, width), np.uint8)

    def _wake(self, where: Array, reaches: tuple[int, ...]) -> None:
        """Mark the neighbours of some pixels."""
        rows, columns = np.nonzero(where)
        for reach in reaches:
            for di, dj in ((-reach, 0), (reach, 0), (0, -reach), (0, reach)):
                self.active[rows + 2 + di, columns + 2 + dj] = 1

    def _kernel(self, function: str) -> Callable[..., int]:
        return kernel("sweeping", function, float(self.problem.state.size), _BREAK_EVEN)

    def first(self) -> None:
        """Solve by the monotone scheme, and find from where each pixel has its value."""
        one, run = self.problem, self._kernel("first_order")
        self.sweeps, self.converged = self.tiles.sweep(
            lambda window, down, right: run(
                self.u, one.state, self.active, self.code, one.bright, one.frame, window, down, right, one.tolerance
            ),
            one.limit,
        )

    def locate(self) -> None:
        """Find from where each pixel would have its value by the monotone scheme."""
        one, run = self.problem, self._kernel("pieces")
        self.tiles.all(lambda window: run(self.u, one.state, one.bright, one.frame, window, self.code))

    def second(self) -> bool:
        """Solve with wide differences along the paths that are known; return whether that settled."""
        one, run, wide = self.problem, self._kernel("second_order"), self._kernel("widen")
        tired = np.zeros(one.state.shape, np.uint8)
        old = self.code.copy()
        self.tiles.all(lambda window: wide(self.u, one.state, one.frame, window, self.code))
        self.active[2:-2, 2:-2] |= self.code != old
        count, settled = self.tiles.sweep(
            lambda window, down, right: run(
                self.u, self.active, self.code, tired, one.bright, one.frame, window, down, right, one.tolerance
            ),
            one.limit,
        )
        self.sweeps += count
        return settled

    def refine(self) -> bool:
        """Choose the paths again with the better values, where the choice changes, and solve along them."""
        one, run = self.problem, self._kernel("refine")
        before, old = self.u.copy(), self.code.copy()
        self.locate()
        self.active[...] = 0
        self.active[2:-2, 2:-2] = (self.code ^ old) & _PIECE != 0
        self.code[...] = old
        count, _ = self.tiles.sweep(
            lambda window, down, right: run(
                self.u, one.state, self.active, self.code, one.bright, one.frame, window, down, right,
                _NOTABLE * one.tolerance,
            ),
            _REFINEMENTS,
        )  # fmt: skip
        self.sweeps += count
        self.locate()
        self.active[...] = 0
        self.active[2:-2, 2:-2] = (self.code ^ old) & _PIECE != 0
        self._wake((np.abs(self.u - before) > one.tolerance)[2:-2, 2:-2], (1, 2))
        return self.second()

    def attempt(self, phase: Callable[[], bool]) -> bool:
        """Try a phase; leave everything as it was, and say so, if it does not settle."""
        kept = self.u.copy(), self.code.copy(), self.active.copy()
        if phase():
            return True
        self.u, self.code, self.active = kept
        return False

    def normals(self) -> FloatArray:
        """Return the unit normals."""
        run, out = self._kernel("normals"), np.zeros((*self.problem.state.shape, 3))
        self.tiles.all(lambda window: run(self.u, self.code, self.problem.frame, window, out))
        return out


def march(problem: Problem, order: int, progress: Progress) -> Marched:
    """Solve by sweeps.

    Parameters
    ----------
    problem : Problem
        What is solved.
    order : int
        1 or 2.
    progress : callback
        Told the phases.

    Returns
    -------
    Marched
        The solution.
    """
    threaded = problem.threads > 1 and max(problem.state.shape) > _TILE
    with ThreadPoolExecutor(problem.threads) if threaded else nullcontext() as pool:
        run = _March(problem, _Tiles(problem.state.shape, pool))
        run.first()
        reached = 1
        progress("sweeps", 1, 2 * order)
        if order == 2:
            run.active[2:-2, 2:-2] = run.code != 0
            reached += run.attempt(run.second)
            progress("sweeps", 2, 4)
            reached += reached == 2 and run.attempt(run.refine)
            progress("sweeps", 3, 4)
            run.converged &= reached == 3
        normals = run.normals()
        progress("sweeps", 2 * order, 2 * order)
    return Marched(
        values=run.u[2:-2, 2:-2],
        normals=normals,
        sweeps=run.sweeps,
        change=float(np.mean(run.active[2:-2, 2:-2])) if not run.converged else 0.0,
        converged=run.converged,
        phase=("monotone", "second order", "second order, paths chosen again")[reached - 1],
    )
