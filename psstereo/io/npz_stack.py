"""Images in one ``.npz`` file, with ``lights.npy`` beside it."""

import zipfile
from pathlib import Path
from typing import ClassVar

import numpy as np

from psstereo.capture import Capture, Truth
from psstereo.errors import InputError, UnreadableFileError
from psstereo.io.distant_lights import distant_rig
from psstereo.io.light_file import read_directions
from psstereo.io.parts import find_camera, find_depth, find_mask, first_by_name, natural_order, read_true_normals
from psstereo.io.reader import Choices, Reader
from psstereo.stack import MemoryStack
from psstereo.stack.decode import read_bytes
from psstereo.types import Array

__all__ = ["NpzStack"]


class NpzStack(Reader):
    """``NAME.npz`` with ``images`` (m, h, w[, c]), ``lights.npy`` (m, 3), and perhaps ``mask.png``, ``gt_normal.npy``.

    Floating-point images have no full scale. The file is decoded whole when it is read.
    """

    name: ClassVar[str] = "npz"
    summary: ClassVar[str] = "NAME.npz with images (m, h, w[, c]) and lights.npy (+ mask.png, gt_normal.npy)"

    def recognise(self, path: Path) -> str | None:
        """See :meth:`Reader.recognise`."""
        folder = path if path.is_dir() else path.parent
        found = _stacks(folder) if path.is_dir() else [path] if _is_stack(path) else []
        there = found and (folder / "lights.npy").is_file()
        return f"{found[0].name} holds images, and lights.npy is there" if there else None

    def read(self, path: Path, choices: Choices) -> tuple[Capture, Truth | None]:
        """See :meth:`Reader.read`."""
        file, notes = (
            first_by_name(_stacks(path), path, ".npz file with an array images") if path.is_dir() else (path, ())
        )
        folder = file.parent
        images = _load(file)
        try:
            stack = MemoryStack(images, names=tuple(f"{file.name} image {i + 1}" for i in range(len(images))))
        except InputError as error:
            raise InputError(given=f"{file.name}: {error.given}", needed=error.needed, remedy=error.remedy) from None
        rig, light_notes = distant_rig(
            stack,
            choices,
            lambda: read_directions(folder / "lights.npy", len(stack), layout=choices.lights_layout),
            "lights.npy",
        )
        shape = (stack.shape[1], stack.shape[2])
        camera, camera_notes = find_camera(folder)
        capture = Capture(
            stack=stack,
            rig=rig,
            camera=camera,
            mask=find_mask(folder, shape, choices),
            name=file.stem,
            notes=(*notes, *light_notes, *camera_notes),
        )
        return capture, _truth(folder, shape) if choices.truth else None


def _truth(folder: Path, shape: tuple[int, int]) -> Truth | None:
    path, depth = folder / "gt_normal.npy", find_depth(folder, shape)
    if path.is_file():
        return Truth(normals=read_true_normals(path, shape), depth=depth, source=path.name)
    return None if depth is None else Truth(depth=depth, source="depth_gt")


def _stacks(folder: Path) -> list[Path]:
    return [p for p in natural_order(folder.glob("*.[nN][pP][zZ]")) if _is_stack(p)]


def _is_stack(path: Path) -> bool:
    if path.suffix.lower() != ".npz" or not path.is_file():
        return False
    try:
        with zipfile.ZipFile(path) as archive:
            return "images.npy" in archive.namelist()
    except (zipfile.BadZipFile, OSError):
        return False


def _load(file: Path) -> Array:
    read_bytes(file)
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as content:
            return np.asarray(content["images"])
    except Exception as error:  # damaged archives raise errors of many kinds
        raise UnreadableFileError(
            given=f"The file {file} cannot be decoded ({error or type(error).__name__}).",
            needed="A whole .npz file with an array images (m, h, w) or (m, h, w, c).",
            remedy="Copy it again, or save it again with numpy.savez(file, images=...).",
        ) from error
