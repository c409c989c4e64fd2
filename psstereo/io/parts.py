"""Pieces that several readers share: natural order of names, the mask and truth that lie beside the images."""

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.errors import MissingFileError, UnreadableFileError
from psstereo.io.mask_file import read_mask
from psstereo.io.reader import Choices
from psstereo.io.text import read_table
from psstereo.stack.decode import IMAGE_SUFFIXES
from psstereo.types import BoolArray, FloatArray

__all__ = ["find_camera", "find_depth", "find_mask", "images_in", "natural_order", "require_files"]


def natural_order(paths: Iterable[Path]) -> list[Path]:
    """Sort names so that numbers in them count as numbers: ``cat.2.png`` before ``cat.10.png``.

    Examples
    --------
    >>> [p.name for p in natural_order([Path("a10.png"), Path("a9.png")])]
    ['a9.png', 'a10.png']
    """
    return sorted(paths, key=lambda p: [(int(s), "") if s.isdigit() else (-1, s.lower()) for s in _pieces(p.name)])


def _pieces(name: str) -> list[str]:
    return [piece for piece in re.split(r"(\d+)", name) if piece]


def images_in(folder: Path) -> list[Path]:
    """Return the image files of a folder in natural order, without hidden ones."""
    if not folder.is_dir():
        return []
    return natural_order(
        p for p in folder.iterdir() if p.suffix.lower() in IMAGE_SUFFIXES - {".npy"} and not p.name.startswith(".")
    )


def require_files(paths: Iterable[Path], listed_in: str) -> tuple[Path, ...]:
    """Return the paths if every one is a file.

    Raises
    ------
    MissingFileError
        Naming those that are not there.
    """
    found = tuple(paths)
    missing = [path.name for path in found if not path.is_file()]
    if missing:
        raise MissingFileError(
            given=f"{listed_in} lists {len(found)} images, of which {len(missing)} are not there: "
            f"{', '.join(missing[:5])}{' …' if len(missing) > 5 else ''}.",
            needed="Every listed image must be in the folder.",
            remedy="Copy the missing ones, or take their lines out of the list and of the lights.",
        )
    return found


def find_mask(folder: Path, shape: tuple[int, int], choices: Choices, name: str = "mask.png") -> BoolArray | None:
    """Return the mask that was chosen or that lies in the folder, None if there is none."""
    if choices.ignore_mask:
        return None
    path = choices.mask or folder / name
    return read_mask(path, shape) if choices.mask or path.is_file() else None


def find_camera(folder: Path) -> tuple[Camera, tuple[str, ...]]:
    """Return the pinhole camera of ``K.txt`` if it is there, else an orthographic one, and a note that says which."""
    path = folder / "K.txt"
    if not path.is_file():
        return Orthographic(), ()
    camera = Pinhole.from_matrix(read_table(path).values)
    return camera, (f"The camera is a pinhole of focal length {camera.fx:.6g} px (K.txt).",)


def find_depth(folder: Path, shape: tuple[int, int]) -> FloatArray | None:
    """Return the true depth of ``depth_gt.npz`` or ``depth_gt.npy`` if it is there."""
    for path in (folder / "depth_gt.npz", folder / "depth_gt.npy"):
        if not path.is_file():
            continue
        try:
            content = np.load(path, allow_pickle=False)
            depth = np.asarray(content["depth_gt"] if path.suffix == ".npz" else content, np.float64)
        except (ValueError, OSError, EOFError, KeyError) as error:
            raise UnreadableFileError(
                given=f"The true depth {path} cannot be read: {error}.",
                needed="An array depth_gt of the images' size.",
                remedy="Copy it again, or take it out of the folder; it is not needed to reconstruct.",
            ) from None
        if depth.shape != shape:
            raise UnreadableFileError(
                given=f"The true depth {path.name} has the shape {depth.shape}; the images, {shape}.",
                needed="It must have the images' size.",
                remedy="Take it out of the folder if it belongs to other images.",
            )
        return depth
    return None
