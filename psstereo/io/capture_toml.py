"""Our own description of a capture, a ``capture.toml`` written by hand."""

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

from psstereo.camera import Camera, Lens, Orthographic, Pinhole
from psstereo.capture import Capture, Truth
from psstereo.errors import InputError, MissingFileError, OptionError, UnreadableFileError
from psstereo.io.ambient_frame import checked_dark
from psstereo.io.conventions import CONVENTIONS
from psstereo.io.flat_file import read_flat
from psstereo.io.image_names import match_files
from psstereo.io.parts import (
    find_mask,
    natural_order,
    read_dark,
    read_depth,
    read_linear_dark,
    read_true_albedo,
    read_true_normals,
    read_true_visibility,
)
from psstereo.io.reader import Choices, Reader
from psstereo.io.reading_options import with_lens
from psstereo.io.response_section import read_response
from psstereo.io.toml_lights import read_lights
from psstereo.io.toml_section import Section
from psstereo.stack import LINEAR, BracketStack, FileStack, FlatField, ImageStack, Response
from psstereo.stack.decode import IMAGE_SUFFIXES, read_bytes
from psstereo.stack.unmixed import Mixing, UnmixedStack
from psstereo.types import FloatArray

__all__ = ["TEMPLATE", "CaptureToml"]

TEMPLATE = """\
# Description of a capture. Only [images] and [lights] are needed. File names are relative to this file.
name = "my object"

[images]
pattern = "img_*.png"               # in natural order: img_2 before img_10
# files = ["a.png", "b.png"]        # or one by one, in the order of the lights
# response = "linear"               # or "srgb", the exponent of a gamma curve such as 2.2, or a curve of your own:
#                                   # [[0, 0], [0.5, 0.2], [1, 1]], values and the light that they stand for
# white_level = 4095                # value of full scale, if it is not that of the file's type
# dark = "dark.png"                 # image without any of the lights; it is subtracted
# dark_linear = "dark.npy"          # or the same as floats with the response already undone
# flat = "flat.png"                 # evenly lit white card; a list gives each light its own
# exposures = [0.01, 0.04]          # seconds, if each light has several photographs, listed one after the other
# mixing = [[0.8, 0.1, 0.0], [0.1, 0.7, 0.1], [0.0, 0.1, 0.9]]   # one photograph under three coloured lights at once:
#                                   # column j is R, G, B of a white surface under light j alone (or a file)
# radiance_at_white = 12.5          # radiance of a pixel at full scale [W m-2 sr-1], for absolute albedo

[lights]
# One light a line, toward the light, x right, y up, z toward the camera; any length.
directions = [
    [0.5, 0.0, 0.866],
    [-0.25, 0.433, 0.866],
    [-0.25, -0.433, 0.866],
]
# directions = "lights.txt"         # or a file: text, .lp, .npy or .mat
# angles = [[0, 60], [120, 60]]     # or azimuth from right toward up, and elevation above the image plane [deg]
# layout = "rows"                   # or "columns", where a file of 3 x 3 numbers cannot tell
# frame = "opengl"                  # frame of the vectors; "opencv": y down, z into the scene
# strengths = [1.0, 0.9, 1.1]       # or a file; one number a light, or one for each channel
# unit = "relative"                 # of the strengths; or "W/m2" (irradiance of a surface facing the light)
# Lamps close to the object have positions instead, with the camera at the origin unless camera.position says where:
# positions = [[100, 0, 20], [-50, 87, 20], [-50, -87, 20]]
# axes = [[-1, 0, -3], [0.5, -0.87, -3], [0.5, 0.87, -3]]   # main directions of emission
# mu = [1, 1, 1]                    # 0 shines all around (needs no axes), 1 is a flat LED
# flux = [4e4, 4e4, 4e4]            # radiant intensity along the axis, one number or one for each channel

# [mask]
# file = "mask.png"                 # the object is white

# [camera]
# type = "orthographic"
# pixel_size = 0.05                 # length of a pixel on the object
# unit = "mm"
# type = "pinhole"
# K = [[3000.0, 0.0, 640.0], [0.0, 3000.0, 480.0], [0.0, 0.0, 1.0]]   # or a file such as "K.txt"
# lens = [-0.2, 0.05, 0, 0, 0]      # k1, k2, p1, p2, k3 as OpenCV has them: the distortion is undone (pinhole only)
# position = [0, 0, 500]            # of the camera, in the frame of the lamps' positions

# [truth]
# normals = "normals.png"
# convention = "opengl"             # "directx" if green is down
# depth = "depth.npy"
# albedo = "albedo.npy"             # floats
# visibility = "visibility.npz"     # share of each light that gets past shadow casters to each pixel
"""
"""A commented example, which is itself a valid description."""

_KEYS = {
    "": ("name", "images", "lights", "mask", "camera", "truth"),
    "images": (
        *("files", "pattern", "white_level", "response", "dark", "dark_linear", "flat", "exposures", "mixing"),
        "radiance_at_white",
    ),
    "lights": ("directions", "angles", "positions", "axes", "mu", "flux", "layout", "frame", "strengths", "unit"),
    "mask": ("file",),
    "camera": ("type", "K", "lens", "pixel_size", "unit", "position"),
    "truth": ("normals", "convention", "depth", "albedo", "visibility"),
}


class CaptureToml(Reader):
    """``capture.toml``: images, lights, camera, mask and truth as a person writes them down; see :data:`TEMPLATE`."""

    name: ClassVar[str] = "capture"
    summary: ClassVar[str] = "capture.toml (images, lights, camera, mask; psstereo info --template shows one)"

    def recognise(self, path: Path) -> str | None:
        """See :meth:`Reader.recognise`."""
        if path.is_file():
            return "it is a description of a capture in TOML" if path.suffix.lower() == ".toml" else None
        return "capture.toml is there" if (path / "capture.toml").is_file() else None

    def read(self, path: Path, choices: Choices) -> tuple[Capture, Truth | None]:
        """See :meth:`Reader.read`."""
        file = path / "capture.toml" if path.is_dir() else path
        top = _parse(file)
        files, response, image_notes = _images(top)
        images, camera = top.section("images"), top.section("camera")
        dark = _dark(images, files, response)
        flat = _flat(images, files, response, dark)
        stack, stack_notes = _merged(images, files, response, dark, flat)
        if stack is not files:
            response, dark = LINEAR, None  # it has undone them
        shape = (stack.shape[1], stack.shape[2])
        rig, light_notes = read_lights(top.section("lights"), camera, stack, choices)
        capture = Capture(
            stack=stack,
            rig=rig,
            camera=_camera(camera),
            mask=find_mask(file.parent, shape, _with_mask(choices, top.section("mask").path("file")), ""),
            response=response,
            dark=dark,
            flat=flat,
            radiance_at_white=images.number("radiance_at_white"),
            name=top.text("name") or file.resolve().parent.name,
            notes=(*image_notes, *stack_notes, *light_notes),
        )
        lens = camera.matrix("lens", 1)
        if lens is not None:
            capture = with_lens(capture, Lens(tuple(float(number) for number in lens[:, 0])))
        section = top.section("truth")
        return capture, _truth(section, len(stack), shape) if choices.truth else None


def _parse(file: Path) -> Section:
    raw = read_bytes(file).tobytes()
    try:
        values = tomllib.loads(raw.decode("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UnreadableFileError(
            given=f"{file} is not valid TOML: {error}.",
            needed='Lines such as name = "cat", below headings such as [images], in UTF-8.',
            remedy="Correct that place; Windows paths want single quotation marks or forward slashes.",
        ) from None
    top = Section(values, "", file)
    top.allow(_KEYS[""])
    for name, keys in _KEYS.items():
        if name:
            top.section(name).allow(keys)
    return top


def _images(top: Section) -> tuple[FileStack, Response, tuple[str, ...]]:
    section = top.section("images")
    files, pattern = section.values.get("files"), section.text("pattern")
    if (files is None) == (pattern is None):
        raise InputError(
            given=f"[images] in {top.file.name} has {'neither files nor pattern' if files is None else 'both'}.",
            needed="The images are a list of files or a pattern.",
            remedy='Write files = ["a.png", "b.png"] or pattern = "img_*.png", one of the two.',
        )
    notes: tuple[str, ...] = ()
    if pattern is not None:
        paths, notes = _by_pattern(top, pattern)
    elif isinstance(files, list) and files and all(isinstance(name, str) and name for name in files):
        matches = match_files(top.file.parent, files, f"images.files in {top.file.name}")
        paths, notes = matches.paths, matches.notes
    else:
        raise section.wrong("files", "a list of file names in quotation marks")
    stack = FileStack(paths, white=section.number("white_level"))
    return stack, read_response(section), notes


def _by_pattern(top: Section, pattern: str) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    folder = top.file.parent
    truths = (("truth", "normals"), ("truth", "depth"), ("truth", "albedo"))
    used = (("mask", "file"), ("images", "dark"), ("images", "dark_linear"), *truths)
    flats = {path.resolve() for path in _flat_paths(top.section("images"))}
    others = flats | {p.resolve() for name, key in used if (p := top.section(name).path(key)) is not None}
    try:
        fits = [p for p in folder.glob(pattern) if p.is_file() and p.suffix.lower() in IMAGE_SUFFIXES]
    except (NotImplementedError, ValueError) as error:
        raise top.section("images").wrong("pattern", f"a pattern relative to the file ({error})") from None
    paths = natural_order(p for p in fits if p.resolve() not in others)
    if not paths:
        raise MissingFileError(
            given=f"No image in {folder} fits the pattern {pattern!r} of {top.file.name}.",
            needed="At least three images.",
            remedy="Correct the pattern; * stands for any letters.",
        )
    left = len(fits) - len(paths)
    note = f"The pattern {pattern!r} also fits the mask, the dark image or the truth, which were left out ({left})."
    return tuple(paths), (note,) if left else ()


def _camera(section: Section) -> Camera:
    kind = section.choice("type", ("orthographic", "pinhole"))
    matrix = section.matrix("K", 3)
    pinhole = kind == "pinhole" or (kind is None and matrix is not None)
    surplus = [key for key in (("pixel_size", "unit") if pinhole else ("K", "lens")) if key in section.values]
    if surplus or (pinhole and matrix is None):
        raise OptionError(
            given=f"The {'pinhole' if pinhole else 'orthographic'} camera in {section.file.name} has "
            f"{' and '.join(surplus) or 'no K'}.",
            needed="A pinhole camera has K; an orthographic one may have pixel_size and unit.",
            remedy="Correct [camera].",
        )
    if matrix is not None:
        return Pinhole.from_matrix(matrix)
    size, unit = section.number("pixel_size"), section.text("unit")
    if size is None and unit not in (None, "px"):
        raise section.wrong("unit", "given together with pixel_size", "Add pixel_size, or take unit out.")
    return Orthographic(pixel_size=size or 1.0, length_unit=unit or ("px" if size is None else "relative"))


def _with_mask(choices: Choices, own: Path | None) -> Choices:
    """Return the choices with the description's own mask where none was chosen."""
    if own is None or choices.mask is not None or choices.ignore_mask:
        return choices
    return replace(choices, mask=own)


def _dark(section: Section, stack: FileStack, response: Response) -> FloatArray | None:
    image, linear = section.path("dark"), section.path("dark_linear")
    if image is not None and linear is not None:
        raise OptionError(
            given=f"[images] in {section.file.name} has dark and dark_linear.",
            needed="There is one dark image.",
            remedy="Keep one of them.",
        )
    if linear is not None:
        return checked_dark(read_linear_dark(linear, stack), linear)
    return None if image is None else read_dark(image, stack, response)


def _flat_paths(section: Section) -> tuple[Path, ...]:
    """Return the flat frames that are named, one or one a light."""
    value = section.values.get("flat")
    if value is None:
        return ()
    names = value if isinstance(value, list) else [value]
    if not names or not all(isinstance(name, str) and name for name in names):
        raise section.wrong("flat", "the name of an image of a white card, or a list of as many as there are lights")
    return tuple(section.file.parent / name for name in names)


def _flat(section: Section, files: FileStack, response: Response, dark: FloatArray | None) -> FlatField | None:
    paths = _flat_paths(section)
    times = section.matrix("exposures", 1)
    first = files if times is None else FileStack(files.paths[:: len(times)], white=section.number("white_level"))
    return read_flat(paths, first, response=response, dark=dark) if paths else None


def _merged(
    section: Section, files: FileStack, response: Response, dark: FloatArray | None, flat: FlatField | None
) -> tuple[ImageStack, tuple[str, ...]]:
    """Return one image a light where there are several exposures, or several lights at once; and what that assumes."""
    matrix, times = section.matrix("mixing"), section.matrix("exposures", 1)
    if matrix is None and times is None:
        return files, ()
    clash = ("mixing" if matrix is not None else "", "dark" if dark is not None else "", "flat" if flat else "")
    if times is None and not flat:
        return _unmixed(section, files, response, dark)
    if times is None or matrix is not None or dark is not None:
        raise OptionError(
            given=f"[images] in {section.file.name} has {'exposures' if times is not None else ''} "
            f"{' '.join(filter(None, clash))}.",
            needed="Exposures without mixing and dark image, mixing without flat field.",
            remedy="Merge or correct the photographs beforehand, or leave one of them out.",
        )
    count = len(times)
    if len(files.paths) % count:
        raise InputError(
            given=f"There are {len(files.paths)} photographs and {count} exposure times.",
            needed="All exposures of the first light, then all of the second, and so on.",
            remedy="Check for missing or extra photographs.",
        )
    white = section.number("white_level")
    sources = tuple(FileStack(files.paths[one::count], white=white) for one in range(count))
    note = f"{count} exposures of each light are merged by their noise; values are light, clipped ones left out."
    return BracketStack(sources, times[:, 0], response=response), (note,)


def _unmixed(
    section: Section, files: FileStack, response: Response, dark: FloatArray | None
) -> tuple[ImageStack, tuple[str, ...]]:
    """Return one image a light where several lights shine at once, and what that assumes."""
    matrix = section.matrix("mixing")
    if matrix is None:
        return files, ()
    mixing = Mixing(matrix)
    notes: tuple[str, ...] = (
        f"{len(matrix)} coloured lights shine at once. The surface is taken to have one colour, that of the surface on "
        "which the mixing was measured; a change of colour would be taken for shape.",
        f"Telling the lights apart makes the noise {float(mixing.noise_gain.max()):.2g} times as large.",
    )
    if dark is not None:
        notes = (*notes, "The dark image was subtracted before the lights were told apart.")
    return UnmixedStack(files, mixing, response=response, dark=dark), notes


def _truth(section: Section, count: int, shape: tuple[int, int]) -> Truth | None:
    normals, depth = section.path("normals"), section.path("depth")
    albedo, visibility = section.path("albedo"), section.path("visibility")
    convention = section.choice("convention", tuple(CONVENTIONS)) or "opengl"
    if all(path is None for path in (normals, depth, albedo, visibility)):
        return None
    return Truth(
        normals=None if normals is None else read_true_normals(normals, shape, convention=convention),
        depth=None if depth is None else read_depth(depth, shape),
        albedo=None if albedo is None else read_true_albedo(albedo, shape),
        visibility=None if visibility is None else read_true_visibility(visibility, count, shape),
        source=section.file.name,
    )
