"""``psstereo terrain``: a coarse elevation refined by sun-lit images from above."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from psstereo_cli.options import Json, Overwrite, Threads

if TYPE_CHECKING:
    from psstereo.sfs.terrain.refine import TerrainResult
    from psstereo.types import Array, FloatArray

__all__ = ["terrain"]

_FILES = {
    "elevation.npy", "elevation.tif", "elevation.png", "hillshade.png", "normals.npy", "albedo.npy", "flags.npy",
    "shadows.npy", "residuals.npy", "run.json",
}  # fmt: skip


def terrain(
    dem: Annotated[
        Path,
        typer.Argument(help="Elevation (.npy, .npz, .tif), row 0 north; coarser than the images, or on their grid."),
    ],
    images: Annotated[list[Path], typer.Argument(help="Sun-lit images on one map grid, row 0 north.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the result.")],
    sun: Annotated[
        list[str],
        typer.Option(
            help="AZ,EL of the sun in degrees, once for each image in their order: azimuth clockwise from north,"
            " elevation above the horizon."
        ),
    ],
    cell: Annotated[
        str, typer.Option(help="Distance of the images' columns and rows, DX,DY or one number, in the unit of heights.")
    ],
    reflectance: Annotated[
        str, typer.Option(help="lambert, or lunar-lambert for the Moon and other airless bodies.")
    ] = "lambert",
    lunar_weight: Annotated[
        float | None, typer.Option(help="Weight L of Lunar-Lambert, 0 to 1; the Moon's by the sun's angle if absent.")
    ] = None,
    view: Annotated[
        str | None, typer.Option(help="AZ,EL of the direction toward the camera; straight up if absent.")
    ] = None,
    noise: Annotated[
        float, typer.Option(help="Brightness that is not explained, in shares of the exposure, standard deviation.")
    ] = 0.005,
    elevation_error: Annotated[
        float | None, typer.Option(help="Standard deviation of the given heights, in their unit.")
    ] = None,
    roughness: Annotated[
        float | None, typer.Option(help="How much slopes change from pixel to pixel, standard deviation.")
    ] = None,
    support: Annotated[
        int | None,
        typer.Option(help="For an elevation on the images' grid: over how many pixels' side its heights are means."),
    ] = None,
    albedo_step: Annotated[
        float | None,
        typer.Option(help="Let the albedo vary, by so much from pixel to pixel; with two suns or more. Such as 0.01."),
    ] = None,
    rounds: Annotated[int, typer.Option(min=1, help="Rounds at most.")] = 10,
    tile: Annotated[
        int | None, typer.Option(help="Side of windows for large grids, in pixels; none if absent.")
    ] = None,
    overlap: Annotated[int, typer.Option(help="How far windows reach beyond that, in pixels.")] = 48,
    variable: Annotated[
        str | None, typer.Option(help="Name of the elevation in a .npz that holds several maps.")
    ] = None,
    response: Annotated[
        str, typer.Option(help="Tone curve of image files: linear, srgb, or the exponent of a gamma curve.")
    ] = "linear",
    threads: Threads = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Refine a coarse elevation by the shading of sun-lit images.

    Example: `psstereo terrain coarse.tif morning.png evening.png -o result --sun 80,25 --sun 280,30 --cell 10`

    On the Moon: `psstereo terrain dem.npy a.tif -o result --sun 310,20 --cell 1,1 --reflectance lunar-lambert`
    """
    from psstereo.io.atomic import require_free
    from psstereo.sfs.terrain.files import read_brightness, read_heights
    from psstereo.sfs.terrain.refine import TerrainOptions, refine_terrain
    from psstereo_cli.cameras import parse_response
    from psstereo_cli.console import progress_bars
    from psstereo_cli.execution import available_threads
    from psstereo_cli.inputs import require_outside

    require_free(out, overwrite=overwrite, names=_FILES)
    require_outside(out, dem, *images)
    options = TerrainOptions(
        lunar_weight=lunar_weight,
        noise=noise,
        elevation_error=elevation_error,
        roughness=roughness,
        support=support,
        albedo_step=albedo_step,
        rounds=rounds,
        tile=tile,
        overlap=overlap,
        threads=threads or available_threads(),
    )
    size = _size(cell)
    frames = [read_brightness(path, parse_response(response)) for path in images]
    with progress_bars() as progress:
        result = refine_terrain(
            read_heights(dem, name=variable),
            frames,
            _directions(sun, len(images)),
            cell=size,
            reflectance=reflectance,
            view=(0.0, 0.0, 1.0) if view is None else _directions([view], 1)[0],
            options=options,
            progress=progress,
        )
    record = _record(dem, images, size, result)
    record = _save(out, result, size, record, overwrite=overwrite)
    _tell(out, record, result, as_json=as_json)


def _size(text: str) -> tuple[float, float]:
    from psstereo.errors import OptionError
    from psstereo_cli.execution import parse_floats

    sides = parse_floats(text, None, "size of a cell")
    if len(sides) > 2:
        raise OptionError(
            given=f"The size of a cell is {text!r}.",
            needed="The distance of columns and that of rows, or one number for both.",
            remedy="Write it such as --cell 74.3,92.6.",
        )
    return sides[0], sides[-1]


def _directions(angles: list[str], count: int) -> "FloatArray":
    """Return unit vectors (k, 3) from texts AZ,EL in degrees."""
    import numpy as np

    from psstereo.errors import OptionError
    from psstereo.lights.solar import from_azimuth
    from psstereo_cli.execution import parse_floats

    if len(angles) != count:
        raise OptionError(
            given=f"{len(angles)} suns are given for {count} images.",
            needed="One --sun AZ,EL for each image, in their order.",
            remedy="Give --sun as often as there are images.",
        )
    pairs = np.radians([parse_floats(text, 2, "direction AZ,EL") for text in angles])
    return from_azimuth(pairs[:, 0], pairs[:, 1])


def _record(dem: Path, images: list[Path], cell: tuple[float, float], result: "TerrainResult") -> dict[str, Any]:
    return {
        "elevation": dem.name,
        "images": [path.name for path in images],
        "cell": list(cell),
        "axes": "row 0 north, columns from west to east; x east, y north, z up",
        "outcome": result.outcome.name.lower(),
        "outcome_text": result.outcome.value,
        "assumptions": [
            {"name": one.name, "basis": one.basis.value, "sentence": one.sentence} for one in result.assumptions
        ],
        "exposure": result.exposure.tolist(),
        "haze": result.haze.tolist(),
        "terrain": dict(result.facts),
        "seconds": result.seconds,
    }


def _save(
    out: Path, result: "TerrainResult", cell: tuple[float, float], record: dict[str, Any], *, overwrite: bool
) -> dict[str, Any]:
    """Write the folder, whole or not at all, and return the record."""
    import json

    import numpy as np

    from psstereo.bench import peak_memory, versions
    from psstereo.io.atomic import RECORD, new_folder
    from psstereo.io.elevation_file import write_elevation
    from psstereo.io.pictures import depth_picture, write_png
    from psstereo.sfs.terrain.files import hillshade
    from psstereo_cli.record import finite

    whole = {"schema": 1, "command": "terrain", **record, "peak_memory_bytes": peak_memory(), "versions": versions()}
    plain = dict(finite(whole))
    before, after = hillshade(result.coarse, cell), hillshade(result.elevation, cell)
    arrays: dict[str, Array] = {
        "elevation": result.elevation.astype(np.float32),
        "normals": result.normals.astype(np.float32),
        "albedo": result.albedo.astype(np.float32),
        "flags": result.flags,
        "shadows": result.shadows,
        "residuals": result.residuals.astype(np.float32),
    }
    with new_folder(out, overwrite=overwrite, names=_FILES) as work:
        for name, array in arrays.items():
            np.save(work / f"{name}.npy", array, allow_pickle=False)
        # The file has room for one size of a pixel; cells that are not square are told by the record.
        square = cell[0] if cell[0] == cell[1] else None
        write_elevation(work / "elevation.tif", result.elevation, unit="unit of the given elevation", pixel_size=square)
        write_png(work / "elevation.png", depth_picture(result.elevation, near_is_small=False))
        write_png(work / "hillshade.png", np.concatenate([before, after], axis=1))
        text = json.dumps(plain, indent=1, ensure_ascii=False, allow_nan=False)
        (work / RECORD).write_bytes((text + "\n").encode("utf-8", "backslashreplace"))
    return plain


def _tell(out: Path, record: dict[str, Any], result: "TerrainResult", *, as_json: bool) -> None:
    """Print what was assumed and what came out, and leave with 4 if the rounds did not settle."""
    from psstereo_cli.console import print_json, print_table, say
    from psstereo_cli.failure import NOT_CONVERGED

    if as_json:
        print_json({**record, "out": str(out)})
    else:
        rows = [(one["name"], one["basis"], one["sentence"]) for one in record["assumptions"]]
        print_table("what images and elevation do not tell", rows, ("what", "basis", "taken"))
        facts = record["terrain"]
        lines = [
            (name, f"{exposure:.4g}", f"{haze:.4g}", f"{residual:.2%}", f"{sunlit:.1%}")
            for name, exposure, haze, residual, sunlit in zip(
                record["images"], record["exposure"], record["haze"], facts["residual"], facts["sunlit"], strict=True
            )
        ]
        print_table("images", lines, ("image", "exposure", "haze", "residual", "in the sun"))
        figures = [
            ("outcome", record["outcome_text"]),
            ("change", f"{facts['rms_change']:.4g} root mean square, {facts['rms_last_step']:.2g} in the last round"),
            *(("note", note) for note in facts["notes"]),
            *((f"flag {name}", f"{count} pixels") for name, count in facts["flags"].items()),
            ("time", f"{record['seconds']:.2f} s"),
        ]
        print_table("result", figures)
        say(f"The result is in {out}; hillshade.png shows before, left, and after, right.")
    if not result.outcome.converged:
        raise typer.Exit(NOT_CONVERGED)
