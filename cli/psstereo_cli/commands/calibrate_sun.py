"""``psstereo calibrate sun``: suns of photographs from date, time, place and the standing of the camera."""

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from psstereo_cli.calibration_options import PinholeMatrix, RigOut, ToneCurve
from psstereo_cli.options import Json, Overwrite

if TYPE_CHECKING:
    from psstereo.calibrate.sun import Place
    from psstereo.capture import Capture
    from psstereo.lights import Rig
    from psstereo.stack import Response
    from psstereo.types import FloatArray

__all__ = ["calibrate_sun"]


def calibrate_sun(
    out: RigOut,
    photographs: Annotated[
        list[Path] | None, typer.Argument(help="The photographs, for their times; none if --time gives them all.")
    ] = None,
    place: Annotated[
        str | None,
        typer.Option(
            help="LAT,LON or LAT,LON,HEIGHT: degrees, north and east positive, and metres above the sea; by the"
            " photographs' GPS if absent."
        ),
    ] = None,
    time: Annotated[
        list[str] | None,
        typer.Option(help="When, such as 2026-06-21T15:00+02:00, once for each photograph; by EXIF if absent."),
    ] = None,
    zone: Annotated[
        str | None,
        typer.Option(help="Zone of times that have none: an offset such as +02:00, or a name such as Europe/Berlin."),
    ] = None,
    heading: Annotated[
        float | None,
        typer.Option(help="Azimuth of the line of sight, clockwise from true (not magnetic) north, in degrees."),
    ] = None,
    pitch: Annotated[
        float | None, typer.Option(help="How far the line of sight is above the horizon, in degrees; -90 is down.")
    ] = None,
    roll: Annotated[float, typer.Option(help="How far the camera is turned clockwise, in degrees.")] = 0.0,
    pole: Annotated[
        str | None,
        typer.Option(
            help="X,Y of foot and head of a vertical and of the end of its shadow on level ground, six numbers in"
            " pixels, in the first photograph: instead of --heading; with --K."
        ),
    ] = None,
    matrix: PinholeMatrix = None,
    strength: Annotated[
        str, typer.Option(help="clear-sky: a low sun is weaker; equal: each picture was exposed anew.")
    ] = "clear-sky",
    standing_error: Annotated[
        float | None, typer.Option(help="Error of heading and pitch, in degrees, for the errors of directions.")
    ] = None,
    clock_error: Annotated[float, typer.Option(help="Error of the clock, in seconds.")] = 1.0,
    worst_condition: Annotated[
        float, typer.Option(help="Condition of the directions above which to refuse; a day at the equinox has 1000s.")
    ] = 50.0,
    mask: Annotated[
        str | None, typer.Option(help="Image that is white on the object, for the check of the clock.")
    ] = None,
    check: Annotated[
        bool, typer.Option("--check/--no-check", help="Whether the side of the light in the photographs is compared.")
    ] = True,
    sky: Annotated[
        bool, typer.Option("--sky", help="Find how bright the sky is too, from the shaded side of the object; --mask.")
    ] = False,
    response: ToneCurve = "linear",
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Find where the sun stood for each photograph.

    Example: `psstereo calibrate sun day/*.jpg -o rig.toml --zone Europe/Berlin --heading 350 --pitch -10`

    By a vertical and its shadow: `psstereo calibrate sun *.jpg -o rig.toml --K K.txt --pole 610,820,605,300,920,860`

    Needs an ephemeris: the package ephem, which comes with psstereo's extra outdoor.
    """
    import numpy as np

    from psstereo.calibrate.sun import calibrate_sun as calibrated
    from psstereo.io.rig_file import RigFile
    from psstereo.io.rig_writer import require_rig_place
    from psstereo_cli.cameras import described_camera, parse_response
    from psstereo_cli.console import say
    from psstereo_cli.rig_saving import save_rig

    require_rig_place(out, overwrite=overwrite)
    paths = tuple(photographs or ())
    looked_at = bool(paths) and (sky or (check and len(paths) >= 3))
    if not looked_at:
        _require_no_mask(mask)
    times = _times(paths, time or [], zone)
    where = _place(paths, place)
    rotation = _standing(times[0], where, heading, pitch, roll, pole, matrix)
    names = tuple(path.name for path in paths) or tuple(moment.isoformat() for moment in times)
    found = calibrated(
        times,
        where,
        rotation,
        names=names,
        strength=strength,
        clock_error=clock_error,
        standing_error=None if standing_error is None else float(np.radians(standing_error)),
        worst_condition=worst_condition,
    )
    curve = parse_response(response)
    seen = _capture(paths, found.rig, mask, curve) if looked_at else None
    side = _side(seen, times, where, rotation) if seen is not None and check and len(paths) >= 3 else None
    skies = _sky(seen, rotation) if sky else {}
    rig = RigFile(
        rig=found.rig,
        names=tuple(path.name for path in paths),
        camera=None if matrix is None else described_camera(matrix, None),
        response=curve,
        quality=found.quality,
        provenance=(
            f"The sun from {min(times).isoformat()} to {max(times).isoformat()} over {np.degrees(where.latitude):.5f},"
            f" {np.degrees(where.longitude):.5f} at {where.height:.0f} m, by PyEphem.",
            "The camera stands by " + ("a vertical and its shadow." if pole else "heading, pitch and roll."),
            *((side,) if side else ()),
            *((skies["verdict"],) if skies else ()),
        ),
    )
    facts = {
        "times": [moment.isoformat() for moment in times],
        "azimuth_deg": np.degrees(found.positions.azimuth).tolist(),
        "elevation_deg": np.degrees(found.positions.elevation).tolist(),
        "condition": found.cone.condition,
        "camera_axes": rotation.tolist(),
        "clock": side,
        "sky": skies or None,
    }
    save_rig(out, rig, overwrite=overwrite, as_json=as_json, facts=facts)
    if skies and not as_json:
        say(skies["verdict"])


def _require_no_mask(mask: str | None) -> None:
    """Refuse a mask where no photograph is looked at: it would be ignored."""
    from psstereo.errors import OptionError

    if mask is not None:
        raise OptionError(
            given=f"The mask {mask} is given, and no photograph is looked at.",
            needed="It is for the check of the clock, which takes three photographs or more, or for --sky.",
            remedy="Name the photographs, take --no-check out, or leave --mask out.",
        )


def _times(paths: tuple[Path, ...], given: list[str], zone: str | None) -> list[datetime]:
    """Return the moments, from what was given or from the photographs."""
    from psstereo.calibrate.sun import parse_zone, time_of
    from psstereo.errors import OptionError
    from psstereo.io.exif import read_exif

    clock = None if zone is None else parse_zone(zone)
    if not given:
        if not paths:
            raise OptionError(
                given="Neither photographs nor times are given.",
                needed="The moments whose suns are wanted.",
                remedy="Name the photographs, or give --time.",
            )
        return [time_of(read_exif(path), path.name, clock) for path in paths]
    if paths and len(given) != len(paths):
        raise OptionError(
            given=f"{len(given)} times are given for {len(paths)} photographs.",
            needed="One --time for each photograph, in their order; or none, if EXIF has them.",
            remedy="Give --time as often as there are photographs.",
        )
    moments = []
    for text in given:
        try:
            moment = datetime.fromisoformat(text)
        except ValueError:
            raise OptionError(
                given=f"The time is {text!r}.",
                needed="Date and time such as 2026-06-21T15:00+02:00.",
                remedy="Write year, month and day first, then T, hours and minutes.",
            ) from None
        moments.append(moment if moment.utcoffset() is not None or clock is None else moment.replace(tzinfo=clock))
    return moments


def _place(paths: tuple[Path, ...], text: str | None) -> "Place":
    import numpy as np

    from psstereo.calibrate.sun import Place, place_of
    from psstereo.errors import OptionError
    from psstereo.io.exif import read_exif
    from psstereo_cli.execution import parse_floats

    if text is None:
        if paths:
            return place_of(read_exif(paths[0]), paths[0].name)
        raise OptionError(
            given="No place is given.", needed="Where the sun is wanted.", remedy="Give --place LAT,LON in degrees."
        )
    numbers = parse_floats(text, None, "place (LAT,LON or LAT,LON,HEIGHT)")
    if len(numbers) not in (2, 3):
        raise OptionError(
            given=f"The place is {text!r}.",
            needed="Latitude and longitude in degrees, and the height in metres if it is known.",
            remedy="Write it such as --place 51.31,9.48,160.",
        )
    if not (abs(numbers[0]) <= 90 and abs(numbers[1]) <= 360 and np.isfinite(numbers).all()):
        raise OptionError(
            given=f"The place is {text!r}.",
            needed="A latitude of -90 to 90 degrees, a longitude of -180 to 180 or 0 to 360, and a finite height.",
            remedy="Latitude comes first, such as --place 51.31,9.48,160.",
        )
    latitude, longitude = np.radians(numbers[:2])
    return Place(latitude=float(latitude), longitude=float(longitude), height=numbers[2] if numbers[2:] else 0.0)


def _standing(
    moment: datetime,
    place: "Place",
    heading: float | None,
    pitch: float | None,
    roll: float,
    pole: str | None,
    matrix: str | None,
) -> "FloatArray":
    """Return the camera's axes in the world."""
    import numpy as np

    from psstereo.calibrate.sun import ShadowedPole, rotation_from_heading, rotation_from_pole, sun_positions
    from psstereo.camera import Pinhole
    from psstereo.errors import OptionError
    from psstereo_cli.cameras import described_camera
    from psstereo_cli.execution import parse_floats

    if (pole is None) == (heading is None) or (heading is not None and pitch is None):
        raise OptionError(
            given="The standing of the camera is given " + ("twice." if pole and heading is not None else "in part."),
            needed="Either --heading and --pitch, or --pole with --K.",
            remedy="A compass and a level give the former; a vertical and its shadow in a picture the latter.",
        )
    if not all(np.isfinite(one) for one in (heading, pitch, roll) if one is not None) or abs(pitch or 0.0) > 90:
        raise OptionError(
            given=f"Heading, pitch and roll are {heading}, {pitch} and {roll} degrees.",
            needed="Finite numbers, the pitch from -90 (straight down) to 90 (straight up).",
            remedy="Correct the one that is not.",
        )
    if pole is None:
        angles = np.radians([heading or 0.0, pitch or 0.0, roll])
        return rotation_from_heading(float(angles[0]), float(angles[1]), float(angles[2]))
    camera = described_camera(matrix, None)
    if not isinstance(camera, Pinhole):
        raise OptionError(
            given="A vertical and its shadow are given, and no camera matrix.",
            needed="The focal length and the middle of the image, to turn places into rays.",
            remedy="Give --K; psstereo calibrate lens finds it from pictures of a chessboard.",
        )
    x = np.array(parse_floats(pole, 6, "vertical and shadow (six numbers)")).reshape(3, 2)
    if roll != 0.0:
        raise OptionError(
            given=f"The roll is {roll:g} degrees, and a vertical and its shadow are given.",
            needed="--roll is used with --heading; a vertical in the picture tells how the camera is turned.",
            remedy="Leave --roll out, or give --heading and --pitch instead of --pole.",
        )
    sun = sun_positions([moment], place).directions[0]
    hint = None if pitch is None else float(np.radians(pitch))
    return rotation_from_pole(ShadowedPole(base=x[0], top=x[1], tip=x[2]), camera, sun, pitch=hint)


def _capture(paths: tuple[Path, ...], rig: "Rig", mask: str | None, response: "Response") -> "Capture":
    from psstereo.capture import Capture
    from psstereo.io import read_mask
    from psstereo.stack import FileStack

    stack = FileStack(paths)
    inside = None if mask in (None, "none") else read_mask(Path(str(mask)), (stack.shape[1], stack.shape[2]))
    return Capture(stack=stack, rig=rig, mask=inside, response=response)


def _side(capture: "Capture", times: list[datetime], place: "Place", rotation: "FloatArray") -> str:
    """Compare the side of the light in the photographs with the clock; refuse a clock that it contradicts."""
    from dataclasses import replace

    import numpy as np

    from psstereo.calibrate.sun import check_clock, facing_of_mask
    from psstereo.normals.thinning import sample_grid
    from psstereo_cli.console import progress_bars

    inside = capture.effective_mask
    # Every step-th row and column, so that the places of the samples are known.
    step = max(1, int(np.ceil(np.sqrt(np.count_nonzero(inside) / 2000))))
    thin = np.zeros_like(inside)
    thin[step // 2 :: step, step // 2 :: step] = inside[step // 2 :: step, step // 2 :: step]
    thin = thin if thin.any() else inside
    with progress_bars() as progress:
        grid = sample_grid(
            replace(capture, mask=thin), gray="mean", limit=int(inside.size), strengths=False, progress=progress
        )
    found = check_clock(grid.values[0], times, place, rotation, facing_of_mask(inside)[thin])
    found.require_right()
    return found.sentence


def _sky(capture: "Capture | None", rotation: "FloatArray") -> dict[str, Any]:
    """Return how bright the sky is, as plain values."""
    from psstereo.calibrate.sun import estimate_sky
    from psstereo.errors import OptionError
    from psstereo_cli.console import progress_bars

    if capture is None:
        raise OptionError(
            given="The sky is asked for, and there are no photographs.",
            needed="Photographs of equal exposure of an object with a shaded side.",
            remedy="Name them, or leave --sky out.",
        )
    zenith = rotation[2]  # the world's z axis in the camera's frame
    with progress_bars() as progress:
        found = estimate_sky(capture, zenith, progress=progress)
    words = ",".join(f"{round(x, 5) + 0.0:.5f}" for x in zenith)
    return {
        "even": found.even,
        "zenith": words,
        "shade": found.shade,
        "coefficients": found.coefficients.tolist(),
        "residual_percent": [100.0 * found.residual_before, 100.0 * found.residual_after],
        "verdict": f"{found.verdict} For the solver sky: even={found.even:.3g}, zenith={words}.",
    }
