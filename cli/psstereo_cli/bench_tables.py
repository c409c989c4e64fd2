"""What ``psstereo bench`` prints: a table a suite, one a series of problems, and who declined."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from psstereo_cli.console import print_table, say

if TYPE_CHECKING:
    from psstereo.bench import Summary
    from psstereo.bench.sweep import Sweep

__all__ = ["print_bench"]

_ERRORS = {
    "mean_deg": ("mean", "°"),
    "median_deg": ("median", "°"),
    "max_deg": ("largest", "°"),
    "rmse": ("rms height", " px"),
}
"""Errors that have a column, with its heading and the unit."""


def print_bench(
    suite: str,
    baseline: str | None,
    summaries: "Sequence[Summary]",
    facts: Mapping[str, Any],
    *,
    sweeps: "Sequence[Sweep]",
    threads: int,
    repeats: int,
) -> None:
    """Print what a suite found.

    Parameters
    ----------
    suite : str
        Its name.
    baseline : str or None
        Method to whose time the ratios refer; None for the first of each problem.
    summaries : sequence of Summary
        What was measured.
    facts : mapping
        What the suite has to say besides: perhaps a table of its own, notes, memory.
    sweeps : sequence of Sweep
        Series that get a table each.
    threads, repeats : int
        How it was measured.
    """
    if "table" in facts:
        table = facts["table"]
        print_table(f"suite {suite}: {table['title']}", [tuple(row) for row in table["rows"]], tuple(table["columns"]))
    else:
        _print_summaries(suite, baseline, summaries, sweeps, f"medians of {repeats} rounds on {threads} threads")
    for sweep in sweeps:
        _print_sweep(suite, sweep, summaries)
    _print_declines(summaries)
    for note in facts.get("notes", ()):
        say(note)
    _print_reading(summaries, baseline, facts)


def _print_summaries(
    suite: str, baseline: str | None, summaries: "Sequence[Summary]", sweeps: "Sequence[Sweep]", how: str
) -> None:
    """Print the problems that belong to no series."""
    varied = {problem for sweep in sweeps for problem in sweep.values}
    own = [s for s in summaries if s.problem not in varied]
    if not own:
        return
    errors = [key for key in _ERRORS if any(key in s.error for s in own)]
    rows = []
    for s in own:
        if s.declined is not None:
            rows.append((s.problem, s.method, "declined", "", *("" for _ in errors)))
            continue
        shown = (f"{s.error[key]:.3g}{_ERRORS[key][1]}" if key in s.error else "" for key in errors)
        rows.append((s.problem, s.method, _time(s), _ratio(s.ratio), *shown))
    columns = ("problem", "method", "time", "ratio", *(_ERRORS[key][0] for key in errors))
    print_table(f"suite {suite}: {how}", rows, columns)
    spread = "Time: median" + (", ± half the distance between its quartiles." if any(s.spread for s in own) else ".")
    base = "the first method of the problem" if baseline is None else f"«{baseline}»"
    say(f"{spread} The ratio is the time over that of {base} in the same round.")


def _time(s: "Summary") -> str:
    milliseconds = s.seconds * 1e3
    return f"{milliseconds:.1f} ms" + (f" ± {s.spread * 5e2:.1f}" if s.spread else "")


def _ratio(ratio: float) -> str:
    return "" if math.isnan(ratio) else f"{ratio:.3f}"


def _print_sweep(suite: str, sweep: "Sweep", summaries: "Sequence[Summary]") -> None:
    """Print errors, or times with the fitted slope, over what varies."""
    from psstereo.bench.folder import fitted
    from psstereo.bench.front import ERRORS, error_key

    own = [s for s in summaries if s.problem in sweep.values]
    key = None if sweep.measure == "seconds" else error_key(own)
    if key is None and sweep.measure == "error":
        return
    what, unit = ("time", "ms") if key is None else ERRORS[key]
    slopes = {found["method"]: found for found in fitted(own, [sweep])}
    order = sorted(sweep.values, key=lambda problem: sweep.values[problem])
    cells = {(s.method, s.problem): _cell(s, key) for s in own}
    rows = []
    for method in dict.fromkeys(s.method for s in own):
        row = [method, *(cells.get((method, problem), "") for problem in order)]
        if key is None:
            row.append(_slope(slopes.get(method)))
        rows.append(tuple(row))
    columns = [f"{sweep.values[problem]:.6g}" for problem in order]
    # In words, since a table's title takes what stands in brackets for markup.
    along = sweep.axis + (f" in {sweep.unit}" if sweep.unit else "")
    title = f"suite {suite}: {sweep.title}: {what}{'' if unit == '1' else f' in {unit}'} by {along}"
    print_table(title, rows, ("method", *columns, *(["slope"] if key is None else [])))


def _cell(s: "Summary", key: str | None) -> str:
    if s.declined is not None:
        return "declined"
    if key is None:
        return f"{s.seconds * 1e3:.3g}"
    return f"{s.error[key]:.2g}" if key in s.error else ""


def _slope(found: Mapping[str, Any] | None) -> str:
    if found is None:
        return ""
    return f"{found['slope']:.2f}" + ("" if found["error"] is None else f" ± {found['error']:.2f}")


def _print_declines(summaries: "Sequence[Summary]") -> None:
    """Say who declined and why, a reason once a method."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for s in summaries:
        if s.declined is not None:
            reasons.setdefault((s.method, s.declined), []).append(s.problem)
    for (method, why), problems in reasons.items():
        where = ", ".join(problems[:3]) + (" …" if len(problems) > 3 else "")
        say(f"{method} declined ({where}): {why}")


def _print_reading(summaries: "Sequence[Summary]", baseline: str | None, facts: Mapping[str, Any]) -> None:
    """Say what the suite reading is after: what the command adds to decoding, and how much memory it takes."""
    times = {s.method: s.seconds for s in summaries}
    for method in ("command, normals only", "command, with depth and mesh"):
        if baseline is not None and method in times:
            say(f"{method}: decoding + {times[method] - times[baseline]:.2f} s")
    for name, grown in facts.get("memory", {}).items():
        if grown["grown"] is not None:
            say(
                f"memory grown, samples {name}: {grown['grown'] / 1e6:.0f} MB,"
                f" {grown['grown_over_samples']:.2f} of the masked stack as float32"
            )
