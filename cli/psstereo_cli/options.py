"""Options that several commands share, each declared once."""

from pathlib import Path
from typing import Annotated

import typer

__all__ = [
    "Binning",
    "Crop",
    "FlatFrame",
    "Format",
    "Json",
    "LensFile",
    "Lights",
    "LightsLayout",
    "Mask",
    "Overwrite",
    "PriorFile",
    "PriorSigma",
    "PriorUnit",
    "Register",
    "ResponseCurve",
    "RigOption",
    "Threads",
]

Format = Annotated[
    str | None,
    typer.Option(
        "--format", help="Layout of the folder, if it is not recognised; `psstereo info --formats` lists them."
    ),
]
Lights = Annotated[
    Path | None,
    typer.Option(
        "--lights", help="File of light directions to use instead of the folder's own (text, .lp, .npy, .mat)."
    ),
]
LightsLayout = Annotated[
    str | None,
    typer.Option("--lights-layout", help="rows or columns: how lights stand in a file of 3 × 3 numbers."),
]
Mask = Annotated[
    str | None,
    typer.Option(
        "--mask",
        help="Image that is white on the object; `none` for every pixel; `auto` to separate it from a dark background.",
    ),
]
PriorFile = Annotated[
    Path | None,
    typer.Option(
        "--prior",
        help="Depth known beforehand, heights or distances: a map (.npy, .npz, .mat, TIFF, EXR, 16-bit PNG; NaN and 0"
        " are unknown) or a text file with `row column depth` of a few points.",
    ),
]
PriorSigma = Annotated[
    float | None,
    typer.Option(
        "--prior-sigma", help="Standard error of the prior, in its unit; the size of a pixel on the surface if absent."
    ),
]
PriorUnit = Annotated[
    str | None,
    typer.Option(
        "--prior-unit",
        help="Unit of the prior, such as mm, or what a step of 1 is worth, such as 0.2mm; if absent, that of the"
        " heights, and mm for distances. Whole numbers need it.",
    ),
]
RigOption = Annotated[
    Path | None,
    typer.Option(
        "--rig",
        help="Rig file of `psstereo calibrate`: lights, and what is known of the camera, instead of the folder's own.",
    ),
]
ResponseCurve = Annotated[
    str | None,
    typer.Option("--response", help="Curve of the camera to undo: srgb, or the exponent of a gamma curve such as 2.2."),
]
FlatFrame = Annotated[
    Path | None,
    typer.Option("--flat", help="Photograph of an evenly lit white card, or what psstereo calibrate flat wrote."),
]
LensFile = Annotated[
    Path | None, typer.Option("--lens", help="Camera and lens of psstereo calibrate lens, whose distortion is undone.")
]
Crop = Annotated[str | None, typer.Option("--crop", help="X,Y,WIDTH,HEIGHT: part of the photographs to take [px].")]
Register = Annotated[
    str | None,
    typer.Option("--register", help="Undo motion between the frames before anything else: shift, or affine."),
]
Binning = Annotated[
    int, typer.Option("--bin", min=1, help="Pixels along a side of the squares that become one, in linear light.")
]
Json = Annotated[bool, typer.Option("--json", help="Print a record for machines on stdout.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace an earlier result.")]
Threads = Annotated[
    int | None, typer.Option("--threads", min=1, help="Threads to use; as many as there are processors if not given.")
]
