"""``psstereo calibrate balls``: lights from the highlights on mirror balls."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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

if TYPE_CHECKING:
    from psstereo.calibrate.balls import MirrorCalibration, Reach
    from psstereo.io.rig_file import RigFile

__all__ = ["calibrate_balls"]


def calibrate_balls(
    folders: BallFolders,
    out: RigOut,
    ball: BallWords = None,
    origin: BallOrigin = "top-left",
    outline: Annotated[
        list[Path] | None,
        typer.Option(help="Picture under room light, to which the outline is fitted; one for all, or one a ball."),
    ] = None,
    corner: Annotated[
        list[str] | None,
        typer.Option(help="X,Y of a folder's first pixel in the whole frame, for balls cut out of it; once for each."),
    ] = None,
    matrix: PinholeMatrix = None,
    ball_radius: Annotated[
        float, typer.Option(help="With --K, radius of the balls, in the unit that positions shall have.")
    ] = 1.0,
    lamps: Annotated[
        str, typer.Option(help="auto: the balls decide; directions; or positions, from two balls or more.")
    ] = "auto",
    white: Annotated[
        str | None,
        typer.Option(help="X0,Y0,X1,Y1 of a white card in the (first) folder's pictures, for the lights' strengths."),
    ] = None,
    white_albedo: Annotated[float, typer.Option(help="Albedo of the card.")] = 1.0,
    crop: Annotated[
        str | None,
        typer.Option(
            "--object-crop",
            help="X,Y,SCALE: the object's images begin at this pixel of the frame, and a pixel of the frame is SCALE of"
            " theirs; for positions under parallel projection.",
        ),
    ] = None,
    response: ToneCurve = "linear",
    dark: DarkPicture = None,
    compare: Annotated[
        list[Path] | None, typer.Option(help="File of light directions to be held against what the balls tell.")
    ] = None,
    by_name: ByName = False,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Find where the lights were by the highlights on one or several mirror balls.

    Example: `psstereo calibrate balls chrome -o rig.toml --ball 253.5,148,119.5`

    Two balls, cut out of one frame: `psstereo calibrate balls left right -o rig.toml --ball left/circle_data.txt --ball
    right/circle_data.txt --outline left/ref.jpg --outline right/ref.jpg --corner 100,600 --corner 2600,500`
    """
    from psstereo.calibrate.balls import calibrate_mirror_balls
    from psstereo.io.rig_file import RigFile
    from psstereo.io.rig_writer import require_rig_place
    from psstereo_cli.ball_inputs import ball_pictures
    from psstereo_cli.cameras import described_camera, parse_response
    from psstereo_cli.console import progress_bars, say
    from psstereo_cli.rig_saving import save_rig

    require_rig_place(out, overwrite=overwrite)
    _require_whole(white, white_albedo, matrix, ball_radius)
    reach = _reach(lamps)
    camera = described_camera(matrix, None)
    curve = parse_response(response)
    pictures, how = ball_pictures(
        folders,
        ball or [],
        origin=origin,
        outlines=outline or [],
        corners=corner or [],
        camera=camera,
        radius=ball_radius,
        response=curve,
        dark=dark,
    )
    source = f"highlights on {len(pictures)} mirror ball{'s' if len(pictures) > 1 else ''}"
    with progress_bars() as progress:
        found = calibrate_mirror_balls(pictures, reach=reach, source=source, progress=progress)
    rig = RigFile(
        rig=found.rig,
        names=pictures[0].stack.names if by_name else (),
        camera=camera if matrix is not None else None,
        response=curve,
        quality=found.quality,
        provenance=(*how, *found.notes),
    )
    if white is not None:
        rig = _whitened(rig, found, white, white_albedo, pictures[0].stack, dark)
    if crop is not None:
        rig = _cropped(rig, crop)
    compared = [_compared(path, found) for path in compare or []]
    facts = {**_facts(found), "compared": compared}
    save_rig(out, rig, overwrite=overwrite, as_json=as_json, facts=facts)
    if not as_json:
        for one in compared:
            say(one["sentence"])


def _require_whole(white: str | None, white_albedo: float, matrix: str | None, ball_radius: float) -> None:
    """Refuse figures that nothing would be done with."""
    from psstereo.errors import OptionError

    for what, lonely, other in (
        ("--white-albedo", white is None and white_albedo != 1.0, "--white"),
        ("--ball-radius", matrix is None and ball_radius != 1.0, "--K"),
    ):
        if lonely:
            raise OptionError(
                given=f"{what} is given without {other}.",
                needed=f"It is used with {other} only.",
                remedy=f"Give {other} too, or leave {what} out.",
            )


def _reach(words: str) -> "Reach | None":
    from psstereo.calibrate.balls import Reach
    from psstereo.errors import OptionError

    choices = {"auto": None, "directions": Reach.DISTANT, "positions": Reach.NEAR}
    if words not in choices:
        raise OptionError(
            given=f"The lamps are to be told as {words!r}.",
            needed=f"One of {', '.join(choices)}.",
            remedy="Leave it out to let the balls decide.",
        )
    return choices[words]


def _whitened(
    rig: "RigFile", found: "MirrorCalibration", words: str, albedo: float, stack: Any, dark: Path | None
) -> "RigFile":
    """Return the rig with strengths by a white card."""
    from psstereo.calibrate.white_target import white_strengths
    from psstereo.io.parts import read_dark
    from psstereo_cli.ball_inputs import parse_box

    level = None if dark is None else read_dark(dark, stack, rig.response)
    depth = None if rig.camera is None else float(-found.lamps.middle[2])
    measured = white_strengths(
        stack,
        rig.rig,
        parse_box(words),
        albedo=albedo,
        camera=found.camera,
        distance=depth,
        response=rig.response,
        dark=level,
    )
    note = f"Strengths by a white card at {words}, taken for turned toward the camera beside the balls."
    quality = replace(rig.quality, strength_error=measured.error)
    return replace(rig, rig=measured.rig, quality=quality, provenance=(*rig.provenance, note))


def _cropped(rig: "RigFile", words: str) -> "RigFile":
    """Return the rig in the pixels of images that were cut out of the frame and made smaller or larger."""
    import numpy as np

    from psstereo.camera import Pinhole
    from psstereo.errors import OptionError
    from psstereo.lights import Led
    from psstereo_cli.execution import parse_floats

    x, y, scale = parse_floats(words, 3, "object's crop X,Y,SCALE")
    if not (np.isfinite([x, y, scale]).all() and scale > 0):
        raise OptionError(
            given=f"The object's crop is {words!r}.",
            needed="Column and row in the frame, and how many of its pixels one of the frame is, above 0.",
            remedy="Give 100,50,0.5 for images of half the resolution that begin there.",
        )
    note = f"In the pixels of images that begin at {x:g}, {y:g} of the frame, {scale:g} of which are one of it."
    camera = rig.camera
    if isinstance(camera, Pinhole):
        middle = (np.array([camera.cx - x, camera.cy - y]) + 0.5) * scale - 0.5
        camera = replace(
            camera,
            fx=camera.fx * scale,
            fy=camera.fy * scale,
            skew=camera.skew * scale,
            cx=float(middle[0]),
            cy=float(middle[1]),
        )
        return replace(rig, camera=camera, provenance=(*rig.provenance, note))
    shift = np.array([-x + 0.5 - 0.5 / scale, y - 0.5 + 0.5 / scale, 0.0])
    lights = tuple(
        replace(light, position=scale * (light.position + shift), flux=light.flux * scale * scale)
        if isinstance(light, Led)
        else light
        for light in rig.rig.lights
    )
    covariance = rig.quality.position_covariance
    quality = replace(rig.quality, position_covariance=None if covariance is None else covariance * scale * scale)
    return replace(rig, rig=replace(rig.rig, lights=lights), quality=quality, provenance=(*rig.provenance, note))


def _compared(path: Path, found: "MirrorCalibration") -> dict[str, Any]:
    """Return how far the directions of a file are from those that were found."""
    import numpy as np

    from psstereo.calibrate.light_comparison import compare_directions
    from psstereo.io.light_file import read_directions

    lamps = found.lamps
    given = read_directions(path, len(lamps.directions)).vectors
    told = compare_directions(lamps.directions, lamps.direction_error, given, name=path.name)
    return {
        "file": path.name,
        "agrees": told.agrees,
        "angles_deg": np.degrees(told.angles).tolist(),
        "sentence": told.sentence,
    }


def _facts(found: "MirrorCalibration") -> dict[str, Any]:
    lamps = found.lamps
    return {
        "reach": lamps.reach.value,
        "probability": lamps.probability,
        "least_distance": lamps.least_distance,
        "spread_of_balls": lamps.spread,
        "errors_enlarged": lamps.enlarged,
        "weakest": None if lamps.weakest is None else lamps.weakest.tolist(),
        "weakest_error": None if lamps.weakest_error is None else lamps.weakest_error.tolist(),
        "balls": lamps.seen.tolist(),
        "highlights": [
            [None if one is None else [*one.pixel.tolist(), float(one.covariance[0, 0] ** 0.5)] for one in row]
            for row in found.highlights
        ],
    }
