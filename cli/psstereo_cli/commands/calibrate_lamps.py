"""``psstereo calibrate lamps``: axis, lobe and flux of lamps from a matte chessboard in a few poses."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from psstereo_cli.calibration_options import RigOut
from psstereo_cli.options import Json, Overwrite

if TYPE_CHECKING:
    from psstereo.calibrate.lamps import Chessboard, PlaneSamples
    from psstereo.camera import Pinhole
    from psstereo.types import FloatArray, Progress

__all__ = ["calibrate_lamps"]

_WHITE = 0.98
"""Share of full scale from which a value counts as clipped."""


def calibrate_lamps(
    poses: Annotated[
        list[Path],
        typer.Argument(help="One folder a pose of the board, each with one image a lamp, in the order of the lamps."),
    ],
    out: RigOut,
    positions: Annotated[
        Path,
        typer.Option(
            help="Where the lamps are: a text file with x y z a line, x right, y up, z toward the camera, which is at"
            " 0 0 0, in the unit of --square; or a rig file of lamps."
        ),
    ],
    matrix: Annotated[str, typer.Option("--K", help="File with the 3 × 3 matrix, or fx,fy,cx,cy,skew in pixels.")],
    board: Annotated[str, typer.Option(help="Inner corners of the chessboard, such as 9x6.")] = "9x6",
    square: Annotated[float, typer.Option(help="Side of a square, in mm or any unit of length.")] = 25.0,
    albedo: Annotated[
        float | None, typer.Option(help="Albedo of the board's white, 0 to 1; fluxes are relative without it.")
    ] = None,
    refine: Annotated[bool, typer.Option("--refine", help="Let brightness move the lamps too.")] = False,
    same_mu: Annotated[bool, typer.Option("--same-mu", help="All lamps are of one make, with one exponent.")] = False,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Find axes, lobes and fluxes of lamps from a matte chessboard.

    Example: `psstereo calibrate lamps pose1 pose2 pose3 -o rig.toml --positions lamps.txt --K K.txt --square 20`
    """
    import numpy as np

    from psstereo.calibrate.lamps import Chessboard, joined
    from psstereo.calibrate.lamps import calibrate_lamps as calibrated
    from psstereo.io.camera_file import parse_camera
    from psstereo.io.rig_file import RigFile
    from psstereo.io.rig_writer import require_rig_place
    from psstereo_cli.calibration_options import parse_board
    from psstereo_cli.console import progress_bars
    from psstereo_cli.rig_saving import save_rig

    require_rig_place(out, overwrite=overwrite)
    counted = "The number of inner corners along its two sides, such as 9x6."
    columns, rows = parse_board(board, needed=counted, remedy="Count the corners where four squares meet.")
    camera, target = parse_camera(matrix), Chessboard(columns=columns, rows=rows, square=square)
    places = _positions(positions)
    with progress_bars() as progress:
        parts = [_pose(folder, k, len(places), camera, target, progress) for k, folder in enumerate(poses)]
        found = calibrated(
            [joined([one[k] for one in parts]) for k in range(len(places))],
            places,
            brdf=1.0 if albedo is None else albedo / np.pi,
            refine_positions=refine,
            same_mu=same_mu,
            progress=progress,
        )
    rig = RigFile(
        rig=found.rig,
        camera=camera,
        quality=found.quality,
        provenance=(
            f"From a chessboard of {board} inner corners, squares of {square:g}, in {len(poses)} poses"
            f" ({', '.join(folder.name for folder in poses)}); positions from {positions.name}.",
        ),
    )
    facts = {
        "mu_error": [fit.mu_error for fit in found.fits],
        "samples": [fit.used for fit in found.fits],
        "residual_percent_of_each": [100.0 * fit.residual for fit in found.fits],
    }
    save_rig(out, rig, overwrite=overwrite, as_json=as_json, facts=facts)


def _positions(path: Path) -> "FloatArray":
    """Return the lamps' positions (m, 3) from a table or a rig file."""
    import numpy as np

    from psstereo.errors import InputError
    from psstereo.io.rig_file import is_rig_file, read_rig
    from psstereo.io.text import read_table
    from psstereo.lights import Led

    if is_rig_file(path):
        lamps = [light.position for light in read_rig(path).rig.lights if isinstance(light, Led)]
        table: FloatArray = np.array(lamps, np.float64).reshape(-1, 3)
    else:
        table = read_table(path).values
    if table.ndim != 2 or table.shape[1:] != (3,) or not len(table):
        raise InputError(
            given=f"{path.name} holds numbers of the shape {table.shape}.",
            needed="x y z of one lamp a line.",
            remedy="Write them in the camera's frame: x right, y up, z toward the camera.",
        )
    return table


def _pose(
    folder: Path, number: int, lamps: int, camera: "Pinhole", board: "Chessboard", progress: "Progress"
) -> "tuple[PlaneSamples, ...]":
    """Return the samples of one pose, one set a lamp."""
    import numpy as np

    from psstereo.calibrate.lamps import board_samples
    from psstereo.errors import InputError
    from psstereo.stack.linear import linear_frame
    from psstereo_cli.loading import load_capture

    capture, _ = load_capture(
        folder,
        layout=None,
        lights=None,
        unknown_lights=True,
        lights_layout=None,
        mask="none",
        truth=False,
        progress=progress,
    )
    if len(capture.stack) != lamps:
        raise InputError(
            given=f"{folder.name} has {len(capture.stack)} images; there are {lamps} lamps.",
            needed="One image a lamp in every pose, in the order of the lamps.",
            remedy="Remove other images from the folder, or correct the list of positions.",
        )
    white, frames = capture.stack.white, []
    for k in range(lamps):
        progress(f"pose {folder.name}", k, lamps)
        raw = capture.stack.frame(k)
        light = linear_frame(capture.stack, k, response=capture.response, dark=capture.dark, flat=capture.flat) / white
        clipped = (np.asarray(raw, np.float64) >= _WHITE * white).any(axis=2, keepdims=True)
        frames.append(np.where(clipped & capture.stack.saturates, np.nan, light.astype(np.float64)))
    samples = board_samples(np.stack(frames), camera, board, pose=number, name=folder.name)
    progress(f"pose {folder.name}", lamps, lamps)
    return samples
