"""Suite coverage: whether the true normal lies inside the 95 % region as often as it should."""

import math
import statistics
import time
from typing import TYPE_CHECKING, Any

from psstereo_cli.suites.size import dimensions

if TYPE_CHECKING:
    from psstereo.bench import Record
    from psstereo.normals import NormalSolver
    from psstereo.types import Map, Progress

__all__ = ["LIGHTS", "METHODS", "NOISES", "SCENES", "coverage"]

NOISES = (0.001, 0.01, 0.03, 0.1)
"""Standard deviation of the noise over the brightness of a pixel that faces the light."""
LIGHTS = (4, 6, 8, 16, 32, 96)
SCENES = ((40.0, 35.0), (60.0, 70.0), (80.0, 85.0))
"""Largest tilt of the lights and of the normals [deg]; the more, the more attached shadow."""
METHODS = ("least-squares", "robust")


def coverage(
    repeats: int, size: str | None, _lights: int, _threads: int, over: "Map", progress: "Progress"
) -> tuple[list["Record"], str, dict[str, Any]]:
    """Count over noise, lights and shadows, for the solvers that promise error bars."""
    from psstereo.normals import NORMAL_SOLVERS

    width, height = dimensions(size or "64x64")
    methods = {name: NORMAL_SOLVERS[name]() for name in METHODS if name in NORMAL_SOLVERS}
    records: list[Record] = []
    rows = []
    total, done = len(NOISES) * len(LIGHTS) * len(SCENES), 0
    for scene in SCENES:
        for noise in NOISES:
            for count in LIGHTS:
                cell = _cell(scene, noise, count, (height, width), methods, repeats, over)
                records += cell
                rows.append(_row(cell, noise, count, list(methods)))
                done += 1
                progress("suite coverage", done, total)
    columns = ["shadows", "noise", "lights", *(f"{name}{what}" for name in methods for what in (", inside", ", 95 %"))]
    pixels = repeats * width * height
    table = {"title": f"true normals inside the 95 % region, {pixels} pixels a row", "columns": columns, "rows": rows}
    notes = [
        "Inside: share of the pixels with a known error; it should be 95 %.",
        f"By chance alone it is off by {2 * math.sqrt(0.95 * 0.05 / pixels):.1%} in one row of twenty.",
        "95 %: median of the angle that the region reaches, its worst semi-axis.",
    ]
    return records, METHODS[0], {"table": table, "notes": notes, "repeats": repeats}


def _cell(
    scene: tuple[float, float],
    noise: float,
    count: int,
    shape: tuple[int, int],
    methods: "dict[str, NormalSolver[Any]]",
    repeats: int,
    over: "Map",
) -> "list[Record]":
    """Run the methods on one combination, each time with other normals and other noise."""
    from psstereo.bench import Record
    from psstereo.normals import estimate_normals
    from psstereo_synth import spiral
    from psstereo_synth.caps import cap_capture

    lights_tilt, tilt = (math.radians(angle) for angle in scene)
    records = []
    for repeat in range(repeats):
        capture, truth = cap_capture(spiral(count, max_tilt=lights_tilt), shape, tilt=tilt, noise=noise, seed=repeat)
        for name, solver in methods.items():
            started = time.perf_counter()
            result = estimate_normals(capture, solver, covariance=True, over=over)
            seconds = {**result.seconds, "total": time.perf_counter() - started}
            records.append(
                Record(
                    suite="coverage",
                    problem=f"lights to {scene[0]:g}°, normals to {scene[1]:g}°, noise {noise:g}, {count} lights",
                    method=name,
                    repeat=repeat,
                    seconds=seconds,
                    error=_figures(result, capture, truth),
                    sizes={"lights": count, "width": shape[1], "height": shape[0]},
                )
            )
    return records


def _figures(result: Any, capture: Any, truth: Any) -> dict[str, float]:
    """Return what the table needs; shares of what nobody could tell are 0 pixels wide and left out."""
    import numpy as np

    from psstereo.metrics import confidence_angle, summarise_angles
    from psstereo.metrics import coverage as inside

    found = inside(result.normals, result.covariance, truth.normals, result.used)
    reach = confidence_angle(result.covariance, result.used)
    error = summarise_angles(result.normals, truth.normals)
    shadow = float(((capture.rig.directions @ truth.normals.reshape(-1, 3).T) <= 0).mean())
    figures = {
        "inside": found.share,
        "reach_deg": math.degrees(float(np.nanmedian(reach))) if found.count else math.nan,
        "told": found.count / max(found.count + found.untold, 1),
        "mean_deg": error.mean_deg,
        "median_deg": error.median_deg,
        "max_deg": error.max_deg,
        "shadow": shadow,
    }
    return {key: value for key, value in figures.items() if math.isfinite(value)}


def _row(cell: "list[Record]", noise: float, count: int, methods: list[str]) -> list[str]:
    """Return one row of the table: means over the rounds, weighted by the pixels that were judged."""
    shadow = statistics.fmean(record.error["shadow"] for record in cell)
    row = [f"{shadow:.0%}", f"{noise:.1%}", str(count)]
    for name in methods:
        own = [record.error for record in cell if record.method == name and "inside" in record.error]
        told = sum(error["told"] for error in own)
        if not told:
            row += ["not told", ""]
            continue
        share = sum(error["inside"] * error["told"] for error in own) / told
        row += [f"{share:.1%}", f"{statistics.fmean(error['reach_deg'] for error in own):.3g}°"]
    return row
