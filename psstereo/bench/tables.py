"""What a suite found as tables and sentences, for a terminal or a page: a table a suite, one a series, who declined."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from psstereo.bench.front import ERRORS, error_key
from psstereo.bench.run import Summary
from psstereo.bench.sweep import Sweep

__all__ = ["Decline", "Table", "declines_of", "remarks_of", "summaries_of", "sweeps_of", "tables_of"]

_ERRORS = {
    "mean_deg": ("mean", "°"),
    "median_deg": ("median", "°"),
    "max_deg": ("largest", "°"),
    "rmse": ("rms height", " px"),
}
"""Errors that have a column, with its heading and the unit."""


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table of words.

    Attributes
    ----------
    title : str
        What it shows.
    columns : tuple of str
        Headings.
    rows : tuple of tuples of str
        Cells, as many as headings; the first names the row.
    note : str
        How to read it; empty if it needs no word.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class Decline:
    """That a method would not take some problems.

    Attributes
    ----------
    method : str
        Its name.
    problems : tuple of str
        Which problems.
    reason : str
        Why.
    """

    method: str
    problems: tuple[str, ...]
    reason: str


def summaries_of(content: Mapping[str, Any]) -> list[Summary]:
    """Return the measurements of ``bench.json``, as :func:`psstereo.bench.folder.bench_content` put them together."""
    unknown = {"seconds": math.nan, "ratio": math.nan}
    return [Summary(**{**row, **{key: unknown[key] for key in unknown if row[key] is None}}) for row in content["rows"]]


def sweeps_of(content: Mapping[str, Any]) -> list[Sweep]:
    """Return the series of ``bench.json``."""
    return [Sweep(**sweep) for sweep in content["sweeps"]]


def tables_of(content: Mapping[str, Any]) -> list[Table]:
    """Return every table of a run.

    Parameters
    ----------
    content : mapping
        Of :func:`psstereo.bench.folder.bench_content`.

    Returns
    -------
    list of Table
        The suite's own, or one with the problems that belong to no series; then one a series.
    """
    summaries, sweeps, suite = summaries_of(content), sweeps_of(content), content["suite"]
    own = content["facts"].get("table")
    if own is not None:
        title = f"suite {suite}: {own['title']}"
        tables = [Table(title=title, columns=tuple(own["columns"]), rows=tuple(tuple(row) for row in own["rows"]))]
    else:
        tables = _problems(content, summaries, sweeps)
    found = (_series(suite, sweep, summaries, content["slopes"]) for sweep in sweeps)
    return tables + [table for table in found if table is not None]


def declines_of(content: Mapping[str, Any]) -> list[Decline]:
    """Return who declined and why, a reason once a method.

    Parameters
    ----------
    content : mapping
        Of :func:`psstereo.bench.folder.bench_content`.
    """
    reasons: dict[tuple[str, str], list[str]] = {}
    for row in content["rows"]:
        if row["declined"] is not None:
            reasons.setdefault((row["method"], row["declined"]), []).append(row["problem"])
    return [Decline(method=m, problems=tuple(problems), reason=why) for (m, why), problems in reasons.items()]


def remarks_of(content: Mapping[str, Any]) -> list[str]:
    """Return what the suite has to say besides, and what the suite reading is after.

    Parameters
    ----------
    content : mapping
        Of :func:`psstereo.bench.folder.bench_content`.

    Returns
    -------
    list of str
        Sentences.
    """
    facts, baseline = content["facts"], content["baseline"]
    said = [str(note) for note in facts.get("notes", ())]
    times = {row["method"]: row["seconds"] for row in content["rows"]}
    for method in ("command, normals only", "command, with depth and mesh"):
        if baseline is not None and method in times:
            said.append(f"{method}: decoding + {times[method] - times[baseline]:.2f} s")
    for name, grown in facts.get("memory", {}).items():
        if grown["grown"] is not None:
            said.append(
                f"memory grown, samples {name}: {grown['grown'] / 1e6:.0f} MB,"
                f" {grown['grown_over_samples']:.2f} of the masked stack as float32"
            )
    return said


def _problems(content: Mapping[str, Any], summaries: Sequence[Summary], sweeps: Sequence[Sweep]) -> list[Table]:
    """Return the table of the problems that belong to no series."""
    varied = {problem for sweep in sweeps for problem in sweep.values}
    own = [s for s in summaries if s.problem not in varied]
    if not own:
        return []
    errors = [key for key in _ERRORS if any(key in s.error for s in own)]
    rows = []
    for s in own:
        if s.declined is not None:
            rows.append((s.problem, s.method, "declined", "", *("" for _ in errors)))
            continue
        shown = (f"{s.error[key]:.3g}{_ERRORS[key][1]}" if key in s.error else "" for key in errors)
        rows.append((s.problem, s.method, _time(s), _ratio(s.ratio), *shown))
    baseline = content["baseline"]
    spread = "Time: median" + (", ± half the distance between its quartiles." if any(s.spread for s in own) else ".")
    base = "the first method of the problem" if baseline is None else f"«{baseline}»"
    how = f"medians of {content['repeats']} rounds on {content['threads']} threads"
    return [
        Table(
            title=f"suite {content['suite']}: {how}",
            columns=("problem", "method", "time", "ratio", *(_ERRORS[key][0] for key in errors)),
            rows=tuple(rows),
            note=f"{spread} The ratio is the time over that of {base} in the same round.",
        )
    ]


def _time(s: Summary) -> str:
    milliseconds = s.seconds * 1e3
    return f"{milliseconds:.1f} ms" + (f" ± {s.spread * 5e2:.1f}" if s.spread else "")


def _ratio(ratio: float) -> str:
    return "" if math.isnan(ratio) else f"{ratio:.3f}"


def _series(
    suite: str, sweep: Sweep, summaries: Sequence[Summary], slopes: Sequence[Mapping[str, Any]]
) -> Table | None:
    """Return errors, or times with the fitted slope, over what varies; None if there are no errors to show."""
    own = [s for s in summaries if s.problem in sweep.values]
    key = None if sweep.measure == "seconds" else error_key(own)
    if key is None and sweep.measure == "error":
        return None
    what, unit = ("time", "ms") if key is None else ERRORS[key]
    fitted = {one["method"]: one for one in slopes if (one["title"], one["axis"]) == (sweep.title, sweep.axis)}
    order = sorted(sweep.values, key=lambda problem: sweep.values[problem])
    cells = {(s.method, s.problem): _cell(s, key) for s in own}
    rows = []
    for method in dict.fromkeys(s.method for s in own):
        row = [method, *(cells.get((method, problem), "") for problem in order)]
        if key is None:
            row.append(_slope(fitted.get(method)))
        rows.append(tuple(row))
    columns = [f"{sweep.values[problem]:.6g}" for problem in order]
    # In words, since a terminal's table takes what stands in brackets in a title for markup.
    along = sweep.axis + (f" in {sweep.unit}" if sweep.unit else "")
    title = f"suite {suite}: {sweep.title}: {what}{'' if unit == '1' else f' in {unit}'} by {along}"
    return Table(title=title, columns=("method", *columns, *(["slope"] if key is None else [])), rows=tuple(rows))


def _cell(s: Summary, key: str | None) -> str:
    if s.declined is not None:
        return "declined"
    if key is None:
        return f"{s.seconds * 1e3:.3g}"
    return f"{s.error[key]:.2g}" if key in s.error else ""


def _slope(found: Mapping[str, Any] | None) -> str:
    if found is None:
        return ""
    return f"{found['slope']:.2f}" + ("" if found["error"] is None else f" ± {found['error']:.2f}")
