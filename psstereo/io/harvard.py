"""The layout of PSBox and the Harvard photometric-stereo set."""

from pathlib import Path
from typing import ClassVar

import numpy as np

from psstereo.capture import Capture, Truth
from psstereo.errors import InputError, MissingFileError
from psstereo.io.distant_lights import distant_rig
from psstereo.io.light_file import Directions, as_rows
from psstereo.io.parts import find_camera, find_mask, images_in
from psstereo.io.reader import Choices, Reader
from psstereo.io.text import read_table
from psstereo.stack import FileStack
from psstereo.types import FloatArray

__all__ = ["PsBox"]


class PsBox(Reader):
    """``Objects/Image_01.png …`` with ``light_directions.txt`` (3 × m), or ``refined_light.txt`` where it is there.

    A refined light's length is its strength. Without it ``light_strength.txt`` gives the strengths, else all are one.
    """

    name: ClassVar[str] = "psbox"
    summary: ClassVar[str] = "Objects/Image_01.png … and light_directions.txt or refined_light.txt (3 × m)"

    def recognise(self, path: Path) -> str | None:
        """See :meth:`Reader.recognise`."""
        lights = [p.name for p in (_refined(path), _plain(path)) if p.is_file()]
        return f"Objects/Image_*.png and {lights[0]} are there" if lights and _images(path) else None

    def read(self, path: Path, choices: Choices) -> tuple[Capture, Truth | None]:
        """See :meth:`Reader.read`."""
        files = _images(path)
        if not files:
            raise MissingFileError(
                given=f"There are no images Image_01.png … in {path / 'Objects'}.",
                needed="The photographs of the object lie there.",
                remedy="Name the folder above Objects.",
            )
        stack = FileStack(files)
        lights = _refined(path) if _refined(path).is_file() else _plain(path)
        own = _read_lights(lights, len(stack), choices) if choices.lights is None else None
        strengths, notes = _strengths(path, own, len(stack), refined=lights == _refined(path))
        rig, light_notes = distant_rig(
            stack,
            choices,
            lambda: own or Directions(np.zeros((0, 3))),
            lights.name,
            strengths=strengths,
            strengths_source=None if lights == _refined(path) else "light_strength.txt",
        )
        mask = find_mask(path, (stack.shape[1], stack.shape[2]), choices)
        if mask is None and not choices.ignore_mask:
            notes = (*notes, "There is no mask; --mask auto separates the object from a dark background.")
        camera, camera_notes = find_camera(path)
        capture = Capture(
            stack=stack,
            rig=rig,
            camera=camera,
            mask=mask,
            name=path.resolve().name,
            notes=(*light_notes, *notes, *camera_notes),
        )
        return capture, None


def _refined(path: Path) -> Path:
    return path / "refined_light.txt"


def _plain(path: Path) -> Path:
    return path / "light_directions.txt"


def _images(path: Path) -> tuple[Path, ...]:
    return tuple(p for p in images_in(path / "Objects") if p.stem.lower().startswith("image_"))


def _read_lights(path: Path, count: int, choices: Choices) -> Directions:
    table = read_table(path)
    # 3 × 3 numbers fit both readings; in this layout a light is a column.
    layout = choices.lights_layout or ("columns" if table.values.shape == (3, 3) else None)
    found = as_rows(table.values, count, path.name, layout=layout)
    return Directions(found.vectors, (*table.notes, *found.notes))


def _strengths(
    path: Path, own: Directions | None, count: int, *, refined: bool
) -> tuple[FloatArray | None, tuple[str, ...]]:
    """Return strengths (m,) and a note that says where they came from."""
    if own is not None and refined:
        lengths = np.sqrt((own.vectors * own.vectors).sum(axis=1))
        beside = " instead of light_directions.txt" if _plain(path).is_file() else ""
        return lengths, (f"refined_light.txt was used{beside}; the lengths of its vectors are the lights' strengths.",)
    file = path / "light_strength.txt"
    if not file.is_file():
        return None, ("No strengths of the lights are given: all are taken to be equally strong.",)
    values = read_table(file).values.reshape(-1)
    if len(values) != count:
        raise InputError(
            given=f"light_strength.txt holds {len(values)} numbers; there are {count} images.",
            needed="Each image needs one strength.",
            remedy="Check for missing or extra numbers.",
        )
    return values, ("The lights' strengths were read from light_strength.txt.",)
