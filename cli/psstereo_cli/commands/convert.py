"""``psstereo convert``: lights, relightable pictures and normal maps in the files of other programs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from psstereo_cli.options import Json, Overwrite

if TYPE_CHECKING:
    from psstereo.io.light_bridge import LightTable

__all__ = ["convert", "format_of"]

_PICTURES = {"ptm": "ptm", "rti": "hsh9", "web": "ptm"}
"""Formats of relightable pictures, and the basis that each takes if none is named."""
_NORMALS = "normals"
_BY_SUFFIX = {
    ".lp": "lp", ".dome": "dome", ".json": "meshroom", ".toml": "rig", ".ptm": "ptm", ".rti": "rti",
    ".png": _NORMALS, ".npy": _NORMALS, ".exr": _NORMALS, ".tif": _NORMALS, ".tiff": _NORMALS,
}  # fmt: skip


def convert(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="IN",
            help="A file or folder of lights, text of directions x y z a line, a capture, a normal map or a result.",
        ),
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="File to write, or folder where the format is several.")],
    to: Annotated[
        str | None,
        typer.Option(
            help="rig, lp, dome, diligent, psbox, meshroom, luces, near-ps: the lights. ptm, rti, web: pictures under"
            " any light. normals: a normal map, 16 bits as .png. The ending of OUT tells it if absent."
        ),
    ] = None,
    origin: Annotated[
        str | None,
        typer.Option(
            "--from",
            help="Format of IN, if it is not recognised; of a capture, a name of psstereo info. Of 3 × 3 numbers,"
            " diligent: a light a row, or psbox: a light a column.",
        ),
    ] = None,
    size: Annotated[
        str | None, typer.Option(help="Size of the images, WIDTHxHEIGHT, where IN does not say it.")
    ] = None,
    distance: Annotated[float | None, typer.Option(help="Mean distance of the object, in mm, for luces.")] = None,
    image_width: Annotated[
        float | None, typer.Option(help="Length that the picture's width is on the object, in mm, for dome.")
    ] = None,
    basis: Annotated[
        str | None, typer.Option(help="Series of pictures: ptm, hsh4 or hsh9; ptm for ptm and web, hsh9 for rti.")
    ] = None,
    colour: Annotated[
        str | None, typer.Option(help="lrgb: one series times a colour (ptm); rgb: a series for each channel (hsh).")
    ] = None,
    curve: Annotated[str, typer.Option(help="Curve of pictures: srgb as a screen shows them, or linear.")] = "srgb",
    exposure: Annotated[float, typer.Option(help="Factor on the light in pictures.")] = 1.0,
    quality: Annotated[
        int | None, typer.Option(help="web: JPEG quality, 1 to 100, for smaller planes; PNG without loss if absent.")
    ] = None,
    frame: Annotated[
        str, typer.Option(help="Frame of the normal map IN: opengl, directx, opencv, meshroom, bini.")
    ] = "opengl",
    out_frame: Annotated[str, typer.Option(help="Frame of the normal map OUT.")] = "opengl",
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Write lights, pictures under any light, or a normal map in another program's format.

    Example: `psstereo convert lights.lp rig.toml`

    Lamps of LUCES for near_ps, frames converted; what a format has no place for is told: `psstereo convert
    led_params.txt near --to near-ps`

    A capture as a page that is relit in any browser, without a network: `psstereo convert photos page --to web`

    For RTI viewers: `psstereo convert photos object.ptm`

    A normal map with green down: `psstereo convert result/normals.npy n.png --out-frame directx`
    """
    kind = format_of(out, to)
    family = _NORMALS if kind == _NORMALS else "pictures" if kind in _PICTURES else "lights"
    said: dict[str, dict[str, object]] = {
        "lights": {"--size": size, "--distance": distance, "--image-width": image_width},
        "pictures": {
            "--basis": basis,
            "--colour": colour,
            "--curve": None if curve == "srgb" else curve,
            "--exposure": None if exposure == 1.0 else exposure,
            "--quality": quality,
        },
        _NORMALS: {
            "--frame": None if frame == "opengl" else frame,
            "--out-frame": None if out_frame == "opengl" else out_frame,
        },
    }
    for wanted, options in said.items():
        for name, value in options.items():
            if value is not None and wanted != family:
                raise typer.BadParameter(f"only of {wanted}; {kind} takes none", param_hint=name)
    if kind == _NORMALS and origin is not None:
        raise typer.BadParameter(
            "only of lights and captures; --frame says how a normal map points", param_hint="--from"
        )
    _require_other(source, out)
    if kind == _NORMALS:
        record = _normals(source, out, frame, out_frame, overwrite=overwrite)
    elif kind in _PICTURES:
        record = _picture(source, out, kind, origin, basis, colour, curve, exposure, quality, overwrite=overwrite)
    else:
        record = _lights(source, out, kind, origin, size, distance, image_width, overwrite=overwrite)
    _tell({"in": str(source), "out": str(out), "to": kind, **record}, as_json=as_json)


def _require_other(source: Path, out: Path) -> None:
    """Refuse to write over what is read, which would be lost."""
    from psstereo.errors import OptionError

    if source.is_file() and out.exists() and out.samefile(source):
        raise OptionError(
            given=f"{out} is what is to be converted.",
            needed="Another name, so that it stays.",
            remedy="Choose another name.",
        )


def format_of(out: Path, to: str | None) -> str:
    """Return the format that was named, or that a file's ending means.

    Parameters
    ----------
    out : Path
        What is to be written.
    to : str or None
        Name of the format.

    Returns
    -------
    str
        The format.
    """
    from psstereo.io.light_bridge import LIGHT_FORMATS

    known = (*LIGHT_FORMATS, *_PICTURES, _NORMALS)
    kind = to if to is not None else "luces" if out.name == "led_params.txt" else _BY_SUFFIX.get(out.suffix.lower())
    if kind not in known:
        what = f"{out.name} does not tell the format" if to is None else f"the format {to!r} is unknown"
        raise typer.BadParameter(f"{what}; known are {', '.join(known)}", param_hint="--to")
    return kind


def _lights(
    source: Path,
    out: Path,
    kind: str,
    origin: str | None,
    size: str | None,
    distance: float | None,
    image_width: float | None,
    *,
    overwrite: bool,
) -> dict[str, Any]:
    from dataclasses import replace

    from psstereo.errors import OptionError
    from psstereo.io.light_bridge import LightTable, read_lights, write_lights
    from psstereo_cli.execution import parse_image_size

    for what, value in (("distance", distance), ("width of the picture", image_width)):
        if value is not None and not 0 < value < float("inf"):
            raise OptionError(given=f"The {what} is {value}.", needed="A positive length.", remedy="Correct it.")
    table: LightTable = read_lights(source, kind=origin)
    table = replace(
        table,
        size=table.size if size is None else parse_image_size(size),
        distance=table.distance if distance is None else distance,
        width=table.width if image_width is None else image_width,
    )
    if kind == "rig":
        table = _rated(table)
    lost = write_lights(out, table, kind, overwrite=overwrite)
    return {"lights": len(table.rig), "notes": list(table.notes), "left_out": list(lost)}


def _rated(table: "LightTable") -> "LightTable":
    """Say in a rig file how good the rig is, unless it says so or lamps cannot be rated without the object's place."""
    from dataclasses import replace

    from psstereo.calibrate.rig import assess_rig
    from psstereo.errors import RigError
    from psstereo.io.rig_file import RigFile, RigQuality

    if table.file is not None:
        return table
    try:
        rating = assess_rig(table.rig)
    except RigError:
        return table
    made = RigFile(
        rig=table.rig,
        quality=RigQuality(verdict=rating.verdict, advice=rating.advice),
        provenance=(f"Converted from {table.source}.",),
    )
    return replace(table, file=made)


def _picture(
    source: Path,
    out: Path,
    kind: str,
    origin: str | None,
    basis: str | None,
    colour: str | None,
    curve: str,
    exposure: float,
    quality: int | None,
    *,
    overwrite: bool,
) -> dict[str, Any]:
    from psstereo.forward.polynomial_maps import fit_polynomial_maps
    from psstereo.io.one_file import begins_with, require_file_place
    from psstereo.io.ptm_file import PTM_HEADS, write_ptm
    from psstereo.io.rti_file import RTI_HEADS, write_rti
    from psstereo.io.web_relight import write_web_relight
    from psstereo_cli.console import progress_bars
    from psstereo_cli.loading import load_capture

    if quality is not None and kind != "web":
        raise typer.BadParameter("only the planes of a web folder can be JPEG", param_hint="--quality")
    if kind != "web":
        heads = PTM_HEADS if kind == "ptm" else RTI_HEADS
        require_file_place(out, overwrite=overwrite, ours=begins_with(*heads), kind=f".{kind} file")
    series = basis or _PICTURES[kind]
    with progress_bars() as progress:
        capture, _ = load_capture(
            source, layout=origin, lights=None, lights_layout=None, mask="none", truth=False, progress=progress
        )
        maps = fit_polynomial_maps(
            capture,
            basis=series,
            colour=colour or ("lrgb" if series == "ptm" else "rgb"),
            curve=curve,
            exposure=exposure,
            progress=progress,
        )
    if kind == "ptm":
        write_ptm(out, maps.planes, overwrite=overwrite)
    elif kind == "rti":
        write_rti(out, maps.planes, overwrite=overwrite)
    else:
        write_web_relight(out, maps.planes, title=capture.name, quality=quality, overwrite=overwrite)
    rows, columns = maps.planes.size
    return {
        "lights": len(capture.rig),
        "basis": series,
        "width": columns,
        "height": rows,
        "misfit_percent": 100 * maps.residual,
        "notes": [*capture.notes, *maps.notes],
        "left_out": [],
    }


def _normals(source: Path, out: Path, frame: str, out_frame: str, *, overwrite: bool) -> dict[str, Any]:
    from psstereo.io import read_normal_map, write_normal_map
    from psstereo.io.one_file import require_file_place

    path = source / "normals.npy" if (source / "normals.npy").is_file() else source
    found = read_normal_map(path, convention=frame)
    require_file_place(out, overwrite=overwrite, ours=_is_normal_map, kind="normal map")
    write_normal_map(found.normals, out, convention=out_frame)
    return {"pixels": int(found.mask.sum()), "frame": out_frame, "notes": list(found.notes), "left_out": []}


def _is_normal_map(path: Path) -> bool:
    """Return whether most of a file's vectors have the length 1, in any frame; those of photographs do not."""
    import numpy as np

    from psstereo.errors import PsstereoError
    from psstereo.stack.decode import decode_image

    try:
        image = decode_image(path)
    except PsstereoError:
        return False
    if image.ndim != 3 or image.shape[2] < 3:
        return False
    whole = image.dtype.kind == "u"
    found = image[..., :3] / float(np.iinfo(image.dtype).max) if whole else image[..., :3].astype(np.float64)
    found = found[np.isfinite(found).all(axis=-1) & found.any(axis=-1)]
    for z in (2 * found[:, 2] - 1, found[:, 2]) if whole else (found[:, 2],):  # Meshroom's blue goes from 0 to 1
        x, y = (2 * found[:, :2] - 1).T if whole else found[:, :2].T
        length = np.sqrt(x * x + y * y + z * z)
        length = length[length > 0.1]  # gray is a vector of no length: background
        if length.size and float((np.abs(length - 1) < 0.1).mean()) > 0.9:
            return True
    return False


def _tell(record: dict[str, Any], *, as_json: bool) -> None:
    from psstereo_cli.console import print_json, say

    if as_json:
        print_json(record)
        return
    what = f"{record['lights']} lights" if "lights" in record else f"{record['pixels']} normals"
    misfit = f", misfit {record['misfit_percent']:.2g} % of full scale" if "misfit_percent" in record else ""
    say(f"{record['out']}: {what} as {record['to']}{misfit}.")
    for note in record["notes"]:
        say(f"note: {note}")
    for lost in record["left_out"]:
        say(f"left out: {lost}")
