"""A plain folder of photographs and one file of light directions, which lies there or is chosen."""

from pathlib import Path
from typing import ClassVar

from psstereo.capture import Capture, Truth
from psstereo.errors import InputError, MissingFileError
from psstereo.io.distant_lights import distant_rig
from psstereo.io.light_file import read_directions
from psstereo.io.parts import find_camera, find_dark, find_flat, find_mask, images_in
from psstereo.io.reader import Choices, Reader
from psstereo.stack import FileStack

__all__ = ["ImageFolder"]

_LIGHTS = ("lights.txt", "lights.npy", "light_directions.npy", "light_directions.csv", "light_directions.mat")
_OTHER = ("mask", "normal", "albedo", "depth", "dark", "ambient", "flat")


class ImageFolder(Reader):
    """Photographs in natural order, ``lights.txt`` or its kin; perhaps mask.png, dark.png, flat.png and K.txt.

    Directions are x right, y up, z toward the camera; all lights count as equally strong. Say more in a capture.toml.
    """

    name: ClassVar[str] = "images"
    summary: ClassVar[str] = "a folder of photographs with lights.txt (x y z a line), or with lights named by --lights"

    def recognise(self, path: Path) -> str | None:
        """See :meth:`Reader.recognise`."""
        lights = _lights(path)
        return f"{lights[0].name} lies beside images" if lights and len(_images(path)) >= 3 else None

    def read(self, path: Path, choices: Choices) -> tuple[Capture, Truth | None]:
        """See :meth:`Reader.read`."""
        files, lights = _images(path), _lights(path)
        if not files or not (lights or choices.lights or choices.unknown_lights):
            raise MissingFileError(
                given=f"{path} holds {len(files)} images and {'a' if lights else 'no'} file of light directions.",
                needed=f"Both; the file is one of {', '.join(_LIGHTS)}.",
                remedy="Add it, or name it with --lights.",
            )
        if len(lights) > 1 and choices.lights is None and not choices.unknown_lights:
            raise InputError(
                given=f"{path} has several files of light directions: {', '.join(p.name for p in lights)}.",
                needed="One of them belongs to the images.",
                remedy="Name it with --lights, or move the others away.",
            )
        stack = FileStack(files)
        own = lights[0] if lights else path / _LIGHTS[0]
        rig, notes = distant_rig(
            stack, choices, lambda: read_directions(own, len(stack), layout=choices.lights_layout), own.name
        )
        dark, dark_notes = find_dark(path, stack)
        flat, flat_notes = find_flat(path, stack, dark)
        camera, camera_notes = find_camera(path)
        capture = Capture(
            stack=stack,
            rig=rig,
            camera=camera,
            mask=find_mask(path, (stack.shape[1], stack.shape[2]), choices),
            dark=dark,
            flat=flat,
            name=path.resolve().name,
            notes=(
                f"The images were taken in the order of their names, {files[0].name} to {files[-1].name}.",
                *notes,
                *camera_notes,
                *dark_notes,
                *flat_notes,
            ),
        )
        return capture, None


def _images(path: Path) -> tuple[Path, ...]:
    return tuple(p for p in images_in(path) if not p.stem.lower().startswith(_OTHER))


def _lights(path: Path) -> list[Path]:
    return [path / name for name in _LIGHTS if (path / name).is_file()]
