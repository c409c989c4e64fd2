"""The folders of Meshroom's photometric stereo."""

from pathlib import Path
from typing import ClassVar

from psstereo.capture import Capture, Truth
from psstereo.errors import InputError, MissingFileError
from psstereo.io.conventions import to_canonical
from psstereo.io.diligent import light_intensities
from psstereo.io.distant_lights import chosen_directions, distant_rig
from psstereo.io.light_file import Directions, read_directions
from psstereo.io.parts import find_camera, find_mask, images_in, read_dark
from psstereo.io.reader import Choices, Reader
from psstereo.io.text import read_table
from psstereo.stack import FileStack
from psstereo.types import FloatArray

__all__ = ["Meshroom"]

_PICTURES = "PS_Pictures"


class Meshroom(Reader):
    """``PS_Pictures`` with ``light_directions.txt`` and ``light_intensities.txt``, or with ``lights.json``.

    Directions are in Meshroom's frame, x right, y down, z into the scene, after ``convertionMatrix.txt``, which is
    multiplied onto each if it is there. A picture whose name contains "ambient" is subtracted.
    """

    name: ClassVar[str] = "meshroom"
    summary: ClassVar[str] = "PS_Pictures/*.png with light_directions.txt (+ convertionMatrix.txt) or lights.json"

    def recognise(self, path: Path) -> str | None:
        """See :meth:`Reader.recognise`."""
        lights = _lights(path)
        return f"{lights.name} and {_PICTURES} are there" if lights and _pictures(path)[0] else None

    def read(self, path: Path, choices: Choices) -> tuple[Capture, Truth | None]:
        """See :meth:`Reader.read`."""
        files, ambient = _pictures(path)
        lights = _lights(path)
        if not files or (lights is None and choices.lights is None):
            raise MissingFileError(
                given=f"{path / _PICTURES} holds {len(files)} pictures, and there is "
                f"{'no file of lights' if lights is None else lights.name}.",
                needed="Both; lights are in light_directions.txt or lights.json.",
                remedy="Name the folder that holds them, or give the lights with --lights.",
            )
        stack = FileStack(files)
        strengths, notes = light_intensities(path / "light_intensities.txt", stack)
        source = lights or path / "light_directions.txt"
        if source.suffix == ".json":
            strengths, notes = None, ()
        rig, light_notes = distant_rig(
            stack,
            choices,
            lambda: _directions(source, stack.names),
            source.name,
            strengths=strengths,
            strengths_source="light_intensities.txt",
        )
        camera, camera_notes = find_camera(path)
        capture = Capture(
            stack=stack,
            rig=rig,
            camera=camera,
            mask=find_mask(path, (stack.shape[1], stack.shape[2]), choices),
            dark=None if ambient is None else read_dark(ambient, stack),
            name=path.resolve().name,
            notes=(
                *light_notes,
                *notes,
                *(() if ambient is None else (f"{ambient.name} is subtracted.",)),
                *camera_notes,
            ),
        )
        return capture, None


def _pictures(path: Path) -> tuple[tuple[Path, ...], Path | None]:
    """Return the pictures, and the ambient one."""
    found = images_in(path / _PICTURES)
    ambient = [p for p in found if "ambient" in p.stem.lower()]
    pictures = tuple(p for p in found if p not in ambient and not p.stem.lower().startswith("mask"))
    return pictures, ambient[0] if ambient else None


def _lights(path: Path) -> Path | None:
    known = (path / "light_directions.txt", path / "lights.json")
    return next((file for file in known if file.is_file()), None)


def _directions(source: Path, names: tuple[str, ...]) -> Directions:
    if source.suffix == ".json":
        found = chosen_directions(Choices(lights=source), names)
        assert found is not None
        return found
    own = read_directions(source, len(names), layout="rows")
    matrix = source.with_name("convertionMatrix.txt")
    turned = own.vectors @ _matrix(matrix).T if matrix.is_file() else own.vectors
    return Directions(to_canonical(turned, "meshroom"), own.notes)


def _matrix(path: Path) -> FloatArray:
    values = read_table(path).values
    if values.shape != (3, 3):
        raise InputError(
            given=f"{path} holds {values.shape[0]} rows of {values.shape[1]} numbers.",
            needed="It turns directions into Meshroom's frame: three rows of three numbers.",
            remedy="Correct it, or take it out if the directions are in that frame already.",
        )
    return values
