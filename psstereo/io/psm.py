"""The layout of the University of Washington's photometric-stereo images (psmImages)."""

import re
from pathlib import Path
from typing import ClassVar

from psstereo.capture import Capture, Truth
from psstereo.errors import InputError, MissingFileError, UnreadableFileError
from psstereo.io.distant_lights import distant_rig
from psstereo.io.image_names import base_name, match_files
from psstereo.io.light_file import read_directions
from psstereo.io.parts import find_camera, find_mask, images_in, natural_order
from psstereo.io.reader import Choices, Reader
from psstereo.io.text import read_lines
from psstereo.stack import FileStack
from psstereo.stack.decode import IMAGE_SUFFIXES

__all__ = ["Psm"]


class Psm(Reader):
    """``NAME/NAME.0.png …`` with ``NAME.mask.png`` and ``lights.txt`` there or one folder up; or the list ``NAME.txt``.

    The mask's soft edges are cut at half brightness. All lights count as equally strong.
    """

    name: ClassVar[str] = "psm"
    summary: ClassVar[str] = "NAME/NAME.0.png … NAME.mask.png and lights.txt there or above; or the list NAME.txt"

    def recognise(self, path: Path) -> str | None:
        """See :meth:`Reader.recognise`."""
        if path.is_file():
            listed = path.suffix.lower() == ".txt" and _is_list(path) and _lights(path.parent) is not None
            return "it is a list of images with a count above them, and lights.txt is there" if listed else None
        groups, lights = _groups(path), _lights(path)
        if lights is None or not groups:
            return None
        name = _group_name(path, groups)
        where = "beside them" if lights.parent == path else "one folder up"
        return f"images {name or next(iter(groups))}.0 … and lights.txt {where}"

    def read(self, path: Path, choices: Choices) -> tuple[Capture, Truth | None]:
        """See :meth:`Reader.read`."""
        folder = path if path.is_dir() else path.parent
        files, mask, notes = _from_folder(path) if path.is_dir() else _from_list(path)
        stack = FileStack(files)
        lights = _lights(folder)
        if lights is None and choices.lights is None and not choices.unknown_lights:
            raise MissingFileError(
                given=f"There is no lights.txt in {folder} or one folder up.",
                needed="It says where the lights were: their number, then x y z a line.",
                remedy="Copy it there, or name another file with --lights.",
            )
        own = lights or folder / "lights.txt"
        rig, light_notes = distant_rig(
            stack, choices, lambda: read_directions(own, len(stack), layout=choices.lights_layout), own.name
        )
        others = [p.name for p in natural_order(own.parent.glob("lights*.txt")) if p != own]
        if others and choices.lights is None:
            light_notes = (*light_notes, f"{own.name} was used; {', '.join(others)} lies there too and was not.")
        camera, camera_notes = find_camera(folder)
        capture = Capture(
            stack=stack,
            rig=rig,
            camera=camera,
            mask=find_mask(mask.parent, (stack.shape[1], stack.shape[2]), choices, mask.name),
            name=path.resolve().stem,
            notes=(*notes, *light_notes, *camera_notes),
        )
        return capture, None


def _lights(folder: Path) -> Path | None:
    places = (folder / "lights.txt", folder.resolve().parent / "lights.txt")
    return next((path for path in places if path.is_file()), None)


def _groups(folder: Path) -> dict[str, list[Path]]:
    """Return images NAME.K.png by NAME, each list in natural order."""
    groups: dict[str, list[Path]] = {}
    for path in images_in(folder):
        match = re.fullmatch(r"(.+)\.(\d+)", path.stem)
        if match:
            groups.setdefault(match[1], []).append(path)
    return groups


def _group_name(folder: Path, groups: dict[str, list[Path]]) -> str | None:
    """Return the name of the images: the folder's own, or the only one."""
    own = folder.resolve().name
    if own in groups:
        return own
    return next(iter(groups)) if len(groups) == 1 else None


def _from_folder(folder: Path) -> tuple[tuple[Path, ...], Path, tuple[str, ...]]:
    """Return images, where the mask would be, and notes."""
    groups = _groups(folder)
    name = _group_name(folder, groups)
    if name is None:
        raise InputError(
            given=f"{folder} holds "
            + (
                f"images of {len(groups)} names: {', '.join(list(groups)[:5])}." if groups else "no images NAME.0.png …"
            ),
            needed="Images NAME.0.png, NAME.1.png … of one name make a capture.",
            remedy="Put each object into a folder of its name, or name the list NAME.txt.",
        )
    files = groups[name]
    numbers = [int(path.stem.rpartition(".")[2]) for path in files]
    if len(set(numbers)) != len(numbers):
        raise InputError(
            given=f"{folder} holds images of {name} with the same number, such as {files[0].name} and {files[1].name}.",
            needed="One image for each number.",
            remedy="Move the copies of another kind to another folder.",
        )
    masks = [p for p in images_in(folder) if p.stem == f"{name}.mask"]
    mask = masks[0] if masks else folder / f"{name}.mask.png"
    return tuple(files), mask, () if masks else (f"There is no {mask.name}: every pixel counts.",)


def _entries(path: Path) -> tuple[int, list[str]] | None:
    """Return the count and the names of a list, None if the file is no such list."""
    lines = [line.strip() for line in read_lines(path) if line.strip()]
    if len(lines) < 2 or not lines[0].isdecimal():
        return None
    names = lines[1:]
    images = all(Path(base_name(name)).suffix.lower() in IMAGE_SUFFIXES for name in names)
    return (int(lines[0]), names) if images else None


def _is_list(path: Path) -> bool:
    try:
        return _entries(path) is not None
    except OSError:
        return False


def _from_list(path: Path) -> tuple[tuple[Path, ...], Path, tuple[str, ...]]:
    found = _entries(path)
    if found is None or len(found[1]) not in (found[0], found[0] + 1):
        raise UnreadableFileError(
            given=f"{path} has {'no list of images' if found is None else f'{len(found[1])} names'}"
            + ("." if found is None else f" below the number {found[0]}."),
            needed="The number of images, then one image a line, then the mask.",
            remedy="Correct the number or the lines.",
        )
    count, names = found
    matches = match_files(path.parent, names, path.name)
    masked = len(names) > count
    mask = matches.paths[count] if masked else path.parent / f"{path.stem}.mask.png"
    note = () if masked or mask.is_file() else (f"{path.name} names no mask: every pixel counts.",)
    return matches.paths[:count], mask, (*matches.notes, *note)
