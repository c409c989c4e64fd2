"""``psstereo bench``: error against run time as tables, records and plots."""

from pathlib import Path
from typing import Annotated

import typer

from psstereo_cli.options import Json, Overwrite, Threads
from psstereo_cli.suites.catalogue import SUITES, TAKE_A_FOLDER, suite_named

__all__ = ["bench"]

_LIGHTS = 96


def bench(
    suite: Annotated[
        str | None,
        typer.Argument(help="; ".join(f"{name}: {what}" for name, what in SUITES.items()) + ". Default: accuracy."),
    ] = None,
    named: Annotated[str | None, typer.Option("--suite", help="The suite, as an option.")] = None,
    repeats: Annotated[int, typer.Option(min=1, max=100, help="Rounds; medians are reported.")] = 5,
    size: Annotated[
        str | None,
        typer.Option(help="Size of the images, WIDTHxHEIGHT; that of the suite if not given."),
    ] = None,
    lights: Annotated[
        int, typer.Option(min=3, max=500, help="Images of the suites reading, forward, solvers and normals.")
    ] = _LIGHTS,
    folder: Annotated[
        Path | None,
        typer.Option(
            help="Folder with data of your own to measure on too: normal maps with true depth for suite depth, captures"
            " for suite sfs, captures with true normals for suites photographs and planner."
        ),
    ] = None,
    threads: Threads = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="File for the records, one JSON object a line.")
    ] = None,
    plots: Annotated[
        Path | None,
        typer.Option(
            help="Folder for bench.json, plots (SVG and PNG: error against time and what varies, growth), and"
            " report.html with all of it."
        ),
    ] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Measure, and print medians and ratios within this one run.

    Example: `psstereo bench reading --repeats 7`

    Example: `psstereo bench normals --plots plots`
    """
    from psstereo.bench import summarise, write_records
    from psstereo.bench.folder import bench_content, implied_sweeps, require_bench_place, write_bench
    from psstereo_cli.bench_tables import print_bench
    from psstereo_cli.console import print_json, progress_bars, say
    from psstereo_cli.execution import available_threads, threaded

    chosen = _one_name(suite, named)
    run = suite_named(chosen)
    more = _data(chosen, folder)
    if out is not None:
        _require_place(out, overwrite=overwrite)
    if plots is not None:
        require_bench_place(plots, overwrite=overwrite)
    count = threads or available_threads()
    with threaded(count) as over, progress_bars() as progress:
        records, baseline, facts = run(repeats, size, lights, count, over, progress, **more)
    summaries = summarise(records, baseline)
    sweeps = facts.pop("sweeps", []) or implied_sweeps(summaries)
    if out is not None:
        write_records(out, records)
    content = bench_content(
        chosen, summaries, baseline=baseline, threads=count, repeats=repeats, sweeps=sweeps, facts=facts
    )
    files: list[str] = []
    if plots is not None:
        from psstereo.bench.plots import draw

        command = _command(chosen, repeats, size, lights, folder, count)
        files = write_bench(plots, content, draw(chosen, summaries, sweeps), command=command, overwrite=overwrite)
    if as_json:
        del content["facts"]
        print_json({**content, "repeats": repeats, **facts, **({"files": files} if files else {})})
        return
    print_bench(content)
    if files:
        say(f"Written to {plots}: {', '.join(files)}")


def _command(suite: str, repeats: int, size: str | None, lights: int, folder: Path | None, threads: int) -> str:
    """Return the command by which anyone measures the same again; it names no place on this machine."""
    words = ["psstereo bench", suite, f"--repeats {repeats}", f"--threads {threads}"]
    words += [] if size is None else [f"--size {size}"]
    words += [] if lights == _LIGHTS else [f"--lights {lights}"]
    words += [] if folder is None else ["--folder DATA"]
    return " ".join([*words, "--plots FOLDER"])


def _one_name(argument: str | None, option: str | None) -> str:
    """Return the suite that was asked for, by word or by option."""
    from psstereo.errors import OptionError

    if argument is not None and option is not None and argument != option:
        raise OptionError(
            given=f"Two suites are named, {argument} and {option}.",
            needed="One suite a run, since ratios hold within one.",
            remedy="Leave one of them out.",
        )
    return argument or option or "accuracy"


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
