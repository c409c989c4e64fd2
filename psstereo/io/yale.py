"""The layout of the Yale Face Database B: the lights' angles stand in the file names."""

import re
from pathlib import Path
from typing import ClassVar

import numpy as np

from psstereo.capture import Capture, Truth
from psstereo.errors import InputError
from psstereo.io.distant_lights import distant_rig
from psstereo.io.light_file import Directions
from psstereo.io.parts import find_mask, images_in, read_dark
from psstereo.io.reader import Choices, Reader
from psstereo.stack import FileStack
from psstereo.types import FloatArray

__all__ = ["YaleB"]

_NAME = re.compile(r"(?P<subject>.+)_P(?P<pose>\d+)A(?P<azimuth>[+-]\d+)E(?P<elevation>[+-]\d+)", re.IGNORECASE)


class YaleB(Reader):
    """``SUBJECT_P00A+035E+40.pgm …`` and ``SUBJECT_P00_Ambient.pgm``, which is subtracted.

    Positive azimuth lights the left of the picture: l = (−sin A cos E, sin E, cos A cos E). Lights behind the face are
    kept. All lights count as equally strong.
    """

    name: ClassVar[str] = "yale"
    summary: ClassVar[str] = "SUBJECT_P00A+035E+40.pgm … (angles in the names), SUBJECT_P00_Ambient.pgm as dark image"

    def recognise(self, path: Path) -> str | None:
        """See :meth:`Reader.recognise`."""
        count = sum(len(files) for files in _groups(path).values())
        return f"{count} images have the angles of their light in their names (P00A…E…)" if count >= 3 else None

    def read(self, path: Path, choices: Choices) -> tuple[Capture, Truth | None]:
        """See :meth:`Reader.read`."""
        groups = _groups(path)
        if len(groups) != 1:
            raise InputError(
                given=f"{path} holds "
                + (
                    f"images of {len(groups)} subjects or poses: {', '.join(list(groups)[:5])}."
                    if groups
                    else "no images with angles in their names."
                ),
                needed="A capture is one subject in one pose, such as yaleB01_P00.",
                remedy="Put each into a folder of its own.",
            )
        series, files = next(iter(groups.items()))
        stack = FileStack(tuple(files))
        note = "The lights' angles were read from the file names; positive azimuth lights the left."
        rig, notes = distant_rig(
            stack, choices, lambda: Directions(_directions(files), (note,)), "the angles in the file names"
        )
        ambient = [p for p in images_in(path) if p.stem.lower() == f"{series}_ambient".lower()]
        said = f"{ambient[0].name} is subtracted." if ambient else f"There is no {series}_Ambient.pgm to subtract."
        capture = Capture(
            stack=stack,
            rig=rig,
            mask=find_mask(path, (stack.shape[1], stack.shape[2]), choices),
            dark=read_dark(ambient[0], stack) if ambient else None,
            name=path.resolve().name,
            notes=(*notes, said),
        )
        return capture, None


def _groups(folder: Path) -> dict[str, list[Path]]:
    """Return images by subject and pose, each list in natural order."""
    groups: dict[str, list[Path]] = {}
    for path in images_in(folder):
        match = _NAME.fullmatch(path.stem)
        if match:
            groups.setdefault(f"{match['subject']}_P{match['pose']}", []).append(path)
    return groups


def _directions(files: list[Path]) -> FloatArray:
    matches = [_NAME.fullmatch(path.stem) for path in files]
    angles = np.array([[float(m["azimuth"]), float(m["elevation"])] for m in matches if m is not None])
    azimuth, elevation = np.deg2rad(angles).T
    level = np.cos(elevation)
    return np.stack([-np.sin(azimuth) * level, np.sin(elevation), np.cos(azimuth) * level], axis=1)
