"""``psstereo rig``: where to put lights, and how good those are that are there."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from psstereo_cli.options import Json, Overwrite

if TYPE_CHECKING:
    from psstereo.calibrate.rig import RigFigures, RigProposal
    from psstereo.io.light_bridge import LightTable

__all__ = ["rig"]

_STYLE = (
    "<style>text { font: 9px sans-serif; fill: #666 } .ring { fill: none; stroke: #bbb } .light { fill: #e90 }"
    " .behind { fill: none; stroke: #e90 }</style>"
)


def rig(
    file: Annotated[
        Path | None,
        typer.Argument(
            help="Lights to rate: a rig file, .lp, .dome, text of directions x y z a line, lights of Meshroom, LUCES or"
            " near_ps, or a capture."
        ),
    ] = None,
    lights: Annotated[int | None, typer.Option(help="Propose places for so many lights instead.")] = None,
    max_tilt: Annotated[
        float, typer.Option(help="Steepest normals of the object that must come out: angle from the view, in degrees.")
    ] = 60.0,
    cone: Annotated[
        float, typer.Option(help="Largest angle from the view at which a light can stand, in degrees.")
    ] = 80.0,
    shape: Annotated[
        str, typer.Option(help="ring; rings: one or two, with or without a light at the camera; or dome.")
    ] = "rings",
    at: Annotated[
        str | None,
        typer.Option(help="X,Y,Z: where the object is, for lamps, in their unit; where their axes meet if absent."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="File for the proposed lights: a rig file (.toml), .lp, .dome or .json."),
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(help="File for a picture of the lights over the hemisphere (.svg).")
    ] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Propose where to put lights, or rate the lights of a rig.

    Example: `psstereo rig --lights 12 --max-tilt 60 -o plan.toml --picture plan.svg`

    How good are the lights of a capture? `psstereo rig photos`

    Errors are those of noise alone on a matte surface, with attached shadows; gloss and cast shadows come on top.
    """
    from psstereo.io.light_bridge import read_lights

    if (file is None) == (lights is None):
        raise typer.BadParameter(
            "name a file of lights to rate, or give --lights N for a proposal" + (", not both" if file else ""),
            param_hint="FILE",
        )
    idle = {"--max-tilt": max_tilt != 60.0, "--cone": cone != 80.0, "--shape": shape != "rings"}
    if lights is None and any(idle.values()):
        name = next(name for name, given in idle.items() if given)
        raise typer.BadParameter("only of a proposal, with --lights; a rating shows all tilts", param_hint=name)
    if lights is not None and at is not None:
        raise typer.BadParameter("only of lamps that are rated; a proposal has distant lights", param_hint="--at")
    if out is not None and lights is None:
        raise typer.BadParameter("only a proposal is written; psstereo convert writes other lights", param_hint="-o")
    if picture is not None:
        _require_picture(picture, overwrite=overwrite)
    if lights is None and file is not None:
        table = read_lights(file)
        record = _rated(table, at)
        names = table.names or tuple(f"light {i + 1}" for i in range(len(table.rig)))
    else:
        record = _proposed(lights or 0, max_tilt, cone, shape, out, overwrite=overwrite)
        names = tuple(f"light {i + 1}" for i in range(lights or 0))
    if picture is not None:
        _draw(picture, record["directions"], names, overwrite=overwrite)
        record["picture"] = str(picture)
    _tell(record, as_json=as_json)


def _rated(table: "LightTable", at: str | None) -> dict[str, Any]:
    import math

    from psstereo.calibrate.rig import assess_rig
    from psstereo.errors import OptionError
    from psstereo_cli.execution import parse_floats

    point = None if at is None else parse_floats(at, 3, "place of the object (X,Y,Z)")
    if point is not None and not all(math.isfinite(one) for one in point):
        raise OptionError(
            given=f"The place of the object is {at!r}.", needed="Three finite numbers X,Y,Z.", remedy="Correct them."
        )
    errors = None if table.file is None else table.file.quality.direction_error
    rating = assess_rig(table.rig, direction_error=errors, point=point)
    return {
        "source": table.source,
        "verdict": rating.verdict,
        "advice": list(rating.advice),
        **_figures(rating.figures),
        "notes": list(table.notes),
    }


def _proposed(
    lights: int, max_tilt: float, cone: float, shape: str, out: Path | None, *, overwrite: bool
) -> dict[str, Any]:
    import numpy as np

    from psstereo.calibrate.rig import propose_rig

    found = propose_rig(lights=lights, max_tilt=float(np.radians(max_tilt)), cone=float(np.radians(cone)), shape=shape)
    record: dict[str, Any] = {
        "source": found.rig.source,
        "shape": shape,
        "max_tilt_deg": max_tilt,
        "rings": [
            {"lights": count, "slant_deg": float(np.degrees(slant))}
            for count, slant in zip(found.counts, found.slants, strict=True)
        ],
        "told_share": found.told,
        "error_deg_at_1_percent": float(np.degrees(0.01 * found.error_per_noise)),
        "verdict": found.rating.verdict,
        "advice": [],  # what one number of lights cannot have is no news after the best has been looked for
        **_figures(found.rating.figures),
        "notes": [],
    }
    if out is not None:
        record["left_out"] = list(_write(out, found, max_tilt, overwrite=overwrite))
        record["out"] = str(out)
    return record


def _write(out: Path, found: "RigProposal", max_tilt: float, *, overwrite: bool) -> tuple[str, ...]:
    """Write the proposed lights, and return what the format has no place for."""
    from psstereo.io.light_bridge import LightTable, write_lights
    from psstereo.io.rig_file import RigFile, RigQuality
    from psstereo_cli.commands.convert import format_of

    if out.suffix.lower() not in (".toml", ".lp", ".dome", ".json"):
        raise typer.BadParameter(f"{out.name} does not end in .toml, .lp, .dome or .json", param_hint="-o")
    kind = format_of(out, None)
    made = RigFile(
        rig=found.rig,
        quality=RigQuality(verdict=found.rating.verdict),
        provenance=(f"Proposed for normals up to {max_tilt:g} degrees from the view: {found.rig.source}.",),
    )
    return write_lights(out, LightTable(rig=found.rig, file=made, source="a proposal"), kind, overwrite=overwrite)


def _figures(figures: "RigFigures") -> dict[str, Any]:
    import numpy as np

    from psstereo_cli.record import finite

    rows = zip(
        np.degrees(figures.tilts),
        np.degrees(0.01 * figures.error_per_noise),
        figures.told,
        figures.fewest_lit,
        strict=True,
    )
    found = finite(
        {
            "lights": len(figures.directions),
            "condition": figures.condition,
            "best_error_deg_at_1_percent": float(np.degrees(0.01 * figures.best)),
            "error_of_directions_deg": float(np.degrees(figures.from_directions)),
            "tilts": [
                {
                    "tilt_deg": float(round(tilt, 6)),
                    "error_deg_at_1_percent": float(error),
                    "told_share": float(told),
                    "fewest_lit": int(lit),
                }
                for tilt, error, told, lit in rows
            ],
            "directions": figures.directions.tolist(),
        }
    )
    return dict(found)


def _draw(path: Path, directions: list[list[float]], names: tuple[str, ...], *, overwrite: bool) -> None:
    """Write the lights as seen from the camera."""
    import numpy as np

    from psstereo.io.one_file import put_file
    from psstereo.report.light_plot import light_plot

    drawn = light_plot(np.array(directions), names).replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1)
    data = drawn.replace(">", f">{_STYLE}", 1).encode("utf-8")
    put_file(path, data, overwrite=overwrite, ours=_is_picture, kind="picture (.svg)")


def _require_picture(path: Path, *, overwrite: bool) -> None:
    """Refuse a place for the picture, before the lights are written."""
    from psstereo.io.one_file import require_file_place

    if path.suffix.lower() != ".svg":
        raise typer.BadParameter(f"{path.name} does not end in .svg", param_hint="--picture")
    require_file_place(path, overwrite=overwrite, ours=_is_picture, kind="picture (.svg)")


def _is_picture(path: Path) -> bool:
    from psstereo.io.one_file import begins_with

    return begins_with(b"<svg ", b"<?xml")(path)


def _tell(record: dict[str, Any], *, as_json: bool) -> None:
    from psstereo_cli.console import print_json, print_table, say

    if as_json:
        print_json(record)
        return
    rows = [
        (
            f"{one['tilt_deg']:.0f}°",
            "not told" if one["error_deg_at_1_percent"] is None else f"{one['error_deg_at_1_percent']:.2g}°",
            f"{one['told_share']:.0%}",
            str(one["fewest_lit"]),
        )
        for one in record["tilts"][::2]
    ]
    columns = ("normal from the view", "error at 1 % noise", "azimuths told", "fewest lights")
    print_table(record["source"], rows, columns)
    for ring in record.get("rings", ()):
        where = "at the camera" if ring["slant_deg"] == 0 else f"{ring['slant_deg']:.1f}° from the view"
        edge = "evenly over a dome up to " if record["shape"] == "dome" else ""
        say(f"{ring['lights']} light{'s' * (ring['lights'] != 1)} {edge}{where}")
    if "rings" in record:
        say(
            f"Normals up to {record['max_tilt_deg']:g}° from the view: {record['told_share']:.1%} can be told, with "
            f"{record['error_deg_at_1_percent']:.2g}° of error at 1 % noise."
        )
    say(record["verdict"])
    for sentence in record["advice"]:
        say(f"advice: {sentence}")
    for note in record["notes"]:
        say(f"note: {note}")
    for lost in record.get("left_out", ()):
        say(f"left out: {lost}")
    for name in ("out", "picture"):
        if name in record:
            say(f"{record[name]} is written.")
