"""Suite planner: what the plan costs in error and time against every single configuration, scene by scene."""

import math
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from psstereo_cli.suites.size import dimensions

if TYPE_CHECKING:
    from psstereo.bench import Record
    from psstereo.capture import Capture, Truth
    from psstereo.results import NormalsResult
    from psstereo.types import Map, Progress

__all__ = ["CONFIGURATIONS", "SCENES", "planner"]

SCENES = (
    "matte-sphere",
    "hills",
    "terrain-day",
    "glossy",
    "metallic",
    "three-lights",
    "narrow-cone",
    "cliff",
    "low-light",
)
"""Scenes of the gallery under distant lights, with the truth known."""

CONFIGURATIONS = (
    "least-squares",
    "trimmed",
    "ambient",
    "robust",
    "response-bend",
    "bi-polynomial",
    "bivariate",
    "exemplar",
)
"""Solvers that the plan is measured against, each for all of a scene."""

PLANNED, WHOLE = "planned", "nothing left out"
_AS_GOOD, _NOTHING = 1.05, 0.02
"""Error up to which a configuration is as good as the best: a ratio, and degrees that never matter."""
_BARS, _ROUNDING = 2.0, 1e-3
"""Error bars within which two results agree, and the angle that the rounding of single precision may make [deg]."""


def planner(
    repeats: int,
    size: str | None,
    lights: int,
    threads: int,
    over: "Map",
    progress: "Progress",
    folder: Path | None = None,
) -> tuple[list["Record"], str, dict[str, Any]]:
    """Measure normals: planned, with nothing left out, and by each configuration; scenes, and captures of the user."""
    from psstereo_cli.suites.planner_predictions import prediction_table, predictions

    del lights
    width, height = dimensions(size or "160x160")
    scenes = {name: _gallery(name, (height, width)) for name in SCENES} | _captures(folder)
    records: list[Record] = []
    chosen: dict[str, str] = {}
    declined: dict[str, str] = {}
    for done, (name, make) in enumerate(scenes.items()):
        records += _scene(name, *make(), repeats=repeats, over=over, chosen=chosen, declined=declined)
        progress("suite planner", done + 1, len(scenes))
    table = _table(records, chosen)
    foretold = predictions(threads, progress)
    return (
        records + foretold,
        PLANNED,
        {
            "table": table,
            "notes": [*_notes(), *declined.values(), *prediction_table(foretold)],
            "sizes": {"width": width, "height": height},
        },
    )


def _gallery(name: str, shape: tuple[int, int]) -> "Callable[[], tuple[Capture, Truth]]":
    def make() -> "tuple[Capture, Truth]":
        from psstereo_synth.gallery import gallery_scene
        from psstereo_synth.rendering import render
        from psstereo_synth.scenes.file import Changes

        found = render(gallery_scene(name, Changes(size=shape)))[0]
        return found.capture, found.truth

    return make


def _captures(folder: Path | None) -> "dict[str, Callable[[], tuple[Capture, Truth]]]":
    """Return the captures with true normals in a folder, or that folder itself."""
    if folder is None:
        return {}
    from functools import partial

    from psstereo.errors import MissingFileError
    from psstereo.io import recognise

    found: dict[str, Callable[[], tuple[Capture, Truth]]] = {}
    for place in [folder, *sorted(path for path in folder.iterdir() if path.is_dir())]:
        if recognise(place):
            found[place.name] = partial(_read, place)
    if not found:
        raise MissingFileError(
            given=f"{folder} holds no capture.",
            needed="A capture with true normals, or folders of them.",
            remedy="Name it with --folder.",
        )
    return found


def _read(place: Path) -> "tuple[Capture, Truth]":
    from psstereo.capture import Truth
    from psstereo.io import read_capture

    capture, truth = read_capture(place)
    return capture, truth or Truth()


def _scene(
    name: str,
    capture: "Capture",
    truth: "Truth",
    *,
    repeats: int,
    over: "Map",
    chosen: dict[str, str],
    declined: dict[str, str],
) -> "list[Record]":
    """Run everything on one scene, in turns; a solver that declines the scene is left out, and said."""
    from psstereo.bench.run import DECLINES, why_declined
    from psstereo.normals import NORMAL_SOLVERS
    from psstereo.pipeline import Options, reconstruct

    if truth.normals is None or not capture.rig.all_distant:
        return []
    only = Options(integrator=None)
    ways: dict[str, Options] = {
        PLANNED: only,
        WHOLE: replace(only, nothing_left_out=True),
        **{one: replace(only, solver=NORMAL_SOLVERS[one]()) for one in CONFIGURATIONS},
    }
    records = []
    for repeat in range(-1, repeats):
        results: dict[str, NormalsResult] = {}
        for method, options in list(ways.items()):
            started, worked = time.perf_counter(), time.process_time()
            try:
                results[method] = reconstruct(capture, options, over=over).normals
            except DECLINES as refusal:
                del ways[method]
                declined[f"{name}, {method}"] = f"{name}, {method}: {why_declined(refusal)}"
                continue
            seconds = {"total": time.perf_counter() - started, "processor": time.process_time() - worked}
            if repeat >= 0:
                records.append(_record(name, method, repeat, seconds, results, capture, truth))
        if PLANNED in results:
            chosen[name] = str(results[PLANNED].facts["solver"])
    return records


def _record(
    name: str,
    method: str,
    repeat: int,
    seconds: dict[str, float],
    results: "Mapping[str, NormalsResult]",
    capture: "Capture",
    truth: "Truth",
) -> "Record":
    """Return the record of one run; for that with nothing left out also how far it is from the planned."""
    import numpy as np

    from psstereo.bench import Record, peak_memory
    from psstereo.metrics import angular_error, summarise_angles
    from psstereo.results import Outcome

    assert truth.normals is not None
    result = results[method]
    summary = summarise_angles(result.normals, truth.normals, capture.mask)
    error = {"mean_deg": summary.mean_deg, "median_deg": summary.median_deg, "coverage": summary.coverage}
    error["settled"] = float(result.outcome is not Outcome.NOT_CONVERGED)
    if method == WHOLE and PLANNED in results:
        other = results[PLANNED]
        apart = np.degrees(angular_error(result.normals, other.normals))
        bars = np.degrees(np.hypot(result.uncertainty, other.uncertainty))
        known = np.isfinite(apart) & np.isfinite(bars)
        if known.any():
            error["apart_deg"] = float(apart[known].mean())
            error["bars_deg"] = float(bars[known].mean())
            error["inside"] = float((apart[known] <= _BARS * bars[known] + _ROUNDING).mean())
    m, h, w, _ = capture.stack.shape
    return Record(
        suite="planner",
        problem=name,
        method=method,
        repeat=repeat,
        seconds=seconds,
        error={key: float(value) for key, value in error.items() if np.isfinite(value)},
        sizes={"lights": m, "width": w, "height": h, "pixels": int(result.facts["pixels"])},
        memory=peak_memory(),
    )


def _table(records: "list[Record]", chosen: Mapping[str, str]) -> dict[str, Any]:
    """Return what is printed: errors, and the regret in error and time."""
    rows = []
    for scene in dict.fromkeys(record.problem for record in records):
        own = [record for record in records if record.problem == scene]
        errors = {method: _middle(own, method, "error", "mean_deg") for method in dict.fromkeys(r.method for r in own)}
        times = {method: _middle(own, method, "seconds", "processor") for method in errors}
        settled = {method for method in errors if _middle(own, method, "error", "settled") > 0}
        single = {method: errors[method] for method in errors if method in CONFIGURATIONS and method in settled}
        best = min(single, key=lambda method: single[method])
        good = [method for method, error in single.items() if error <= _limit(single[best])]
        cheapest = min(good, key=lambda method: times[method])
        error, least = errors[PLANNED], single[best]
        apart, bars, inside = (_middle(own, WHOLE, "error", key) for key in ("apart_deg", "bars_deg", "inside"))
        rows.append(
            (
                scene,
                chosen.get(scene, ""),
                f"{error:.3f}°",
                f"{least:.3f}° ({best})",
                "none" if error <= _limit(least) else f"{error / least - 1:+.0%}",
                f"{times[PLANNED]:.2f} s",
                f"{times[cheapest]:.2f} s ({cheapest})",
                f"{times[PLANNED] / times[cheapest]:.2f}",
                f"{errors.get(WHOLE, math.nan):.3f}°",
                "none told" if math.isnan(apart) else f"{apart:.3f}° of {bars:.3f}°, {inside:.1%}",
            )
        )
    columns = (
        "scene",
        "planned",
        "error",
        "best single",
        "regret",
        "time",
        "cheapest as good",
        "ratio",
        "nothing left out",
        "apart, error bars, inside",
    )
    return {"title": "mean angular error, and processor time of reading and normals", "rows": rows, "columns": columns}


def _limit(best: float) -> float:
    return max(_AS_GOOD * best, best + _NOTHING)


def _middle(records: "list[Record]", method: str, group: str, key: str) -> float:
    found = [getattr(one, group)[key] for one in records if one.method == method and key in getattr(one, group)]
    return statistics.median(found) if found else math.nan


def _notes() -> list[str]:
    return [
        "Regret: the planned run's error above that of the best single configuration; none within 5 % or 0.02°.",
        "Best single: among those that converge at nineteen pixels of twenty or more.",
        "Ratio: its time over that of the cheapest configuration whose error is that close to the best.",
        "Nothing left out: gates are set and, where the plan had least squares, the richest solver that the lights are"
        " enough for is taken; a solver that was chosen among rivals stays, since none of its corrections is left out.",
        "Apart: mean angle between the planned run's normals and those with nothing left out, beside their error bars;"
        " inside: share of the pixels at which it is within twice the bar.",
    ]
