"""``psstereo calibrate response``: the camera's tone curve, from exposures of one scene or from the shading itself."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from psstereo_cli.options import Json

if TYPE_CHECKING:
    from psstereo.calibrate.response import ResponseFit
    from psstereo.types import Progress

__all__ = ["calibrate_response"]


def calibrate_response(
    photographs: Annotated[
        list[Path],
        typer.Argument(
            help="Two photographs or more of one scene, exposed for different times; or one capture folder, whose"
            " shading tells."
        ),
    ],
    times: Annotated[
        str | None,
        typer.Option(help="Exposure times in seconds, in the order of the photographs: 0.01,0.02; by EXIF if absent."),
    ] = None,
    model: Annotated[
        str, typer.Option(help="gamma, curve, or auto: the free curve where it fits better. Shading tells a gamma.")
    ] = "auto",
    mask: Annotated[
        str | None, typer.Option(help="Of a capture folder: image that is white on the object; `none` for all.")
    ] = None,
    add_to: Annotated[
        Path | None, typer.Option("--add-to", help="Rig file that is to know the response; it is written anew.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Find the curve that the camera bent the light with, so that it can be undone.

    Example: `psstereo calibrate response dark.jpg middle.jpg bright.jpg --times 0.005,0.01,0.02`

    From a capture of a matte object: `psstereo calibrate response photos --add-to rig.toml`
    """
    from psstereo_cli.camera_findings import add_to_rig, require_rig, tell_finding
    from psstereo_cli.console import progress_bars

    require_rig(add_to)
    folder = len(photographs) == 1 and photographs[0].is_dir()
    _require_used(folder, times, model, mask)
    with progress_bars() as progress:
        if folder:
            found = _from_shading(photographs[0], mask, progress)
        else:
            found = _from_exposures(photographs, times, model, progress)
    how = f"the shading of {photographs[0].name}" if folder else f"{len(photographs)} exposures"
    add_to_rig(add_to, f"The response was found from {how}.", response=found.response)
    response = found.response
    line = {
        "linear": 'response = "linear"',
        "gamma": f"response = {response.exponent:.4f}",
        "curve": "response = [" + ", ".join(f"[{v:.5g}, {light:.5g}]" for v, light in response.knots) + "]",
    }[response.name]
    rows = [
        ("exponent", f"{found.exponent:.4f} ± {found.exponent_error:.4f}"),
        ("misfit", f"{found.residual:.3%} of full scale, {found.observations} values"),
        ("in capture.toml", line),
    ]
    record = {
        "response": response.name,
        "exponent": found.exponent,
        "exponent_error": found.exponent_error,
        "knots": [list(knot) for knot in response.knots],
        "residual": found.residual,
        "observations": found.observations,
        "from": "shading" if folder else "exposures",
    }
    tell_finding(found.quality, rows, record, rig=add_to, as_json=as_json)


def _require_used(folder: bool, times: str | None, model: str, mask: str | None) -> None:
    """Refuse options that nothing would be done with."""
    idle = {"--times": times is not None, "--model curve": model == "curve"} if folder else {"--mask": mask is not None}
    for name, given in idle.items():
        if given:
            raise typer.BadParameter(
                "the shading of a capture folder tells a gamma, without times"
                if folder
                else "only of a capture folder",
                param_hint=name,
            )


def _from_exposures(photographs: list[Path], times: str | None, model: str, progress: "Progress") -> "ResponseFit":
    from psstereo.calibrate.response import response_from_exposures
    from psstereo.io.exif import exposure_times
    from psstereo.stack import FileStack
    from psstereo_cli.camera_findings import all_frames
    from psstereo_cli.execution import parse_floats

    paths = tuple(photographs)
    stack = FileStack(paths)
    seconds = exposure_times(paths) if times is None else parse_floats(times, len(paths), "times")
    frames = all_frames(stack, progress)
    return response_from_exposures(frames, seconds, white=stack.white, model=model, progress=progress)


def _from_shading(folder: Path, mask: str | None, progress: "Progress") -> "ResponseFit":
    from psstereo.calibrate.response import response_of_capture
    from psstereo_cli.loading import load_capture

    capture, _ = load_capture(
        folder, layout=None, lights=None, lights_layout=None, mask=mask, truth=False, progress=progress
    )
    return response_of_capture(capture, progress=progress)
