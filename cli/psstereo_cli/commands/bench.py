"""``psstereo bench``: error against run time, whether error bars hold, and what reading and rendering cost."""

from pathlib import Path
from typing import Annotated, Any

import typer

from psstereo_cli.options import Json, Overwrite, Threads
from psstereo_cli.suites.catalogue import SUITES, TAKE_A_FOLDER, suite_named

__all__ = ["bench"]


def bench(
    suite: Annotated[
        str,
        typer.Argument(help="; ".join(f"{name}: {what}" for name, what in SUITES.items()) + "."),
    ] = "accuracy",
    repeats: Annotated[int, typer.Option(min=1, max=100, help="Rounds; medians are reported.")] = 5,
    size: Annotated[
        str | None,
        typer.Option(help="Size of the images, WIDTHxHEIGHT; that of the suite if not given."),
    ] = None,
    lights: Annotated[
        int, typer.Option(min=3, max=500, help="Images of the suites reading, forward and solvers.")
    ] = 96,
    folder: Annotated[
        Path | None,
        typer.Option(
            help="Folder with data of your own to measure on too: normal maps with true depth for suite depth, captures"
            " for suite sfs."
        ),
    ] = None,
    threads: Threads = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="File for the records, one JSON object a line.")
    ] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Measure, and print medians and ratios within this one run.

    Example: `psstereo bench reading --repeats 7`
    """
    from psstereo.bench import summarise, write_records
    from psstereo_cli.console import print_json, progress_bars
    from psstereo_cli.execution import available_threads, threaded

    run = suite_named(suite)
    more = _data(suite, folder)
    if out is not None:
        _require_place(out, overwrite=overwrite)
    count = threads or available_threads()
    with threaded(count) as over, progress_bars() as progress:
        records, baseline, facts = run(repeats, size, lights, count, over, progress, **more)
    summaries = summarise(records, baseline)
    if out is not None:
        write_records(out, records)
    if as_json:
        rows = [
            {"problem": s.problem, "method": s.method, "seconds": s.seconds, "ratio": s.ratio, "error": dict(s.error)}
            for s in summaries
        ]
        print_json({"suite": suite, "baseline": baseline, "threads": count, "repeats": repeats, "rows": rows, **facts})
        return
    _print(suite, baseline, summaries, facts, count, repeats)


def _data(suite: str, folder: Path | None) -> dict[str, Path]:
    """Return the folder as an argument for the suite, if one was named."""
    from psstereo.errors import OptionError

    if folder is None:
        return {}
    if suite not in TAKE_A_FOLDER:
        raise OptionError(
            given=f"The suite {suite} was given a folder.",
            needed=f"Only {', '.join(sorted(TAKE_A_FOLDER))} measure on data of your own.",
            remedy="Leave --folder out.",
        )
    return {"folder": folder}


def _require_place(out: Path, *, overwrite: bool) -> None:
    """Refuse a file that cannot be written, before anything is measured."""
    from psstereo.errors import ExistingResultError, MissingFileError

    if out.is_file() and not overwrite:
        raise ExistingResultError(
            given=f"{out} exists.",
            needed="It is not replaced without being asked for.",
            remedy="Add --overwrite, or choose another name with -o.",
        )

    if out.is_dir() or not out.absolute().parent.is_dir():
        raise MissingFileError(
            given=f"{out} {'is a folder' if out.is_dir() else 'lies in a folder that does not exist'}.",
            needed="A file for the records, in a folder that exists.",
            remedy="Choose another name with -o.",
        )


def _print(suite: str, baseline: str, summaries: Any, facts: dict[str, Any], threads: int, repeats: int) -> None:
    from psstereo_cli.console import print_table, say

    if "table" in facts:
        table = facts["table"]
        print_table(f"suite {suite}: {table['title']}", [tuple(row) for row in table["rows"]], tuple(table["columns"]))
        for note in facts["notes"]:
            say(note)
        return
    errors = ("mean_deg", "median_deg", "max_deg")
    rows = [
        (
            s.problem,
            s.method,
            f"{s.seconds * 1e3:.1f} ms",
            f"{s.ratio:.3f}",
            *(f"{s.error[k]:.3g}°" for k in errors if s.error),
        )
        for s in summaries
    ]
    with_error = any(s.error for s in summaries)
    columns = ("problem", "method", "time", "ratio", *(("mean", "median", "largest") if with_error else ()))
    print_table(f"suite {suite}: medians of {repeats} rounds on {threads} threads", rows, columns)
    say(f"The ratio is the time over that of «{baseline}» in the same round.")
    for note in facts.get("notes", ()):
        say(note)
    times = {s.method: s.seconds for s in summaries}
    for method in ("command, normals only", "command, with depth and mesh"):
        if method in times:
            say(f"{method}: decoding + {times[method] - times[baseline]:.2f} s")
    for name, grown in facts.get("memory", {}).items():
        if grown["grown"] is not None:
            say(
                f"memory grown, samples {name}: {grown['grown'] / 1e6:.0f} MB,"
                f" {grown['grown_over_samples']:.2f} of the masked stack as float32"
            )
