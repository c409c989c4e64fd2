"""``psstereo calibrate lens``: the camera's matrix and distortion from pictures of a board."""

from pathlib import Path
from typing import Annotated

import typer

from psstereo_cli.options import Json, Overwrite

__all__ = ["calibrate_lens"]


def calibrate_lens(
    pictures: Annotated[list[Path], typer.Argument(help="Pictures of the board, of different tilts; ten are good.")],
    board: Annotated[str, typer.Option(help="Squares of the board, not inner corners: 9x7.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="File to write, .toml: the camera and its lens.")],
    marker: Annotated[
        float | None,
        typer.Option(
            min=0.0, help="ChArUco: side of a marker over that of a square, such as 0.75; none: a chessboard."
        ),
    ] = None,
    dictionary: Annotated[str, typer.Option(help="ChArUco: OpenCV's dictionary of the markers.")] = "4X4_50",
    model: Annotated[
        str, typer.Option(help="Coefficients: k1, k1k2, standard (k1 k2 p1 p2 k3), or rational for wide angles.")
    ] = "standard",
    add_to: Annotated[
        Path | None, typer.Option("--add-to", help="Rig file that is to know camera and lens; it is written anew.")
    ] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Find focal length, principal point and distortion.

    Example: `psstereo calibrate lens board_*.jpg --board 9x7 -o camera.toml`

    ChArUco: `psstereo calibrate lens board_*.jpg --board 9x7 --marker 0.75 --dictionary 5X5_100 -o camera.toml`
    """
    import numpy as np

    from psstereo.calibrate.camera import Board, lens_from_pictures
    from psstereo.io.lens_file import is_lens_file, lens_text
    from psstereo.io.one_file import put_file, require_file_place
    from psstereo.stack import FileStack
    from psstereo_cli.calibration_options import parse_board
    from psstereo_cli.camera_findings import add_to_rig, all_frames, require_rig, tell_finding
    from psstereo_cli.console import progress_bars

    require_file_place(out, overwrite=overwrite, ours=is_lens_file, kind="file of a camera and its lens")
    require_rig(add_to)
    across, down = parse_board(board, needed="Squares across and down, such as 9x7.", remedy="Count the squares.")
    printed = Board(columns=across, rows=down, marker=marker, dictionary=dictionary)
    stack = FileStack(tuple(pictures))
    with progress_bars() as progress:
        found = lens_from_pictures(all_frames(stack, progress), printed, model=model, progress=progress)
    text = lens_text(found.camera, found.lens).encode("utf-8")
    put_file(out, text, overwrite=overwrite, ours=is_lens_file, kind="file of a camera and its lens")
    made = f"Camera and lens were found from {len(found.used)} pictures of a board."
    add_to_rig(add_to, made, camera=found.camera, lens=found.lens)
    unused = [stack.names[i] for i in range(len(stack)) if i not in found.used]
    camera, errors = found.camera, found.errors
    rows = [
        ("focal length", f"{camera.fx:.2f} ± {errors[0]:.2f}, {camera.fy:.2f} ± {errors[1]:.2f} px"),
        ("principal point", f"{camera.cx:.2f} ± {errors[2]:.2f}, {camera.cy:.2f} ± {errors[3]:.2f} px"),
        ("lens", ", ".join(f"{number:.5g}" for number in found.lens.coefficients)),
        ("corners missed by", f"{found.residual:.3f} px; {found.straight:.3f} px without a lens"),
        ("board not seen in", ", ".join(unused) or "none"),
        ("written", str(out)),
    ]
    record = {
        "out": str(out),
        "K": camera.matrix.tolist(),
        "lens": list(found.lens.coefficients),
        "errors_px": np.asarray(errors).tolist(),
        "residual_px": found.residual,
        "residual_without_lens_px": found.straight,
        "used": [stack.names[i] for i in found.used],
        "unused": unused,
    }
    tell_finding(found.quality, rows, record, rig=add_to, as_json=as_json)
