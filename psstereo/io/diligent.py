"""The layout of the DiLiGenT benchmark, which many tools write."""

from pathlib import Path
from typing import ClassVar

from psstereo.camera import Orthographic
from psstereo.capture import Capture, Truth
from psstereo.errors import InputError, MissingFileError
from psstereo.io.distant_lights import distant_rig
from psstereo.io.image_names import match_files
from psstereo.io.light_file import read_directions
from psstereo.io.parts import (
    channel_values,
    find_camera,
    find_dark,
    find_depth,
    find_mask,
    images_in,
    read_true_normals,
)
from psstereo.io.reader import Choices, Reader
from psstereo.io.text import read_lines, read_table
from psstereo.stack import FileStack, ImageStack
from psstereo.types import FloatArray

__all__ = ["Diligent", "light_intensities", "listed_images", "true_surface"]

_LISTS = ("filenames.txt", "names.txt")
"""Lists of images: DiLiGenT's own, and that of SDPS-Net and PS-FCN."""


class Diligent(Reader):
    """``filenames.txt``, ``light_directions.txt``, ``light_intensities.txt``, ``mask.png``, ``Normal_gt.mat``.

    The images are linear; each channel is divided by the intensity of its light in that channel, R first, although
    OpenCV reads B first. Without ``filenames.txt`` all images of the folder but the mask count, in natural order.
    """

    name: ClassVar[str] = "diligent"
    summary: ClassVar[str] = "light_directions.txt (+ light_intensities.txt, filenames.txt, mask.png, Normal_gt.mat)"

    def recognise(self, path: Path) -> str | None:
        """See :meth:`Reader.recognise`."""
        if not (path / "light_directions.txt").is_file():
            return None
        for name in _LISTS:
            if (path / name).is_file():
                return f"{name} and light_directions.txt are there"
        return "light_directions.txt lies beside images" if _images(path) else None

    def read(self, path: Path, choices: Choices) -> tuple[Capture, Truth | None]:
        """See :meth:`Reader.read`."""
        stack, name_notes = listed_images(path)
        count = len(stack)
        strengths, notes = light_intensities(path / "light_intensities.txt", stack)
        rig, light_notes = distant_rig(
            stack,
            choices,
            lambda: read_directions(path / "light_directions.txt", count, layout=choices.lights_layout),
            "light_directions.txt",
            strengths=strengths,
            strengths_source="light_intensities.txt",
        )
        dark, dark_notes = find_dark(path, stack)
        camera, camera_notes = find_camera(path)
        shape = (stack.shape[1], stack.shape[2])
        truth = true_surface(path, shape) if choices.truth else None
        if truth is not None and truth.depth is not None and isinstance(camera, Orthographic):
            camera_notes = ("The true depth is in a unit of its own; the size of a pixel on the object is unknown.",)
        capture = Capture(
            stack=stack,
            rig=rig,
            camera=camera,
            mask=find_mask(path, shape, choices),
            dark=dark,
            name=path.resolve().name,
            notes=(*name_notes, *light_notes, *notes, *dark_notes, *camera_notes, *_near_note(path)),
        )
        return capture, truth


def listed_images(path: Path) -> tuple[FileStack, tuple[str, ...]]:
    """Return the images of ``filenames.txt`` or ``names.txt``; without a list, all but mask, truth and dark image."""
    listed = next((path / name for name in _LISTS if (path / name).is_file()), None)
    if listed is None:
        found = tuple(_images(path))
        if not found:
            raise MissingFileError(
                given=f"There are no images in {path}.",
                needed="The photographs lie beside light_directions.txt.",
                remedy="Name the folder that holds the images.",
            )
        return FileStack(found), ()
    names = [line.strip() for line in read_lines(listed) if line.strip()]
    matches = match_files(path, names, listed.name)
    return FileStack(matches.paths), matches.notes


def _images(path: Path) -> list[Path]:
    known = ("mask", "normal", "albedo", "depth", "dark", "ambient")
    return [p for p in images_in(path) if not p.stem.lower().startswith(known)]


def light_intensities(path: Path, stack: ImageStack) -> tuple[FloatArray | None, tuple[str, ...]]:
    """Return strengths (m, c) from a file with one row a light, None if it is not there, and notes."""
    if not path.is_file():
        return None, (f"No {path.name}: all lights are taken to be equally strong.",)
    table = read_table(path)
    values = table.values
    if values.shape[0] != len(stack) and values.shape[1] == len(stack):
        values = values.T
    if len(values) != len(stack) or values.shape[1] not in (1, stack.shape[3], 3):
        raise InputError(
            given=f"{path.name} holds {values.shape[0]} rows of {values.shape[1]} numbers; "
            f"there are {len(stack)} images of {stack.shape[3]} channels.",
            needed="Each image needs one row with one strength, or one for each channel.",
            remedy="Check for missing or extra rows.",
        )
    values, notes = channel_values(values, stack.shape[3], "light intensities")
    return values, (*table.notes, *notes)


def _near_note(path: Path) -> tuple[str, ...]:
    if not (path / "light_positions.txt").is_file():
        return ()
    return ("light_positions.txt says that the lights are near; they are taken as distant here.",)


def true_surface(path: Path, shape: tuple[int, int]) -> Truth | None:
    """Return the true normals and depth that lie in the folder, None if there are none."""
    depth = find_depth(path, shape)
    for name in ("Normal_gt.mat", "Normal_gt.npy", "Normal_gt.png"):
        if (path / name).is_file():
            return Truth(normals=read_true_normals(path / name, shape), depth=depth, source=name)
    return None if depth is None else Truth(depth=depth, source="depth_gt")
