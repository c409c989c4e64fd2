"""``psstereo sfs``: one image to normals and depth, with every assumption named."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from psstereo_cli.options import Json, Overwrite, PriorFile, PriorSigma, PriorUnit, Threads

if TYPE_CHECKING:
    from psstereo.camera import Camera
    from psstereo.lights import Light
    from psstereo.sfs import ShadedImage

__all__ = ["sfs"]


def sfs(
    image: Annotated[Path, typer.Argument(help="A photograph; or a capture folder, of which one image is used.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the result.")],
    light: Annotated[
        str | None,
        typer.Option(
            help="Where the light is: AZ,EL in degrees, azimuth from x right toward y up and elevation above the image"
            " plane; `eye` for a lamp at the lens (--K); nine numbers for spherical harmonics; `estimate`. A capture"
            " folder has it."
        ),
    ] = None,
    method: Annotated[
        str, typer.Option(help="Method: variational, eikonal, pentland, tsai-shah or lee-kuo.")
    ] = "variational",
    option: Annotated[
        list[str] | None,
        typer.Option(help="Option of the method, KEY=VALUE, as often as needed; an unknown key lists them."),
    ] = None,
    albedo: Annotated[
        str,
        typer.Option(
            help="Brightness of the surface under unit irradiance, full scale 1; `estimate`: the brightest part"
            " faces the light."
        ),
    ] = "estimate",
    ambient: Annotated[
        str,
        typer.Option(help="Brightness that is added everywhere, full scale 1; `estimate`: that of the darkest part."),
    ] = "0",
    number: Annotated[
        int | None,
        typer.Option("--image", min=1, help="Which image of a capture, from 1; the most frontal one if absent."),
    ] = None,
    mask: Annotated[str | None, typer.Option(help="Image that is white on the object; `none` for every pixel.")] = None,
    matrix: Annotated[
        str | None,
        typer.Option(
            "--K", help="The camera is a pinhole: a file with its 3 × 3 matrix, or fx,fy,cx,cy,skew in pixels."
        ),
    ] = None,
    pixel_size: Annotated[
        float | None, typer.Option(help="Under parallel projection, length of a pixel on the surface, in mm.")
    ] = None,
    heights: Annotated[
        Path | None,
        typer.Option(
            help="Depth that is known exactly, at the border or at summits, in the unit of the result: floating-point"
            " numbers in .npy, .npz, .mat, TIFF or EXR; NaN elsewhere."
        ),
    ] = None,
    prior: PriorFile = None,
    prior_sigma: PriorSigma = None,
    prior_unit: PriorUnit = None,
    silhouette: Annotated[
        bool,
        typer.Option(
            "--silhouette", help="The mask is the object's outline: let it bulge in it where shading does not tell."
        ),
    ] = False,
    response: Annotated[
        str, typer.Option(help="Tone curve of the image file: linear, srgb, or the exponent of a gamma curve.")
    ] = "linear",
    gray: Annotated[
        str, typer.Option(help="How channels become one: mean, r, g, b, bt601, bt709, or weights.")
    ] = "mean",
    threads: Threads = None,
    no_report: Annotated[bool, typer.Option("--no-report", help="Leave report.html out.")] = False,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """See shape in a single image; what had to be assumed for it is told.

    Example: `psstereo sfs statue.png -o result --light 120,50 --mask mask.png`

    One image of a capture: `psstereo sfs photos -o result --image 3 --mask auto --silhouette`

    A lamp at the lens: `psstereo sfs endoscope.png -o result --light eye --K K.txt --method eikonal --albedo 400`

    With a coarse depth: `psstereo sfs face.png -o result --light 90,60 --prior coarse.npy --prior-sigma 2`
    """
    from psstereo.depth import triangulate
    from psstereo.io.atomic import require_free
    from psstereo.io.result_folder import write_result
    from psstereo.sfs.silhouette import with_silhouette
    from psstereo_cli.console import progress_bars
    from psstereo_cli.execution import available_threads
    from psstereo_cli.inputs import require_outside
    from psstereo_cli.reporting import shading_report
    from psstereo_cli.settings import build_shading_method
    from psstereo_cli.shading_record import shading_record

    require_free(out, overwrite=overwrite)  # told before the work, not after it
    require_outside(out, image, mask, matrix, heights, prior)
    solver = build_shading_method(method, option or [], threads=threads or available_threads())
    shaded = _image(image, light, number, albedo, ambient, mask, _camera(matrix, pixel_size), response, gray)
    shaded, notes = _known(shaded, heights, prior, prior_sigma, prior_unit)
    shaded = with_silhouette(shaded) if silhouette else shaded
    with progress_bars() as progress:
        result = solver.recover(shaded, progress=progress)
    mesh = triangulate(
        result.depth.depth,
        shaded.camera,
        normals=result.normals.normals,
        albedo=result.normals.albedo,
        components=result.depth.components,
    )
    record = shading_record(image.name, shaded, result, mesh, notes)
    page = None if no_report else shading_report(shaded, result, record)
    write_result(out, result.normals, depth=result.depth, mesh=mesh, record=record, report=page, overwrite=overwrite)
    _tell(out, record, converged=result.normals.outcome.converged, as_json=as_json)


def _camera(matrix: str | None, pixel_size: float | None) -> "Camera | None":
    """Return the camera that was described, None if none was."""
    from psstereo_cli.cameras import described_camera

    return None if matrix is None and pixel_size is None else described_camera(matrix, pixel_size)


def _image(
    path: Path,
    light: str | None,
    number: int | None,
    albedo: str,
    ambient: str,
    mask: str | None,
    camera: "Camera | None",
    response: str,
    gray: str,
) -> "ShadedImage":
    """Read the image and put it together with what was said of it."""
    from dataclasses import replace

    from psstereo.errors import MissingFileError, OptionError
    from psstereo.io import read_mask
    from psstereo.sfs.single import brightness, image_of_capture, image_of_photograph, most_frontal
    from psstereo.stack import FileStack
    from psstereo_cli.cameras import parse_response
    from psstereo_cli.execution import parse_floats
    from psstereo_cli.loading import load_capture

    weights = parse_floats(gray, None, "gray") if "," in gray else gray
    paint, level = _number(albedo, "albedo"), _number(ambient, "ambient level")
    if path.is_dir():
        if light is not None or level is None or response != "linear":
            raise OptionError(
                given=f"{path.name} is a capture folder; --light, --response or --ambient estimate was given.",
                needed="A capture knows its lights and its tone curve, and a dark image where there is one.",
                remedy="Leave them out, or give one of its images as a file.",
            )
        capture, _ = load_capture(
            path, layout=None, lights=None, lights_layout=None, mask=mask, truth=False, progress=_quiet
        )
        index = most_frontal(capture) if number is None else number - 1
        shaded = image_of_capture(capture, index, gray=weights, albedo=paint, ambient=level)
        return shaded if camera is None else replace(shaded, camera=camera)
    if not path.exists():
        raise MissingFileError(given=f"{path} is not there.", needed="An image or a folder.", remedy="Check the name.")
    if light is None or number is not None:
        raise OptionError(
            given="There is no light." if light is None else "--image was given, and the image is a file.",
            needed="A photograph needs --light, and is one image.",
            remedy="Give --light AZ,EL in degrees; --light estimate guesses it from the image."
            if light is None
            else "Leave --image out.",
        )
    stack = FileStack((path,))
    values = brightness(stack.frame(0), response=parse_response(response), gray=weights, white=stack.white)
    inside = None if mask in (None, "none") else read_mask(Path(str(mask)), (values.shape[0], values.shape[1]))
    return image_of_photograph(values, light=_light(light), albedo=paint, ambient=level, mask=inside, camera=camera)


def _light(words: str) -> "Light | None":
    """Return the light that was described; None if it is to be estimated."""
    import numpy as np

    from psstereo.errors import OptionError
    from psstereo.lights import Directional, Harmonics, Led
    from psstereo_cli.execution import parse_floats

    if words == "estimate":
        return None
    if words == "eye":
        return Led(position=np.zeros(3), axis=np.array([0.0, 0.0, -1.0]), mu=0.0, flux=np.ones(1))
    numbers = parse_floats(words, None, "light")
    if len(numbers) == 9:
        return Harmonics(coefficients=np.array(numbers))
    azimuth, elevation = parse_floats(words, 2, "light (AZ,EL, or nine harmonics)")
    if not (np.isfinite(azimuth) and -90.0 <= elevation <= 90.0):
        raise OptionError(
            given=f"The light stands at azimuth {azimuth:g}°, elevation {elevation:g}°.",
            needed="An elevation from -90 to 90 degrees: 90 is light from the camera, 0 grazes the image plane.",
            remedy="For the other side add 180 degrees to the azimuth.",
        )
    turn, height = np.radians(azimuth), np.radians(elevation)
    direction = np.array([np.cos(height) * np.cos(turn), np.cos(height) * np.sin(turn), np.sin(height)])
    return Directional(direction=direction, strength=np.ones(1))


def _number(words: str, what: str) -> float | None:
    from psstereo_cli.execution import parse_floats

    return None if words == "estimate" else parse_floats(words, 1, f"{what} (a number, or estimate)")[0]


def _known(
    image: "ShadedImage", heights: Path | None, prior: Path | None, sigma: float | None, unit: str | None
) -> "tuple[ShadedImage, tuple[str, ...]]":
    """Add depth that is known."""
    from dataclasses import replace

    import numpy as np

    from psstereo.errors import InputError
    from psstereo.io.value_map import read_value_map
    from psstereo_cli.known_depth import load_prior

    shape = image.image.shape[0], image.image.shape[1]
    rough, notes = load_prior(prior, shape, image.camera, sigma=sigma, unit=unit)
    exact = None
    if heights is not None:
        found = read_value_map(heights, shape, what="heights", names=("heights", "depth"))
        if found.values.dtype.kind != "f":
            raise InputError(
                given=f"The heights {heights.name} are whole numbers ({found.values.dtype}).",
                needed="Floating-point numbers in the unit of the depth, NaN where no height is known.",
                remedy="Save them as .npy or 32-bit TIFF; whole numbers can be a --prior with its --prior-unit.",
            )
        exact = np.where(found.no_data, np.nan, np.asarray(found.values, np.float64))
    return replace(image, prior=rough, heights=exact), notes


def _quiet(_stage: str, _done: int, _total: int, /) -> None:
    """Show nothing: one image is read."""


def _tell(out: Path, record: dict[str, Any], *, converged: bool, as_json: bool) -> None:
    """Print what was assumed and what came out, and leave with 4 if the iteration did not converge."""
    from psstereo_cli.console import print_json, print_table, say
    from psstereo_cli.failure import NOT_CONVERGED

    if as_json:
        print_json({**record, "out": str(out)})
    else:
        rows = [(one["name"], one["basis"], one["sentence"]) for one in record["normals"]["assumptions"]]
        print_table("what one image does not tell", rows, ("what", "basis", "taken"))
        depth, normals = record["depth"], record["normals"]
        span = "nothing" if depth["range"] is None else "{:.4g} to {:.4g}".format(*depth["range"])
        figures = [
            ("method", f"{normals['method']}, {record['seconds']:.2f} s"),
            ("normals", normals["outcome_text"]),
            ("depth", f"{depth['kind']} [{depth['unit']}] from {span}."),
            *_misfit(normals),
            *(
                (f"flag {name}", f"{count} pixels")
                for name, count in normals["flags"].items()
                if name != "OUTSIDE_MASK"
            ),
        ]
        print_table("result", figures)
        say(f"The result is in {out}.")
    if not converged:
        raise typer.Exit(NOT_CONVERGED)


def _misfit(normals: dict[str, Any]) -> list[tuple[str, str]]:
    """Say how far the image of the result is from the one that was given."""
    found = normals.get("brightness_misfit", normals.get("data_residual"))
    if found is None:
        return []
    return [("brightness misfit", f"{found:.3g} of a facing surface; other surfaces may have as small a one.")]
