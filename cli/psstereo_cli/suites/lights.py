"""Suite lights: every solver against the number of lights, to tell from how many each pays."""

import math
import time
from typing import TYPE_CHECKING, Any

from psstereo_cli.suites.size import dimensions

if TYPE_CHECKING:
    from psstereo.bench import Problem, Record
    from psstereo.types import Map, Progress

__all__ = ["LIGHTS", "SCENES", "lights"]

LIGHTS = (4, 8, 16, 32, 64, 96)
SCENES = ("matte", "noise", "highlights", "glossy", "metallic")
"""Three of the benchmark's problems, and two named scenes of the gallery."""


def lights(
    repeats: int, size: str | None, _lights: int, _threads: int, over: "Map", progress: "Progress"
) -> tuple[list["Record"], str, dict[str, Any]]:
    """Run every solver under few and many lights."""
    from psstereo.bench import Record
    from psstereo.normals import NORMAL_SOLVERS, estimate_normals

    shape = dimensions(size or "96x80")
    records: list[Record] = []
    errors: dict[tuple[str, str, int], float] = {}
    done, total = 0, len(SCENES) * len(LIGHTS) * len(NORMAL_SOLVERS)
    for scene in SCENES:
        for count in LIGHTS:
            capture, truth = _problem(scene, shape, count).make()
            for name, kind in NORMAL_SOLVERS.items():
                done += 1
                progress("suite lights", done, total)
                if count < kind.least_lights:
                    continue
                for repeat in range(repeats):
                    started = time.perf_counter()
                    result = estimate_normals(capture, kind(), over=over)
                    seconds = {**result.seconds, "total": time.perf_counter() - started}
                    error = _errors(result, capture, truth)
                    sizes = {"lights": count, "width": shape[0], "height": shape[1]}
                    records.append(
                        Record(
                            suite="lights",
                            problem=f"{scene}, {count} lights",
                            method=name,
                            repeat=repeat,
                            seconds=seconds,
                            error=error,
                            sizes=sizes,
                        )
                    )
                    errors[scene, name, count] = error["mean_deg"]
    rows = [[scene, name, *_cells(errors, scene, name)] for scene in SCENES for name in NORMAL_SOLVERS]
    table = {"title": "mean angular error", "columns": ["scene", "solver", *map(str, LIGHTS)], "rows": rows}
    return records, "least-squares", {"table": table, "notes": _notes(errors), "repeats": repeats}


def _problem(scene: str, shape: tuple[int, int], count: int) -> "Problem":
    from psstereo.bench import Problem
    from psstereo_synth.gallery import GALLERY, gallery_scene
    from psstereo_synth.problems import solver_problems
    from psstereo_synth.rendering import render
    from psstereo_synth.scenes.file import Changes

    width, height = shape
    if scene in GALLERY:

        def make() -> Any:
            (view,) = render(gallery_scene(scene, Changes(size=(height, width), lights=count)))
            return view.capture, view.truth

        return Problem(name=scene, summary="a named scene", make=make)
    return next(problem for problem in solver_problems(width, height, count) if problem.name == scene)


def _errors(result: Any, capture: Any, truth: Any) -> dict[str, float]:
    from psstereo.metrics import summarise_angles

    error = summarise_angles(result.normals, truth.normals, capture.mask)
    return {"mean_deg": error.mean_deg, "median_deg": error.median_deg, "max_deg": error.max_deg}


def _cells(errors: dict[tuple[str, str, int], float], scene: str, name: str) -> list[str]:
    found = [errors.get((scene, name, count), math.nan) for count in LIGHTS]
    return ["refused" if math.isnan(value) else f"{value:.2g}°" for value in found]


def _notes(errors: dict[tuple[str, str, int], float]) -> list[str]:
    """Say from how many lights each solver is no worse than least squares wherever that is not exact."""
    from psstereo.normals import NORMAL_SOLVERS

    notes = []
    for name, kind in NORMAL_SOLVERS.items():
        if name == "least-squares":
            continue
        pays = [
            count
            for count in LIGHTS
            if (SCENES[-1], name, count) in errors
            and sum(errors[s, name, count] for s in SCENES) < sum(errors[s, "least-squares", count] for s in SCENES)
        ]
        first = next((c for c in LIGHTS if all(later in pays for later in LIGHTS if later >= c)), None)
        when = "nowhere" if first is None else f"from {first} lights"
        notes.append(f"{name} pays {when} here, on the mean over the scenes; its own word is {kind.pays_from}.")
    return notes
