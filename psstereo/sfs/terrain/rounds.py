"""Rounds of Gauss–Newton over one grid: linearise every image, solve window by window, blend."""

from dataclasses import dataclass, replace

import numpy as np

from psstereo.depth.rows import Rows
from psstereo.sfs.terrain.albedo import smooth_albedo
from psstereo.sfs.terrain.exposure import Exposures
from psstereo.sfs.terrain.reflectance import Ground
from psstereo.sfs.terrain.stencils import Stencils
from psstereo.sfs.terrain.sunlight import ImageScale, Sunlight, clear_of_shadow, image_scale, in_cast_shadow, look
from psstereo.sfs.terrain.system import Step, System
from psstereo.sfs.terrain.tie import Tie, block_means
from psstereo.sfs.terrain.windows import Window, windows
from psstereo.types import FloatArray

__all__ = ["Problem", "Progressed", "Rule", "View", "look_at", "run_round", "view_images"]

_SAMPLE = 1_000_000
"""Pixels from which an image's scale of residuals is taken."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Rule:
    """How much each term counts, and how far the work goes.

    Attributes
    ----------
    noise : float
        Standard deviation of brightness that the model does not explain, in shares of the exposure [1].
    bend : float
        Weight of the bending energy [1].
    stiffness : float or None
        Weight of steps of the albedo; None for a constant albedo [1].
    tile, overlap : int or None, int
        Windows [px].
    threads : int
        Threads at most.
    limit : int
        Iterations of conjugate gradients at most.
    """

    noise: float
    bend: float
    stiffness: float | None
    tile: int | None
    overlap: int
    threads: int
    limit: int = 400


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """Images, suns and the coarse elevation on one grid.

    Attributes
    ----------
    images : list of float64 arrays (h, w)
        Brightness, NaN where unknown.
    grounds : list of Ground
        Reflectance under each sun.
    tie : Tie
        The coarse elevation.
    cell : (float, float)
        Distances of columns and rows [length].
    rule : Rule
        Weights and limits.
    """

    images: list[FloatArray]
    grounds: list[Ground]
    tie: Tie
    cell: tuple[float, float]
    rule: Rule

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.tie.shape

    def coarser(self, factor: int) -> "Problem":
        """Return the problem on cells `factor` times as large."""
        return Problem(
            images=[block_means(image, (factor, factor)) for image in self.images],
            grounds=self.grounds,
            tie=self.tie.coarser(factor),
            cell=(self.cell[0] * factor, self.cell[1] * factor),
            rule=replace(self.rule, bend=self.rule.bend / factor**2, stiffness=None, tile=None),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Progressed:
    """Where the rounds have come to.

    Attributes
    ----------
    heights : float64 array (h, w)
        Heights [length].
    exposures : Exposures
        Of each image.
    albedo : float64 array (h, w) or None
        Albedo, of mean 1; None while it counts as constant [1].
    iterations : int
        Iterations of conjugate gradients in the last round, of the window that needed most.
    step : float
        Root-mean-square of the last round's whole step [length].
    residual : float
        Relative residual of its equations, of the worst window [1].
    """

    heights: FloatArray
    exposures: Exposures
    albedo: FloatArray | None = None
    iterations: int = 0
    step: float = np.inf
    residual: float = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """All images at the heights of the moment, as far as windows share it.

    Attributes
    ----------
    slopes : pair of float64 arrays (h, w)
        Slopes [1].
    shadows : list of pairs of float32 arrays (h, w)
        Weight that shadows leave, and depth in cast shadow.
    scales : list of ImageScale
        Scale of each image's residuals.
    """

    slopes: tuple[FloatArray, FloatArray]
    shadows: list[tuple[FloatArray, FloatArray]]
    scales: list[ImageScale]


def view_images(problem: Problem, now: Progressed) -> View:
    """Find slopes, shadows and the scale of residuals."""
    stencils = Stencils(problem.shape, problem.cell)
    slopes = stencils.slopes(now.heights)
    shadows, scales = [], []
    thin = max(1, int(np.sqrt(now.heights.size / _SAMPLE)))
    part = np.s_[::thin, ::thin]
    for k, (image, ground) in enumerate(zip(problem.images, problem.grounds, strict=True)):
        cast = in_cast_shadow(now.heights, problem.cell, ground.sun)
        clear, around = clear_of_shadow(now.exposures.shares(k, image), cast)
        shadows.append((clear.astype(np.float32), around.astype(np.float32)))
        sample = look_at(problem, now, View(slopes=slopes, shadows=shadows, scales=[]), k, part)
        scales.append(image_scale(sample, problem.rule.noise))
    return View(slopes=slopes, shadows=shadows, scales=scales)


def look_at(problem: Problem, now: Progressed, view: View, number: int, part: tuple[slice, slice]) -> Sunlight:
    """Linearise one image, or a window of it."""
    clear, around = view.shadows[number]
    return look(
        now.exposures.shares(number, problem.images[number][part]),
        problem.grounds[number],
        slopes=(view.slopes[0][part], view.slopes[1][part]),
        shadow=(clear[part], around[part]),
        scale=view.scales[number] if view.scales else None,
        albedo=None if now.albedo is None else now.albedo[part],
    )


def run_round(
    problem: Problem, now: Progressed, *, tolerance: float, exposures: bool, damping: float = 1.0
) -> Progressed:
    """Run one round.

    Parameters
    ----------
    problem : Problem
        What is known.
    now : Progressed
        Where to start.
    tolerance : float
        Relative residual of each window's equations [1].
    exposures : bool
        Whether exposures and haze change too. Windows see them a little differently: what all get is the mean, weighted
        by what each window knows of them.
    damping : float
        Share of the step that is taken [1].

    Returns
    -------
    Progressed
        Heights after the round, and the root-mean-square of the whole step.
    """
    view = view_images(problem, now)
    pull = problem.tie.pull(now.heights)
    total = np.zeros(problem.shape)
    weighted, known = np.zeros((2, 2 * len(problem.images)))
    iterations, residual = 0, 0.0
    with Rows(problem.rule.threads) as rows:
        for window in windows(problem.shape, problem.tie.block, problem.rule.tile, problem.rule.overlap):
            step = _solve_window(
                problem,
                now,
                view,
                window,
                pull=pull,
                rows=rows,
                tolerance=tolerance,
                exposures=exposures and now.exposures.free,
            )
            blend = window.blend[0][:, None] * window.blend[1]
            total[window.rows, window.columns] += blend * step.heights
            weighted += step.information * step.exposures
            known += step.information
            iterations, residual = max(iterations, step.iterations), max(residual, step.residual)
    change = np.divide(weighted, known, out=np.zeros_like(known), where=known > 0)
    after = Progressed(
        heights=now.heights + damping * total,
        exposures=now.exposures.moved(damping * change),
        albedo=now.albedo,
        iterations=iterations,
        residual=residual,
        step=float(np.sqrt(np.mean(total * total))),
    )
    if problem.rule.stiffness is None:
        return after
    return replace(after, albedo=_new_albedo(problem, after))


def _solve_window(
    problem: Problem,
    now: Progressed,
    view: View,
    window: Window,
    *,
    pull: FloatArray,
    rows: Rows,
    tolerance: float,
    exposures: bool,
) -> Step:
    part = window.rows, window.columns
    shape = window.rows.stop - window.rows.start, window.columns.stop - window.columns.start
    system = System(
        stencils=Stencils(shape, problem.cell),
        inner=window.inner,
        tie=problem.tie.window(*window.proper),
        bend=problem.rule.bend,
        images=len(problem.images),
        rows=rows,
    )
    for k in range(len(problem.images)):
        system.add(k, look_at(problem, now, view, k, part))
    return system.solve(
        now.heights[part],
        pull[window.proper],
        tolerance=tolerance,
        limit=problem.rule.limit,
        exposures=exposures,
    )


def _new_albedo(problem: Problem, now: Progressed) -> FloatArray:
    """Return the albedo that the images ask for at these heights."""
    view = view_images(problem, now)
    before = np.ones(problem.shape) if now.albedo is None else now.albedo
    weight, product = np.zeros((2, *problem.shape))
    for k in range(len(problem.images)):
        found = look_at(problem, now, view, k, (slice(None), slice(None)))
        bare = found.value / before
        weight += found.weight * bare * bare
        product += found.weight * bare * (found.value + found.residual)
    evidence = np.divide(product, weight, out=np.ones_like(weight), where=weight > 0)
    stiffness = problem.rule.stiffness
    assert stiffness is not None
    return smooth_albedo(evidence, weight, stiffness, before, threads=problem.rule.threads)
