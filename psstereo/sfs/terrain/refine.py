"""Terrain from the sun: a coarse elevation refined by one or several sun-lit images seen from above.

Wanted are heights φ, an exposure T and haze H for each image, and an albedo A that make

    Σ_k Σ w ((I_k − H_k) / T_k − A R(φ; sun_k))²  +  tie · Σ (mean of φ over a coarse cell − φ₀)²
        + bend · Σ dx dy (φ_xx² + 2 φ_xy² + φ_yy²)

least. It is the energy of planetary shape-from-shading tools [1]_, with two changes. The coarse elevation is taken as
what it is, means over its cells, so that nothing pulls toward the smoothness of an interpolation; and exposure and haze
are unknowns of the same equations as the heights, since alternating between them creeps: details of too low contrast
explain an exposure that is too high. Weights w fall to zero in and beside shadows, cast by the terrain of the moment or
dark in the image, and by Cauchy's loss where an image contradicts the rest.

What it cannot do: the sun of a single image leaves waves that run across its azimuth to the bending energy; one image
does not tell albedo from slope; forms longer than a cell of the coarse elevation remain as good as that. Not for views
in which the ground hides itself: images must be brought to the map's grid before.

References
----------
.. [1] O. Alexandrov, R. A. Beyer, "Multiview shape-from-shading for planetary images", Earth and Space Science 5,
   652-666, 2018. doi:10.1029/2018EA000390
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from psstereo.results import Outcome
from psstereo.sfs.method import Assumption
from psstereo.sfs.terrain.albedo import fill_smoothly
from psstereo.sfs.terrain.exposure import first_exposures
from psstereo.sfs.terrain.flags import count_terrain_flags
from psstereo.sfs.terrain.inputs import Inputs, TerrainOptions, check_inputs
from psstereo.sfs.terrain.reflectance import Ground
from psstereo.sfs.terrain.report import assumptions_of, examine
from psstereo.sfs.terrain.rounds import Problem, Progressed, Rule, run_round
from psstereo.sfs.terrain.stencils import Stencils
from psstereo.sfs.terrain.sunlight import in_cast_shadow
from psstereo.sfs.terrain.tie import Tie, block_means
from psstereo.types import BoolArray, FlagArray, FloatArray, Progress, no_progress

__all__ = ["TerrainOptions", "TerrainResult", "enlarge", "refine_terrain"]

_COARSE = 4
"""Rounds on each grid coarser than the images'."""
_NARROWEST = 16
"""Rows and columns that such a grid has at least [px]."""
_SLACK = (0.1, 0.03)
"""Relative residual of the linear equations, in the first two rounds on a grid and from the third on."""
_STIFFEST = 0.1
"""Least error of means over cells that is worked with, in units of the usual one: below, equations cannot be solved."""
_LEFT = 0.3
"""Relative residual of the linear equations above which a small step does not mean that the heights have settled."""
_PACE = 0.6
"""Share of the step before, above which the next step is damped."""
_SHARED = 4
"""Rounds in which exposures still change where windows see parts of the images only."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TerrainResult:
    """A refined elevation and what belongs to it.

    Attributes
    ----------
    elevation : float64 array (h, w)
        Heights on the images' grid, row 0 north; NaN where nothing is known [length].
    normals : float64 array (h, w, 3)
        Unit normals, x east, y north, z up; NaN where there is no height [1].
    exposure, haze : float64 arrays (k,)
        Image = exposure · albedo · shading + haze; one an image [unit of the images].
    albedo : float64 array (h, w)
        Albedo relative to its mean; 1 where it was taken as constant [1].
    shadows : bool array (k, h, w)
        Where each image shows shadow or the ground turns away from its sun.
    flags : uint16 array (h, w)
        Bits of :class:`~psstereo.sfs.terrain.flags.TerrainFlag`.
    residuals : float64 array (k, h, w)
        Image less prediction in shares of the exposure; NaN in shadow and where the image is unknown [1].
    coarse : float64 array (h, w)
        The start: the given elevation, on the images' grid by cubic interpolation, its gaps filled [length].
    outcome : Outcome
        How it ended.
    assumptions : tuple of Assumption
        What was taken, for a person.
    facts : mapping
        Plain figures for the record.
    seconds : float
        Time it took [s].
    """

    elevation: FloatArray
    normals: FloatArray
    exposure: FloatArray
    haze: FloatArray
    albedo: FloatArray
    shadows: BoolArray
    flags: FlagArray
    residuals: FloatArray
    coarse: FloatArray
    outcome: Outcome
    assumptions: tuple[Assumption, ...]
    facts: Mapping[str, Any] = field(default_factory=dict)
    seconds: float = 0.0


def refine_terrain(
    elevation: npt.ArrayLike,
    images: Sequence[npt.ArrayLike] | npt.NDArray[np.generic],
    suns: npt.ArrayLike,
    *,
    cell: tuple[float, float],
    reflectance: str = "lambert",
    view: npt.ArrayLike = (0.0, 0.0, 1.0),
    options: TerrainOptions | None = None,
    progress: Progress = no_progress,
) -> TerrainResult:
    """Refine an elevation from images under known suns.

    Parameters
    ----------
    elevation : array (hb, wb)
        Heights, row 0 north, columns from west to east; NaN where unknown. Coarser than the images, it holds means over
        its cells, each of which covers a whole number of pixels [length].
    images : k arrays (h, w)
        Linear brightness on one map grid, NaN where unknown [relative].
    suns : array (k, 3)
        Directions toward the sun, x east, y north, z up; :func:`~psstereo.lights.solar.from_azimuth` makes them [1].
    cell : (float, float)
        Distances of the images' columns and rows [length].
    reflectance : str
        ``"lambert"`` or ``"lunar-lambert"``.
    view : array (3,) or (k, 3)
        Directions toward the camera, far away; straight up unless told otherwise. Lambert's law has no use for it [1].
    options : TerrainOptions, optional
        Weights, windows, limits.
    progress : callback, optional
        Told how far the work has come.

    Returns
    -------
    TerrainResult
        Heights, normals, exposures, shadows, flags.

    Raises
    ------
    InputError
        If sizes do not fit, nothing is known, a sun is below the horizon, or an image does not follow its sun.
    OptionError
        If an option has no meaning.
    """
    started = time.perf_counter()
    options = TerrainOptions() if options is None else options
    given = check_inputs(elevation, images, suns, cell=cell, reflectance=reflectance, view=view, options=options)
    known = np.isfinite(given.elevation)
    level = float(given.elevation[known].mean())
    coarse = fill_smoothly(np.where(known, given.elevation - level, 0.0), known)
    problem, scales = _pose(given, coarse, known, reflectance, options)
    start = enlarge(coarse, given.block)
    now, rounds, settled = _solve(problem, start, options, progress)
    found = examine(problem, now, np.repeat(np.repeat(known, given.block[0], 0), given.block[1], 1), settled=settled)
    outcome = Outcome.SOLVED if settled else Outcome.NOT_CONVERGED
    outcome = Outcome.PARTIAL if settled and np.isnan(found.heights).any() else outcome
    facts = {
        "reflectance": reflectance,
        "options": asdict(options),
        **scales,
        "images": len(given.images),
        "pixels": int(start.size),
        "block": list(given.block),
        "rounds": rounds,
        "rms_change": float(np.sqrt(np.mean((now.heights - start) ** 2))),
        "rms_last_step": now.step,
        "residual": found.spreads,
        "sunlit": [float(1.0 - shadow.mean()) for shadow in found.shadows],
        "flags": count_terrain_flags(found.flags),
        "notes": [*given.notes, *_raised(options.elevation_error, scales["elevation_error"])],
    }
    return TerrainResult(
        elevation=found.heights + level,
        normals=found.normals,
        exposure=now.exposures.exposure,
        haze=now.exposures.haze,
        albedo=np.ones(start.shape) if now.albedo is None else now.albedo,
        shadows=found.shadows,
        flags=found.flags,
        residuals=found.residuals,
        coarse=start + level,
        outcome=outcome,
        assumptions=assumptions_of(given, problem, reflectance, options, scales, free=now.exposures.free),
        facts=facts,
        seconds=time.perf_counter() - started,
    )


def enlarge(field: FloatArray, block: tuple[int, int]) -> FloatArray:
    """Return cell means at the centres of finer cells, by cubic interpolation; beyond the border the last ones go on.

    Parameters
    ----------
    field : float64 array (h, w)
        Values at the centres of coarse cells.
    block : (int, int)
        Fine rows and columns in each.

    Returns
    -------
    float64 array (h · block[0], w · block[1])
        Values at the centres of fine cells.
    """
    from scipy.ndimage import map_coordinates

    if block == (1, 1):
        return field.copy()
    rows, columns = ((np.arange(n * b) + 0.5) / b - 0.5 for n, b in zip(field.shape, block, strict=True))
    places = np.meshgrid(rows, columns, indexing="ij")
    return np.asarray(map_coordinates(field, places, order=3, mode="nearest"), np.float64)


def _pose(
    given: Inputs, coarse: FloatArray, known: BoolArray, reflectance: str, options: TerrainOptions
) -> tuple[Problem, dict[str, float]]:
    """Return the problem on the images' grid, and the scales that were chosen."""
    dx, dy = given.cell
    length = float(np.sqrt(dx * dy))
    slope = _rms_slope(coarse, (dx * given.block[1], dy * given.block[0]))
    roughness = max(slope, 0.05) if options.roughness is None else options.roughness
    support = given.block if options.support is None else (options.support, options.support)
    wide = float(np.sqrt(support[0] * support[1]))
    usual = 0.005 * roughness * length * wide if wide > 1 else max(slope, 0.05) * length
    error = usual if options.elevation_error is None else options.elevation_error
    if wide > 1:
        error = max(error, _STIFFEST * usual)
    weight = (options.noise / error) ** 2
    shape = given.images[0].shape
    if given.block != (1, 1):
        tie = Tie(block=support, shape=shape, target=coarse, weight=np.where(known, weight, 0.0))
    else:
        bare = Tie(block=support, shape=shape, target=coarse, weight=coarse, valid=None if known.all() else known)
        # A block that is half known counts for half.
        share = bare.present / (support[0] * support[1])
        tie = replace(bare, target=bare.means(coarse), weight=weight * share)
    lunar = 0.0 if reflectance == "lambert" else options.lunar_weight
    rule = Rule(
        noise=options.noise,
        bend=(options.noise / roughness) ** 2,
        stiffness=None if options.albedo_step is None else (options.noise / options.albedo_step) ** 2,
        tile=options.tile,
        overlap=options.overlap,
        threads=options.threads,
    )
    grounds = [Ground.under(sun, eye, lunar) for sun, eye in zip(given.suns, given.views, strict=True)]
    problem = Problem(images=given.images, grounds=grounds, tie=tie, cell=given.cell, rule=rule)
    return problem, {"elevation_error": error, "roughness": roughness}


def _raised(asked: float | None, error: float) -> list[str]:
    """Return a note if the elevation was trusted less than was asked for."""
    if asked is None or error == asked:
        return []
    return [
        f"The error of the elevation counts as {error:.3g} instead of {asked:.3g}, which is too small to work with."
    ]


def _rms_slope(heights: FloatArray, cell: tuple[float, float]) -> float:
    """Return the root-mean-square slope of heights, from steps to neighbours."""
    across, along = np.diff(heights, axis=1) / cell[0], np.diff(heights, axis=0) / cell[1]
    return float(np.sqrt(sum(np.mean(part * part) for part in (across, along) if part.size)))


def _solve(
    problem: Problem, start: FloatArray, options: TerrainOptions, progress: Progress
) -> tuple[Progressed, list[dict[str, Any]], bool]:
    """Work from coarse grids to the images' own; return where it ended, a word on each round, whether it settled."""
    factors = _factors(problem)
    total = _COARSE * (len(factors) - 1) + options.rounds
    now: Progressed | None = None
    begun, history, settled = start, [], False
    for factor in factors:
        grid = problem if factor == 1 else problem.coarser(factor)
        begun = block_means(start, (factor, factor))
        if now is None:
            now = Progressed(heights=begun, exposures=_first(grid, begun))
        else:
            now = replace(now, heights=enlarge(now.heights, (2, 2)))
        damping, before = 1.0, np.inf
        for number in range(options.rounds if factor == 1 else _COARSE):
            whole = factor > 1 or options.tile is None
            now = run_round(
                grid,
                now,
                tolerance=_SLACK[number >= 2],
                exposures=whole or number < _SHARED,
                damping=damping,
            )
            # Where weights and slopes chase each other the steps go to and fro: half of one ends between.
            damping = max(0.5 * damping, 0.25) if number > 1 and now.step > _PACE * before else 1.0
            before = now.step
            moved = float(np.sqrt(np.mean((now.heights - begun) ** 2)))
            history.append({"grid": factor, "iterations": now.iterations, "rms_step": now.step, "rms_change": moved})
            progress("rounds of shading", len(history), total)
            settled = now.step <= options.tolerance * moved and now.residual < _LEFT and (whole or number > _SHARED)
            if settled:
                break
    assert now is not None
    progress("rounds of shading", total, total)
    return now, history, settled


def _factors(problem: Problem) -> list[int]:
    """Return by how much cells grow, from the coarsest grid to the images'."""
    factors = [1]
    while all(
        side % (2 * factors[0]) == 0 and size % (2 * factors[0]) == 0 and size // (2 * factors[0]) >= _NARROWEST
        for side, size in zip(problem.tie.block, problem.shape, strict=True)
    ):
        if min(problem.tie.block) < 4 * factors[0]:
            break
        factors.insert(0, 2 * factors[0])
    return factors


def _first(problem: Problem, heights: FloatArray) -> Any:
    """Return exposures from the coarse elevation."""
    slopes = Stencils(problem.shape, problem.cell).slopes(heights)
    shades = [
        np.where(in_cast_shadow(heights, problem.cell, ground.sun), 0.0, np.maximum(ground.shade(*slopes).value, 0.0))
        for ground in problem.grounds
    ]
    names = [f"Image {number}" for number in range(1, len(shades) + 1)]
    return first_exposures(problem.images, shades, names)
