"""The course layout ``input_N.tif`` with ``sources.npy``."""

import re
from pathlib import Path
from typing import ClassVar

from psstereo.capture import Capture, Truth
from psstereo.errors import MissingFileError
from psstereo.io.conventions import to_canonical
from psstereo.io.distant_lights import distant_rig
from psstereo.io.light_file import Directions, read_directions
from psstereo.io.parts import find_camera, find_mask, images_in
from psstereo.io.reader import Choices, Reader
from psstereo.stack import FileStack

__all__ = ["Face16"]


class Face16(Reader):
    """``input_1.tif …`` of 16 bits and ``sources.npy`` (m, 3) in a frame of x right, y down, z into the scene.

    The vectors' lengths are imprecision rather than strength; only their directions count.
    """

    name: ClassVar[str] = "face16"
    summary: ClassVar[str] = "input_1.tif … and sources.npy (m, 3: x right, y down, z into the scene)"

    def recognise(self, path: Path) -> str | None:
        """See :meth:`Reader.recognise`."""
        there = (path / "sources.npy").is_file() and _images(path)
        return "input_N.tif and sources.npy are there" if there else None

    def read(self, path: Path, choices: Choices) -> tuple[Capture, Truth | None]:
        """See :meth:`Reader.read`."""
        files = _images(path)
        if not files:
            raise MissingFileError(
                given=f"There are no images input_1.tif … in {path}.",
                needed="The images lie beside sources.npy.",
                remedy="Name the folder that holds both.",
            )
        stack = FileStack(files)
        shape = (stack.shape[1], stack.shape[2])

        def own() -> Directions:
            found = read_directions(path / "sources.npy", len(stack), layout=choices.lights_layout)
            note = "sources.npy was read as x right, y down, z into the scene; y and z were negated."
            return Directions(to_canonical(found.vectors, "opencv"), (*found.notes, note))

        rig, notes = distant_rig(stack, choices, own, "sources.npy")
        camera, camera_notes = find_camera(path)
        capture = Capture(
            stack=stack,
            rig=rig,
            camera=camera,
            mask=find_mask(path, shape, choices),
            name=path.resolve().name,
            notes=(*notes, *camera_notes),
        )
        return capture, None


def _images(path: Path) -> tuple[Path, ...]:
    return tuple(p for p in images_in(path) if re.fullmatch(r"input_\d+\.tiff?", p.name, re.IGNORECASE))
