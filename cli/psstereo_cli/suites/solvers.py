"""Suite solvers: error and time of every solver where they differ, on images that are in memory."""

import statistics
from typing import TYPE_CHECKING, Any

from psstereo_cli.suites.size import dimensions

if TYPE_CHECKING:
    from psstereo.bench import Record
    from psstereo.types import Map, Progress

__all__ = ["solvers"]

_BASELINE = "least-squares"


def solvers(
    repeats: int, size: str | None, lights: int, _threads: int, over: "Map", progress: "Progress"
) -> tuple[list["Record"], str, dict[str, Any]]:
    """Run every solver on a matte surface, with noise, and with highlights."""
    from psstereo.bench import run_solvers
    from psstereo.normals import NORMAL_SOLVERS
    from psstereo_synth.problems import solver_problems

    width, height = dimensions(size or "612x512")
    methods = {name: kind() for name, kind in NORMAL_SOLVERS.items() if kind.least_lights <= lights}
    problems = solver_problems(width, height, lights)
    records = run_solvers("solvers", problems, methods, repeats=repeats, over=over, progress=progress)
    rows = [
        _row(problem.name, name, [r for r in records if (r.problem, r.method) == (problem.name, name)], records)
        for problem in problems
        for name in methods
    ]
    pixels = records[0].sizes["pixels"]
    columns = ["problem", "solver", "solving", "ratio", "mean", "median", "largest"]
    title = f"{pixels} pixels under {lights} lights, medians of {repeats} rounds"
    refused = [name for name in NORMAL_SOLVERS if name not in methods]
    notes = [
        "Solving: without fetching the samples, which costs every solver the same.",
        f"The ratio is that time over the time of {_BASELINE} in the same round.",
        *(f"Left out: {name}, which needs {NORMAL_SOLVERS[name].least_lights} lights." for name in refused),
    ]
    return records, _BASELINE, {"table": {"title": title, "columns": columns, "rows": rows}, "notes": notes}


def _row(problem: str, method: str, own: "list[Record]", records: "list[Record]") -> list[str]:
    base = {r.repeat: r.seconds["solve"] for r in records if (r.problem, r.method) == (problem, _BASELINE)}
    seconds = statistics.median(r.seconds["solve"] for r in own)
    ratio = statistics.median(r.seconds["solve"] / base[r.repeat] for r in own)
    errors = [statistics.median(r.error[key] for r in own) for key in ("mean_deg", "median_deg", "max_deg")]
    return [problem, method, f"{seconds:.3f} s", f"{ratio:.1f}", *(f"{error:.2g}°" for error in errors)]
