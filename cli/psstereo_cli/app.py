"""The command's entry: its list of commands, and what an error looks like."""

import os
import signal
import sys
from types import FrameType
from typing import Annotated, NoReturn

import typer

from psstereo_cli.commands.bench import bench
from psstereo_cli.commands.calibrate import calibrate
from psstereo_cli.commands.convert import convert
from psstereo_cli.commands.demo import demo
from psstereo_cli.commands.evaluate import evaluate
from psstereo_cli.commands.info import info
from psstereo_cli.commands.integrate import integrate
from psstereo_cli.commands.match import match
from psstereo_cli.commands.plan import plan
from psstereo_cli.commands.reconstruct import reconstruct
from psstereo_cli.commands.rig import rig
from psstereo_cli.commands.sfs import sfs
from psstereo_cli.commands.solvers import solvers
from psstereo_cli.commands.synth import synth
from psstereo_cli.commands.terrain import terrain
from psstereo_cli.failure import report_failure

__all__ = ["app", "main"]

app = typer.Typer(
    name="psstereo",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="From photographs under several lights to normals, albedo, depth and mesh.\n\n"
    "Start with `psstereo demo`, then `psstereo reconstruct FOLDER -o OUT`.",
)

app.command()(reconstruct)
app.command()(plan)
app.command()(integrate)
app.command()(sfs)
app.command()(terrain)
app.command()(evaluate)
app.command()(info)
app.command()(solvers)
app.add_typer(calibrate, name="calibrate")
app.command()(rig)
app.command()(convert)
app.command()(match)
app.command()(synth)
app.command()(demo)
app.command()(bench)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"psstereo {version('psstereo')}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """Take options that belong to no command."""


def _terminate(_number: int, _frame: FrameType | None) -> NoReturn:
    """Turn a polite request to end into an exception, so that half-written folders are removed."""
    raise SystemExit(143)


def main() -> None:
    """Run the command: exit code 0 fine, 2 usage, 3 the input cannot be used, 4 finished but not converged."""
    signal.signal(signal.SIGTERM, _terminate)
    os.environ.setdefault("OPENCV_LOG_LEVEL", "OFF")  # a damaged file gets one message, ours
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(130)
    except Exception as error:
        sys.exit(report_failure(error, as_json="--json" in sys.argv))
