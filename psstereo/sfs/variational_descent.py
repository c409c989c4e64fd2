"""Gauss–Newton steps on the heights of one resolution, solved by conjugate gradients on the grid's multigrid."""

import math
from dataclasses import dataclass, field

import numpy as np

from psstereo.depth.grid import GridCycle
from psstereo.depth.rows import Rows
from psstereo.kernels.dispatch import kernel
from psstereo.sfs.variational_grid import Grid
from psstereo.types import FloatArray

__all__ = ["Descent", "Found", "Stage"]

_BREAK_EVEN = 100_000
"""Pixels times passes from which the compiled loops pay."""
_PASSES = 1000
"""Passes over a grid that a run needs, roughly."""
_FORCING = 0.1
"""Relative residual at which the linear solve of a step stops: more would be lost on the curvature of the energy."""
_LONGEST = 40
"""Iterations of a linear solve at most; what they leave, the next step takes on."""
_FINE = 1e-3
"""Misfit of the brightness that counts as none when the energy's decrease is judged: half a grey level of 8 bits
[1]."""
_ISOTROPIC = 0.1
"""Share of the brightness' stiffness that the preconditioner spreads over all directions: the brightness itself resists
in one only, and a Laplacian cannot turn."""
_SHORTEST = 1e-3
"""Share of a step below which the search along it gives up."""
_DAMPING = 1e-6
"""Weight that holds every height in place during one step, beside a brightness of weight 1; free constants
need it."""


@dataclass(frozen=True, kw_only=True)
class Stage:
    """Weights of one descent.

    Attributes
    ----------
    bending, kappa, area : float
        λ, κ, α of :mod:`psstereo.kernels.shading_step`.
    steps : int
        Steps at most.
    tolerance : float
        Relative decrease of the energy at which it ends [1].
    """

    bending: float
    kappa: float
    area: float
    steps: int
    tolerance: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Found:
    """Where a descent ended.

    Attributes
    ----------
    values : float64 array (h, w)
        Heights [px].
    energies : tuple of float
        Energy at the start and after each step.
    misfit : float
        The brightness' part of the last energy.
    converged : bool
        Whether the last step's decrease met the tolerance.
    products : int
        Iterations of conjugate gradients.
    """

    values: FloatArray
    energies: tuple[float, ...]
    misfit: float
    converged: bool
    products: int


@dataclass(eq=False)
class _Terms:
    """Room for one linearisation."""

    shape: tuple[int, int]
    pull: FloatArray = field(init=False)
    along: FloatArray = field(init=False)
    down: FloatArray = field(init=False)
    stiff: FloatArray = field(init=False)
    tension: FloatArray = field(init=False)
    sums: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self.pull, self.sums = np.zeros((2, *self.shape)), np.zeros((self.shape[0], 3))
        self.along, self.down, self.stiff, self.tension = (np.zeros(self.shape, np.float32) for _ in range(4))


class Descent:
    """Descends on one grid.

    Parameters
    ----------
    grid : Grid
        The problem.
    rows : Rows
        How passes are run.
    """

    def __init__(self, grid: Grid, rows: Rows) -> None:
        self._grid, self._rows, self._shape = grid, rows, grid.inside.shape
        work = float(grid.inside.size * _PASSES)
        self._compiled = work >= _BREAK_EVEN
        names = ("linearise", "gradient", "multiply")
        self._step = {name: kernel("shading_step", name, work, _BREAK_EVEN) for name in names}
        self._advance = kernel("multigrid_krylov", "advance", work, _BREAK_EVEN)
        self._turn = kernel("multigrid_krylov", "turn", work, _BREAK_EVEN)
        self._free = np.zeros((self._shape[0] + 3, self._shape[1] + 3), np.float32)
        self._free[1:-2, 1:-2] = grid.free
        self._lines = np.zeros(self._shape[0])

    def run(self, start: FloatArray, stage: Stage) -> Found:
        """Descend from a start until the energy hardly falls any more."""
        values, now, other = start, _Terms(self._shape), _Terms(self._shape)
        energy = self._energy(values, stage, now)
        energies, products, converged = [energy], 0, not energy > 0
        floor = _FINE**2 * float(self._grid.weight.sum())
        for _ in range(stage.steps):
            if converged:
                break
            left = self._gradient(values, now)
            change, more = self._solve(left, now)
            products += more
            expected, length = float((left * change).sum()), 1.0
            while length >= _SHORTEST:
                trial = values + length * change
                lower = self._energy(trial, stage, other)
                if lower < energy:
                    break
                length *= 0.5
            else:
                converged = expected <= stage.tolerance * (energy + floor)
                break
            converged = length == 1.0 and energy - lower <= stage.tolerance * (energy + floor)
            values, energy, now, other = trial, lower, other, now
            energies.append(energy)
        misfit = float(now.sums[:, 0].sum())
        return Found(values=values, energies=tuple(energies), misfit=misfit, converged=converged, products=products)

    def _energy(self, values: FloatArray, stage: Stage, terms: _Terms) -> float:
        grid = self._grid
        look = (values, grid.east, grid.south, grid.target, grid.weight, grid.dark, grid.frame, grid.light)
        weights = (stage.bending, stage.kappa, stage.area)
        out = (terms.pull, terms.along, terms.down, terms.stiff, terms.tension, terms.sums)
        self._over("linearise", (*look, *weights, *out))
        total = float(terms.sums.sum())
        if grid.prior_weight.size:
            total += float((grid.prior_weight * (values - grid.prior) ** 2).sum())
        return total if math.isfinite(total) else math.inf

    def _gradient(self, values: FloatArray, terms: _Terms) -> FloatArray:
        grid, out = self._grid, np.zeros(self._shape)
        edges = (values, grid.east, grid.south, grid.free, terms.pull, terms.stiff, terms.tension)
        self._over("gradient", (*edges, grid.prior, grid.prior_weight, out, self._lines))
        return out

    def _over(self, name: str, arguments: tuple[object, ...]) -> None:
        self._rows(self._step[name], arguments, 0, *self._shape)

    def _solve(self, gradient: FloatArray, terms: _Terms) -> tuple[FloatArray, int]:
        """Return the step that a gradient asks for, and the iterations of conjugate gradients."""
        grid, shape = self._grid, self._shape
        held = np.full(shape, _DAMPING, np.float32)
        if grid.prior_weight.size:
            held += grid.prior_weight.astype(np.float32)
        operator = (grid.east, grid.south, grid.free, terms.along, terms.down, terms.stiff, terms.tension, held)
        cycle = self._cycle(terms, held)
        left, change, image = gradient.copy(), np.zeros(shape), np.zeros(shape)
        direction = np.zeros_like(cycle.value)
        shrink = float(np.abs(left).max(initial=0.0))
        if not shrink > 0:
            return change, 0
        np.multiply(left, 1.0 / shrink, out=cycle.right_side[1:-2, 1:-2], casting="same_kind")
        energy, ratio, done = self._precondition(cycle), 0.0, 0
        target = _FORCING**2 * energy
        while done < _LONGEST and energy > target:
            self._rows(self._turn, (cycle.value, ratio, direction), 0, *shape)
            self._over("multiply", (*operator, direction, image, self._lines))
            curvature = float(self._lines.sum())
            if not curvature > 0:
                break
            length = energy / curvature
            there = (length * shrink, direction, image, 1.0 / shrink, change, left, cycle.right_side)
            self._rows(self._advance, there, 0, *shape)
            following = self._precondition(cycle)
            ratio, energy, done = following / energy, following, done + 1
        return change, done

    def _precondition(self, cycle: GridCycle) -> float:
        """Run a cycle and keep what moves only free pixels; coarse grids leave their values on others."""
        product = cycle.run()
        np.multiply(cycle.value, self._free, out=cycle.value)
        return product

    def _cycle(self, terms: _Terms, held: FloatArray) -> GridCycle:
        """Return the multigrid of a Laplacian that resembles the operator."""
        grid = self._grid
        right, down = _resembling(grid, terms)
        diagonal = np.where(grid.free, held, 0.0)
        # Edges to known pixels hold the free one in place.
        for weight, one, two in ((right, np.s_[:, :-1], np.s_[:, 1:]), (down, np.s_[:-1], np.s_[1:])):
            diagonal[one] += np.where(grid.free[one] & ~grid.free[two], weight, 0.0)
            diagonal[two] += np.where(grid.free[two] & ~grid.free[one], weight, 0.0)
            np.multiply(weight, grid.free[one] & grid.free[two], out=weight)
        largest = max(float(part.max(initial=0.0)) for part in (right, down, diagonal))
        return GridCycle(
            right, down, diagonal, scale=1.0 / largest if largest > 0 else 1.0, rows=self._rows, compiled=self._compiled
        )


def _resembling(grid: Grid, terms: _Terms) -> tuple[FloatArray, FloatArray]:
    """Return edge weights of a Laplacian that bounds the operator roughly from both sides."""
    # A slope is the mean of two steps, so √w ∂E/∂p stands there with a half.
    along, down = (4.0 * np.square(part, dtype=np.float64) for part in (terms.along, terms.down))
    common = _ISOTROPIC * (along + down) + 0.5 * terms.tension + terms.stiff
    along, down = along + common, down + common
    right, below = 0.5 * (along[:, 1:] + along[:, :-1]), 0.5 * (down[1:] + down[:-1])
    return right * grid.east[:, :-1], below * grid.south[:-1]
