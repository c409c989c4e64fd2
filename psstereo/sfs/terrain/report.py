"""What a refined terrain rests on, pixel by pixel and in sentences."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from psstereo.sfs.method import Assumption, Basis
from psstereo.sfs.terrain.flags import TerrainFlag
from psstereo.sfs.terrain.inputs import Inputs, TerrainOptions
from psstereo.sfs.terrain.rounds import Problem, Progressed, look_at, view_images
from psstereo.types import BoolArray, FlagArray, FloatArray

__all__ = ["Findings", "assumptions_of", "examine"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Findings:
    """Heights with what is told of each pixel.

    Attributes
    ----------
    heights, normals : float64 arrays (h, w) and (h, w, 3)
        NaN where nothing is known.
    shadows, residuals, flags : arrays (k, h, w), (k, h, w), (h, w)
        As in the result.
    spreads : list of float
        Robust standard deviation of each image's residuals [1].
    """

    heights: FloatArray
    normals: FloatArray
    shadows: BoolArray
    residuals: FloatArray
    flags: FlagArray
    spreads: list[float]


def examine(problem: Problem, now: Progressed, known: BoolArray, *, settled: bool) -> Findings:
    """Look at every image once more, at the heights that were found.

    Parameters
    ----------
    problem : Problem
        What was known.
    now : Progressed
        What was found.
    known : bool array (h, w)
        Where the given elevation is known.
    settled : bool
        Whether the rounds met their tolerance.
    """
    view = view_images(problem, now)
    images = len(problem.images)
    shadows = np.zeros((images, *problem.shape), np.bool_)
    residuals = np.full((images, *problem.shape), np.nan)
    flags = np.where(known, 0, int(TerrainFlag.NO_ELEVATION)).astype(np.uint16)
    sees = np.zeros(problem.shape, np.bool_)
    for k, image in enumerate(problem.images):
        found = look_at(problem, now, view, k, (slice(None), slice(None)))
        there = np.isfinite(image)
        shadows[k] = there & (found.weight == 0)
        used = there & ~shadows[k]
        residuals[k][used] = found.residual[used]
        sees |= used
        flags[shadows[k]] |= np.uint16(TerrainFlag.SHADOWED)
        flags[~there] |= np.uint16(TerrainFlag.MISSING_SAMPLE)
        flags[used & (np.abs(found.residual) > view.scales[k].cauchy)] |= np.uint16(TerrainFlag.OUTLIER)
    flags[~sees] |= np.uint16(TerrainFlag.NO_IMAGE)
    nothing = ~sees & ~known
    flags[nothing] |= np.uint16(TerrainFlag.UNKNOWN)
    if not settled:
        flags |= np.uint16(TerrainFlag.NOT_CONVERGED)
    x, y = view.slopes
    normals = np.stack([-x, -y, np.ones_like(x)], axis=-1) / np.sqrt(1.0 + x * x + y * y)[..., None]
    return Findings(
        heights=np.where(nothing, np.nan, now.heights),
        normals=np.where(nothing[..., None], np.nan, normals),
        shadows=shadows,
        residuals=residuals,
        flags=flags,
        spreads=[scale.spread for scale in view.scales],
    )


def assumptions_of(
    given: Inputs, problem: Problem, reflectance: str, options: TerrainOptions, scales: dict[str, Any], *, free: bool
) -> tuple[Assumption, ...]:
    """Return everything that was taken, in sentences."""
    suns = "; ".join(
        f"azimuth {math.degrees(math.atan2(x, y)) % 360:.1f}°, elevation {math.degrees(math.asin(z)):.1f}°"
        for x, y, z in given.suns
    )
    law = "Lambert's" if reflectance == "lambert" else "the Lunar-Lambert law, with the weights "
    law += "" if reflectance == "lambert" else ", ".join(f"{ground.lunar:.3f}" for ground in problem.grounds)
    block = problem.tie.block
    elevation = "each of its values" if block == (1, 1) else f"each of its means over {block[1]} × {block[0]} pixels"
    albedo = (
        "It is the same everywhere."
        if options.albedo_step is None
        else f"It changes by {options.albedo_step:g} from cell to cell, typically."
    )

    def chosen(option: float | None) -> Basis:
        return Basis.ASSUMED if option is None else Basis.GIVEN

    return (
        Assumption(name="suns", basis=Basis.GIVEN, sentence=f"They stand at {suns}."),
        Assumption(name="reflectance", basis=Basis.ASSUMED, sentence=f"The ground follows {law}."),
        Assumption(name="albedo", basis=Basis.ASSUMED, sentence=albedo),
        Assumption(
            name="exposure",
            basis=Basis.ESTIMATED if free else Basis.ASSUMED,
            sentence="Each image has one exposure and one level of haze, which were found with the heights."
            if free
            else "The given elevation is level and tells none: that of the mean brightness was taken, and no haze.",
        ),
        Assumption(
            name="elevation",
            basis=chosen(options.elevation_error),
            sentence=f"The given elevation is right to {scales['elevation_error']:.3g} in {elevation}.",
        ),
        Assumption(
            name="roughness",
            basis=chosen(options.roughness),
            sentence=f"Slopes change by {scales['roughness']:.3g} from cell to cell, typically; where shading leaves a "
            "choice, the smoothest terrain is taken.",
        ),
        Assumption(
            name="surroundings",
            basis=Basis.ASSUMED,
            sentence="Nothing outside of the elevation casts a shadow on it; no light comes from one slope to another.",
        ),
    )
