"""The folders of SDM-UniPS and LINO-UniPS, which need no lights."""

import re
from pathlib import Path
from typing import ClassVar

from psstereo.capture import Capture, Truth
from psstereo.errors import MissingFileError
from psstereo.io.diligent import light_intensities
from psstereo.io.distant_lights import distant_rig
from psstereo.io.light_file import read_directions
from psstereo.io.parts import find_camera, find_mask, images_in, read_true_normals
from psstereo.io.reader import Choices, Reader
from psstereo.stack import FileStack

__all__ = ["SdmUniPs"]

_IMAGE = re.compile(r"L[ _-]?\(?\d")
_TRUTH = ("Normal_gt.png", "normal.tif")
_LISTS = ("filenames.txt", "names.txt")
_OTHER = ("mask", "normal", "albedo", "depth", "dark", "ambient")


class SdmUniPs(Reader):
    """``NAME.data`` with images ``L*``, ``mask.png``, and ``Normal_gt.png`` or ``normal.tif`` where the truth is known.

    The method that this layout is made for needs no lights, and others do: they are read from
    ``light_directions.txt`` and ``light_intensities.txt``, which that program skips, or from the file that was chosen.
    """

    name: ClassVar[str] = "sdm-unips"
    summary: ClassVar[str] = "L_1.png … (+ mask.png, Normal_gt.png; SDM-UniPS) with light_directions.txt or --lights"

    def recognise(self, path: Path) -> str | None:
        """See :meth:`Reader.recognise`."""
        if any((path / name).is_file() for name in _LISTS) or not _images(path):
            return None
        if any(not _IMAGE.match(p.name) and not p.stem.lower().startswith(_OTHER) for p in images_in(path)):
            return None
        if path.suffix == ".data":
            return "the folder's name ends in .data and its images' names begin with L"
        signs = [name for name in ("light_directions.txt", *_TRUTH) if (path / name).is_file()]
        return f"{signs[0]} lies beside images whose names begin with L" if signs else None

    def read(self, path: Path, choices: Choices) -> tuple[Capture, Truth | None]:
        """See :meth:`Reader.read`."""
        files, lights = _images(path), path / "light_directions.txt"
        if not files:
            raise MissingFileError(
                given=f"There are no images L_1.png … in {path}.",
                needed="Names of images begin with L and a number.",
                remedy="Name the folder NAME.data itself.",
            )
        if choices.lights is None and not lights.is_file():
            raise MissingFileError(
                given=f"{path} has no lights: the layout of SDM-UniPS holds none.",
                needed="A light direction for each image.",
                remedy="Name a file of light directions with --lights, or put light_directions.txt there.",
            )
        stack = FileStack(files)
        strengths, notes = light_intensities(path / "light_intensities.txt", stack)
        rig, light_notes = distant_rig(
            stack,
            choices,
            lambda: read_directions(lights, len(stack), layout=choices.lights_layout or "rows"),
            lights.name,
            strengths=strengths,
            strengths_source="light_intensities.txt",
        )
        shape = (stack.shape[1], stack.shape[2])
        camera, camera_notes = find_camera(path)
        capture = Capture(
            stack=stack,
            rig=rig,
            camera=camera,
            mask=find_mask(path, shape, choices),
            name=path.resolve().name.removesuffix(".data"),
            notes=(*light_notes, *notes, *camera_notes),
        )
        known = next((path / name for name in _TRUTH if (path / name).is_file()), None)
        if known is None or not choices.truth:
            return capture, None
        return capture, Truth(normals=read_true_normals(known, shape), source=known.name)


def _images(path: Path) -> tuple[Path, ...]:
    return tuple(p for p in images_in(path) if _IMAGE.match(p.name))
