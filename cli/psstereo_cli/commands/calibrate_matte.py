"""``psstereo calibrate matte``: directions and strengths of lights from matte balls."""

from pathlib import Path
from typing import Annotated

import typer

from psstereo_cli.calibration_options import (
    BallFolders,
    BallOrigin,
    BallWords,
    ByName,
    DarkPicture,
    PinholeMatrix,
    RigOut,
    ToneCurve,
)
from psstereo_cli.options import Json, Overwrite

__all__ = ["calibrate_matte"]


def calibrate_matte(
    folders: BallFolders,
    out: RigOut,
    ball: BallWords = None,
    origin: BallOrigin = "top-left",
    outline: Annotated[
        list[Path] | None,
        typer.Option(help="Picture to whose edges the outline is fitted; one for all, or one a ball."),
    ] = None,
    matrix: PinholeMatrix = None,
    albedo: Annotated[float, typer.Option(help="Albedo of the balls, a factor of all strengths.")] = 1.0,
    pedestal: Annotated[
        str,
        typer.Option(
            help="What is added to the light: common, one level found for all pictures; each, one for each; or the"
            " level as a share of full scale."
        ),
    ] = "common",
    response: ToneCurve = "linear",
    dark: DarkPicture = None,
    by_name: ByName = False,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Find directions and strengths of the lights by the shading of one or several matte balls.

    Example: `psstereo calibrate matte white-ball -o rig.toml --ball auto`

    With the level that the pictures show in the dark: `psstereo calibrate matte sphere -o rig.toml --ball 367,220,80
    --pedestal 0.29`
    """
    from psstereo.calibrate.balls import calibrate_matte_balls
    from psstereo.io.rig_file import RigFile
    from psstereo.io.rig_writer import require_rig_place
    from psstereo_cli.ball_inputs import ball_pictures
    from psstereo_cli.cameras import described_camera, parse_response
    from psstereo_cli.console import progress_bars
    from psstereo_cli.execution import parse_floats
    from psstereo_cli.rig_saving import save_rig

    require_rig_place(out, overwrite=overwrite)
    level = (
        pedestal if pedestal in ("common", "each") else parse_floats(pedestal, 1, "pedestal (common, each, level)")[0]
    )
    curve = parse_response(response)
    camera = described_camera(matrix, None)
    pictures, how = ball_pictures(
        folders,
        ball or [],
        origin=origin,
        outlines=outline or [],
        corners=[],
        camera=camera,
        radius=1.0,
        response=curve,
        dark=dark,
    )
    source = f"shading of {len(pictures)} matte ball{'s' if len(pictures) > 1 else ''}"
    with progress_bars() as progress:
        found = calibrate_matte_balls(pictures, albedo=albedo, pedestal=level, source=source, progress=progress)
    rig = RigFile(
        rig=found.rig,
        names=pictures[0].stack.names if by_name else (),
        camera=camera if matrix is not None else None,
        response=curve,
        quality=found.quality,
        provenance=(*how, *found.notes),
    )
    facts = {
        "ambient": found.ambient.tolist(),
        "ambient_error": found.ambient_error.tolist(),
        "pedestal": None if found.pedestal is None else found.pedestal.tolist(),
        "background": found.background.tolist(),
        "residual": found.residual.tolist(),
    }
    save_rig(out, rig, overwrite=overwrite, as_json=as_json, facts=facts)
