"""The layout of the DiLiGenT benchmark, which many tools write."""

from pathlib import Path
from typing import ClassVar

import numpy as np

from psstereo.capture import Capture, Truth
from psstereo.errors import InputError
from psstereo.io.light_file import read_directions
from psstereo.io.normal_map import read_normal_map
from psstereo.io.parts import find_camera, find_depth, find_mask, images_in, require_files
from psstereo.io.reader import Choices, Reader
from psstereo.io.text import read_lines, read_table
from psstereo.lights import Rig
from psstereo.stack import FileStack, ImageStack
from psstereo.types import FloatArray

__all__ = ["Diligent"]


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
        if (path / "filenames.txt").is_file():
            return "filenames.txt and light_directions.txt are there"
        return "light_directions.txt lies beside images" if _images(path) else None

    def read(self, path: Path, choices: Choices) -> tuple[Capture, Truth | None]:
        """See :meth:`Reader.read`."""
        listed = path / "filenames.txt"
        if listed.is_file():
            names = [line.strip() for line in read_lines(listed) if line.strip()]
            files = require_files([path / name for name in names], "filenames.txt")
        else:
            files = tuple(_images(path))
        stack = FileStack(files)
        lights = choices.lights or path / "light_directions.txt"
        directions = read_directions(lights, len(stack), layout=choices.lights_layout)
        strengths, notes = _intensities(path / "light_intensities.txt", stack)
        camera, camera_notes = find_camera(path)
        shape = (stack.shape[1], stack.shape[2])
        capture = Capture(
            stack=stack,
            rig=Rig.distant(directions.vectors, strengths, source=lights.name),
            camera=camera,
            mask=find_mask(path, shape, choices),
            name=path.resolve().name,
            notes=(*directions.notes, *notes, *camera_notes, *_near_note(path)),
        )
        return capture, _truth(path, shape)


def _images(path: Path) -> list[Path]:
    known = ("mask", "normal", "albedo", "depth")
    return [p for p in images_in(path) if not p.stem.lower().startswith(known)]


def _intensities(path: Path, stack: ImageStack) -> tuple[FloatArray | None, tuple[str, ...]]:
    if not path.is_file():
        return None, ("No light_intensities.txt: all lights are taken to be equally strong.",)
    values = read_table(path).values
    if values.shape[0] != len(stack) and values.shape[1] == len(stack):
        values = values.T
    if values.shape[1] == 3 and stack.shape[3] == 1:
        same = np.allclose(values, values[:, :1])
        note = "The images are gray and the light intensities coloured: the mean of R, G and B is taken."
        return values.mean(axis=1, keepdims=True), () if same else (note,)
    return values, ()


def _near_note(path: Path) -> tuple[str, ...]:
    if not (path / "light_positions.txt").is_file():
        return ()
    return ("light_positions.txt says that the lights are near; they are taken as distant here.",)


def _truth(path: Path, shape: tuple[int, int]) -> Truth | None:
    depth = find_depth(path, shape)
    for name in ("Normal_gt.mat", "Normal_gt.npy", "Normal_gt.png"):
        if (path / name).is_file():
            found = read_normal_map(path / name)
            if found.normals.shape[:2] != shape:
                raise InputError(
                    given=f"{name} is {found.normals.shape[1]} × {found.normals.shape[0]} pixels.",
                    needed=f"The images are {shape[1]} × {shape[0]}.",
                    remedy="Take it out of the folder if it belongs to other images.",
                )
            return Truth(normals=found.normals, depth=depth, source=name)
    return None if depth is None else Truth(depth=depth, source="depth_gt")
