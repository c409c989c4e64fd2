"""``psstereo calibrate object``: strengths and directions of lights from the object itself."""

from pathlib import Path
from typing import Annotated

import typer

from psstereo_cli.calibration_options import RigOut
from psstereo_cli.options import Format, Json, Lights, LightsLayout, Mask, Overwrite, Threads

__all__ = ["calibrate_object"]


def calibrate_object(
    folder: Annotated[Path, typer.Argument(help="Capture: images and nominal lights.")],
    out: RigOut,
    layout: Format = None,
    lights: Lights = None,
    lights_layout: LightsLayout = None,
    mask: Mask = None,
    strengths: Annotated[bool, typer.Option("--strengths/--no-strengths", help="Whether strengths are found.")] = True,
    refine: Annotated[bool, typer.Option("--refine", help="Refine the directions too.")] = False,
    doubt: Annotated[
        float, typer.Option(help="How far directions may be off, in degrees, as a standard deviation; with --refine.")
    ] = 3.0,
    gray: Annotated[
        str, typer.Option(help="How channels become one: mean, r, g, b, bt601, bt709, or weights.")
    ] = "mean",
    threads: Threads = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Find strengths of lights, and refine their directions, from an object of unknown shape.

    Example: `psstereo calibrate object photos -o rig.toml --refine`
    """
    import numpy as np

    from psstereo.calibrate.object_lights import calibrate_from_object
    from psstereo.io.rig_file import RigFile
    from psstereo.io.rig_writer import require_rig_place
    from psstereo_cli.console import progress_bars
    from psstereo_cli.execution import available_threads, parse_floats, threaded
    from psstereo_cli.loading import load_capture
    from psstereo_cli.rig_saving import save_rig

    require_rig_place(out, overwrite=overwrite)
    if doubt != 3.0 and not refine:
        raise typer.BadParameter(
            "directions are in doubt only where they are found; add --refine", param_hint="--doubt"
        )
    weights = parse_floats(gray, None, "gray") if "," in gray else gray
    with progress_bars() as progress, threaded(threads or available_threads()) as over:
        capture, _ = load_capture(
            folder, layout=layout, lights=lights, lights_layout=lights_layout, mask=mask, truth=False, over=over,
            progress=progress,
        )  # fmt: skip
        found = calibrate_from_object(
            capture, strengths=strengths, directions=refine, doubt=float(np.radians(doubt)), gray=weights, over=over,
            progress=progress,
        )  # fmt: skip
    steps = [one.step for one in (found.strengths, found.directions) if one is not None]
    rig = RigFile(
        rig=found.rig,
        names=capture.stack.names,
        response=capture.response,
        quality=found.quality,
        provenance=(f"From the object of {folder.name} and {capture.rig.source}.", *(one.reason for one in steps)),
    )
    settled = all(one.outcome.converged for one in (found.strengths, found.directions) if one is not None)
    save_rig(out, rig, overwrite=overwrite, as_json=as_json, facts={"settled": settled})
    if not settled:
        from psstereo_cli.failure import NOT_CONVERGED

        raise typer.Exit(NOT_CONVERGED)
