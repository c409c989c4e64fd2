"""A folder with what a suite found: ``bench.json``, the plots and a page with all of it, whole or not at all."""

import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from psstereo.bench.environment import machine, peak_memory, versions
from psstereo.bench.page import bench_page
from psstereo.bench.run import Summary
from psstereo.bench.sweep import Sweep, fit_slope
from psstereo.errors import ExistingResultError, InputError
from psstereo.io.atomic import new_folder

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "BENCH",
    "PAGE",
    "SCHEMA",
    "bench_content",
    "fitted",
    "implied_sweeps",
    "read_bench",
    "require_bench_place",
    "write_bench",
]

BENCH = "bench.json"
PAGE = "report.html"
SCHEMA = 1
"""Number of the present form of ``bench.json``."""

_TYPES = {
    "suite": str,
    "threads": int,
    "repeats": int,
    "rows": list,
    "sweeps": list,
    "slopes": list,
    "facts": dict,
    "versions": dict,
    "machine": dict,
    "files": list,
}
_ROW = {"problem", "method", "seconds", "spread", "ratio", "error", "sizes", "declined"}
_ENDINGS = ("svg", "png")


def fitted(summaries: Sequence[Summary], sweeps: Sequence[Sweep]) -> list[dict[str, Any]]:
    """Fit how time follows what varies.

    Parameters
    ----------
    summaries : sequence of Summary
        What was measured.
    sweeps : sequence of Sweep
        Series among the problems; only those of time count.

    Returns
    -------
    list of dict
        ``title``, ``axis``, ``method``, ``slope`` and its standard error ``error`` (None if unknown) for each method
        that was measured at two or more sizes.
    """
    found = []
    for sweep in sweeps:
        points: dict[str, list[tuple[float, float]]] = {}
        for s in summaries:
            if sweep.measure == "seconds" and s.problem in sweep.values and s.declined is None:
                points.setdefault(s.method, []).append((sweep.values[s.problem], s.seconds))
        for method, line in points.items():
            if len({x for x, _ in line}) > 1:
                slope = fit_slope([x for x, _ in line], [y for _, y in line])
                found.append(
                    {
                        "title": sweep.title,
                        "axis": sweep.axis,
                        "method": method,
                        "slope": slope.slope,
                        "error": _known(slope.error),
                    }
                )
    return found


def implied_sweeps(summaries: Sequence[Summary]) -> list[Sweep]:
    """Return the growth of time with pixels where one method alone was measured on problems of three or more sizes.

    Parameters
    ----------
    summaries : sequence of Summary
        What was measured.
    """
    methods: dict[str, list[Summary]] = {}
    for s in summaries:
        methods.setdefault(s.problem, []).append(s)
    alone: dict[str, dict[str, float]] = {}
    for problem, (first, *others) in methods.items():
        pixels = first.sizes.get("pixels", 0)
        if not others and first.declined is None and pixels > 0:
            alone.setdefault(first.method, {})[problem] = pixels
    return [
        Sweep(title=method, axis="pixels", unit="px", values=values, measure="seconds")
        for method, values in alone.items()
        if len(set(values.values())) >= 3
    ]


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def bench_content(
    suite: str,
    summaries: Sequence[Summary],
    *,
    baseline: str | None,
    threads: int,
    repeats: int,
    sweeps: Sequence[Sweep] = (),
    facts: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Return what the command reports and ``bench.json`` holds.

    Parameters
    ----------
    suite : str
        Name of the suite.
    summaries : sequence of Summary
        What was measured.
    baseline : str or None
        Method to whose time the ratios refer; None for the first of each problem.
    threads, repeats : int
        How it was measured.
    sweeps : sequence of Sweep
        Series among the problems.
    facts : mapping, optional
        What else the suite tells, in types of JSON.

    Returns
    -------
    dict
        In types of JSON; what is unknown is None.
    """
    rows = [asdict(s) | {"seconds": _known(s.seconds), "ratio": _known(s.ratio)} for s in summaries]
    return {
        "schema": SCHEMA,
        "suite": suite,
        "baseline": baseline,
        "threads": threads,
        "repeats": repeats,
        "rows": rows,
        "sweeps": [asdict(sweep) for sweep in sweeps],
        "slopes": fitted(summaries, sweeps),
        "facts": dict(facts or {}),
        "versions": versions(),
        "machine": machine(),
        "memory": peak_memory(),
    }


def read_bench(path: Path) -> dict[str, Any]:
    """Read ``bench.json``.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    dict
        Its content.

    Raises
    ------
    InputError
        If it is none of this schema.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, OSError) as error:
        raise _unreadable(path, str(error)) from None
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        raise _unreadable(path, "it has no schema, or another one")
    wrong = [key for key, kind in _TYPES.items() if not isinstance(content.get(key), kind)]
    wrong += ["memory"] if "memory" not in content else []
    if wrong:
        raise _unreadable(path, f"fields that are missing or wrong: {', '.join(wrong)}")
    if not all(isinstance(row, dict) and set(row) == _ROW for row in content["rows"]):
        raise _unreadable(path, "a row has other fields")
    if not all(isinstance(name, str) and Path(name).name == name for name in content["files"]):
        raise _unreadable(path, "a file that it lists is not in its folder")
    return content


def _unreadable(path: Path, why: str) -> InputError:
    return InputError(
        given=f"{path} does not tell measurements: {why}.",
        needed=f"One JSON object of schema {SCHEMA}, as psstereo bench writes it.",
        remedy="Measure again with this version of the program.",
    )


def require_bench_place(folder: Path, *, overwrite: bool) -> frozenset[str]:
    """Refuse a folder in which something is that nobody asked to replace, before anything is measured.

    Parameters
    ----------
    folder : Path
        Where the plots are to go.
    overwrite : bool
        Whether the plots of an earlier run may be replaced.

    Returns
    -------
    frozenset of str
        Files of the earlier run, which will go; empty for a new folder.

    Raises
    ------
    ExistingResultError
        If it is a file, holds anything but the files of an earlier run, or holds these and `overwrite` is False.
    """
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return frozenset()
    try:
        names = frozenset(read_bench(folder / BENCH)["files"])
    except InputError:
        names = frozenset()
    if not folder.is_dir() or not names or any(path.name not in names for path in folder.iterdir()):
        raise ExistingResultError(
            given=f"{folder} {'holds what no benchmark has written' if folder.is_dir() else 'is a file'}.",
            needed="A new folder, or one with the plots of an earlier run and nothing else.",
            remedy="Choose another folder with --plots.",
        )
    if not overwrite:
        raise ExistingResultError(
            given=f"{folder} holds the plots of an earlier run.",
            needed="They are not replaced without being asked for.",
            remedy="Add --overwrite, or choose another folder with --plots.",
        )
    return frozenset(path.name for path in folder.iterdir())


def write_bench(
    folder: Path,
    content: Mapping[str, Any],
    figures: "Mapping[str, Figure]",
    *,
    command: str | None = None,
    overwrite: bool = False,
) -> list[str]:
    """Write ``bench.json``, the figures as SVG and PNG, and the page; the folder appears whole or not at all.

    Parameters
    ----------
    folder : Path
        Where to.
    content : mapping
        Of :func:`bench_content`.
    figures : mapping
        Figures by name of file, without ending.
    command : str, optional
        By which anyone measures it again, for the page.
    overwrite : bool
        Whether the plots of an earlier run may be replaced.

    Returns
    -------
    list of str
        Names of the files.

    Raises
    ------
    ExistingResultError
        If something is in the way.
    UnreadableFileError
        If the folder cannot be made.
    """
    earlier = require_bench_place(folder, overwrite=overwrite)
    files = [BENCH, PAGE, *(f"{name}.{ending}" for name in figures for ending in _ENDINGS)]
    with new_folder(folder, overwrite=overwrite, names=earlier) as work:
        text = json.dumps({**content, "files": files}, ensure_ascii=False, indent=1, allow_nan=False)
        (work / BENCH).write_text(text + "\n", encoding="utf-8")
        plots = {name: _save(figure, work / name) for name, figure in figures.items()}
        (work / PAGE).write_text(bench_page(content, plots, command=command), encoding="utf-8")
    return files


def _save(figure: "Figure", stem: Path) -> str:
    """Save a figure so that the same measurements give the same bytes: no date, and names from a fixed seed.

    Return it as SVG for a page: with letters as letters, which take less room than outlines.
    """
    import matplotlib as mpl

    with mpl.rc_context({"svg.hashsalt": "psstereo", "svg.fonttype": "path"}):
        figure.savefig(stem.with_suffix(".svg"), metadata={"Date": None})
        figure.savefig(stem.with_suffix(".png"), dpi=150)
    text = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": "psstereo", "svg.fonttype": "none"}):
        figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()
