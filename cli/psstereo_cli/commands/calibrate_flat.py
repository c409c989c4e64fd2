"""``psstereo calibrate flat``: the flat field from photographs of a white card."""

from pathlib import Path
from typing import Annotated

import typer

from psstereo_cli.calibration_options import ToneCurve
from psstereo_cli.options import Json, Overwrite

__all__ = ["calibrate_flat"]


def calibrate_flat(
    photographs: Annotated[list[Path], typer.Argument(help="Photographs of an evenly lit white card, unsaturated.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="File to write, .npy: light over its median.")],
    dark: Annotated[
        Path | None, typer.Option(help="Photograph without light, at the exposure of the card's photographs.")
    ] = None,
    response: ToneCurve = "linear",
    smooth: Annotated[
        float,
        typer.Option(
            min=0.0, help="Standard deviation of a smoothing, in pixels: less noise, but dust stays in images."
        ),
    ] = 0.0,
    add_to: Annotated[
        Path | None, typer.Option("--add-to", help="Rig file that is to name the flat field; it is written anew.")
    ] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Find what lens and sensor make of an even surface, so that it can be divided out.

    Example: `psstereo calibrate flat card_*.png -o flat.npy`

    A file flat.npy or flat.png beside a folder's photographs is used by itself; elsewhere say flat = "flat.npy" in
    capture.toml.
    """
    import io

    import numpy as np

    from psstereo.calibrate.camera import flat_from_frames
    from psstereo.errors import OptionError
    from psstereo.io.flat_file import is_flat_light
    from psstereo.io.one_file import put_file, require_file_place
    from psstereo.io.parts import read_dark
    from psstereo.stack import FileStack
    from psstereo_cli.camera_findings import add_to_rig, all_frames, require_rig, tell_finding
    from psstereo_cli.cameras import parse_response
    from psstereo_cli.console import progress_bars

    if out.suffix.lower() != ".npy":
        raise OptionError(
            given=f"The flat field is to be written to {out}.",
            needed="A name that ends in .npy.",
            remedy="Write -o flat.npy.",
        )
    require_file_place(out, overwrite=overwrite, ours=is_flat_light, kind="flat field")
    require_rig(add_to)
    stack, curve = FileStack(tuple(photographs)), parse_response(response)
    with progress_bars() as progress:
        found = flat_from_frames(
            all_frames(stack, progress),
            response=curve,
            dark=None if dark is None else read_dark(dark, stack, curve),
            white=stack.white if stack.saturates else None,
            smooth=smooth,
            progress=progress,
        )
    data = io.BytesIO()
    np.save(data, found.light)
    put_file(out, data.getvalue(), overwrite=overwrite, ours=is_flat_light, kind="flat field")
    add_to_rig(
        add_to, f"The flat field was found from {len(stack)} photograph{'s' * (len(stack) != 1)}.", flat=out.absolute()
    )
    rows = [
        ("corners", f"{found.corners:.1%} of the light of the middle"),
        ("noise of a gain", "not told by one photograph" if np.isnan(found.noise) else f"{found.noise:.3%}"),
        ("dead values", str(found.dead)),
        ("written", str(out)),
    ]
    record = {"out": str(out), "corners": found.corners, "noise": found.noise, "dead": found.dead}
    tell_finding(found.quality, rows, record, rig=add_to, as_json=as_json)
