"""Pieces that several readers share: natural order of names, the mask and truth that lie beside the images."""

import re
import zipfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.errors import InputError, MissingFileError, PsstereoError, UnreadableFileError
from psstereo.io.flat_file import read_flat
from psstereo.io.mask_file import read_mask
from psstereo.io.normal_map import read_normal_map
from psstereo.io.reader import Choices
from psstereo.io.text import read_table
from psstereo.stack import LINEAR, FileStack, FlatField, ImageStack, Response
from psstereo.stack.decode import IMAGE_SUFFIXES, decode_image, read_bytes
from psstereo.types import BoolArray, FloatArray

__all__ = [
    "channel_values",
    "find_camera",
    "find_dark",
    "find_depth",
    "find_flat",
    "find_mask",
    "first_by_name",
    "images_in",
    "natural_order",
    "read_dark",
    "read_depth",
    "read_linear_dark",
    "read_true_albedo",
    "read_true_normals",
    "read_true_visibility",
]


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


def first_by_name(found: list[Path], folder: Path, what: str) -> tuple[Path, tuple[str, ...]]:
    """Return the first of several files that would do, and a note that names the others.

    Raises
    ------
    MissingFileError
        If there are none.
    """
    if not found:
        raise MissingFileError(
            given=f"{folder} holds no {what}.",
            needed="One such file.",
            remedy="Name the folder or the file that holds the images.",
        )
    others = ", ".join(path.name for path in found[1:])
    verb = "was" if len(found) == 2 else "were"
    note = f"{found[0].name} was read, the first by name; {others} {verb} left out. Name the file itself to choose."
    return found[0], (note,) if others else ()


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
        if path.is_file():
            return read_depth(path, shape, variable="depth_gt")
    return None


def read_depth(path: Path, shape: tuple[int, int], *, variable: str | None = None) -> FloatArray:
    """Read a true depth map, float64 (h, w), NaN where unknown, from ``.npz``, ``.npy`` or a floating-point image.

    Parameters
    ----------
    path : Path
        The file.
    shape : (int, int)
        Rows and columns of the images.
    variable : str, optional
        Name of the array in an ``.npz`` file; the only one if absent.

    Raises
    ------
    MissingFileError, UnreadableFileError
        If it is not there, damaged, or of another size.
    """
    try:
        depth = np.asarray(_npz_array(path, variable) if path.suffix.lower() == ".npz" else decode_image(path))
        depth = (depth[..., 0] if depth.shape == (*shape, 1) else depth).astype(np.float64)
    except PsstereoError:
        raise
    except (ValueError, OSError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise UnreadableFileError(
            given=f"The true depth {path} cannot be read ({error}).",
            needed="An array of the images' size.",
            remedy="Copy it again, or take it out of the folder; it is not needed to reconstruct.",
        ) from None
    if depth.shape != shape:
        raise UnreadableFileError(
            given=f"The true depth {path.name} has the shape {depth.shape}; the images, {shape}.",
            needed="It must have the images' size.",
            remedy="Take it out of the folder if it belongs to other images.",
        )
    return depth


def _npz_array(path: Path, variable: str | None) -> FloatArray:
    read_bytes(path)
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as content:
        if variable is None and len(content.files) != 1:
            raise KeyError(f"it holds the arrays {', '.join(content.files)}, of which one must be chosen")
        return np.asarray(content[content.files[0] if variable is None else variable])


def read_true_normals(path: Path, shape: tuple[int, int], *, convention: str = "opengl") -> FloatArray:
    """Read true normals, (h, w, 3) in the canonical frame, NaN where unknown, and refuse those of another size."""
    normals = read_normal_map(path, convention=convention).normals
    if normals.shape[:2] != shape:
        raise InputError(
            given=f"The true normals {path.name} are {normals.shape[1]} × {normals.shape[0]} pixels.",
            needed=f"The images are {shape[1]} × {shape[0]}.",
            remedy="Take them out of the folder if they belong to other images.",
        )
    return normals


def read_true_albedo(path: Path, shape: tuple[int, int]) -> FloatArray:
    """Read a true albedo, (h, w) or (h, w, c) in the file's own precision, from ``.npy`` or a floating-point image.

    Raises
    ------
    InputError
        If it has another size, or holds whole numbers, whose scale nobody knows.
    MissingFileError, UnreadableFileError
        If it is not there or damaged.
    """
    albedo = decode_image(path)
    if albedo.ndim not in (2, 3) or albedo.shape[:2] != shape or albedo.dtype not in (np.float32, np.float64):
        raise InputError(
            given=f"The true albedo {path.name} has the shape {albedo.shape} and type {albedo.dtype}.",
            needed=f"It must be an array of floats, {shape} or with channels besides.",
            remedy="Save the albedo that belongs to the images with numpy.save, or take it out.",
        )
    return albedo


def read_true_visibility(path: Path, count: int, shape: tuple[int, int]) -> FloatArray:
    """Read how much of each light reaches each pixel, float32 (m, h, w), the array ``visibility`` of an ``.npz``.

    Raises
    ------
    UnreadableFileError
        If it is damaged, or of another size than the images.
    MissingFileError
        If it is not there.
    """
    try:
        visibility = np.asarray(_npz_array(path, "visibility"), np.float32)
    except PsstereoError:
        raise
    except (ValueError, OSError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise UnreadableFileError(
            given=f"The true visibility {path} cannot be read ({error}).",
            needed="An .npz file with the array visibility, one (h, w) a light.",
            remedy="Copy it again, or take it out; it is not needed to reconstruct.",
        ) from None
    if visibility.shape != (count, *shape):
        raise UnreadableFileError(
            given=f"The true visibility {path.name} has the shape {visibility.shape}.",
            needed=f"For these images it must be {(count, *shape)}.",
            remedy="Take it out if it belongs to other images.",
        )
    return visibility


def read_linear_dark(path: Path, stack: ImageStack) -> FloatArray:
    """Read a dark image that is already linear pixel values, floats (h, w, c), from ``.npy`` or a float image.

    Raises
    ------
    InputError
        If it has another size or other channels than the images.
    MissingFileError, UnreadableFileError
        If it is not there or damaged.
    """
    dark = decode_image(path)
    dark = dark[..., None] if dark.ndim == 2 else dark
    if dark.shape != stack.shape[1:] or dark.dtype not in (np.float32, np.float64):
        raise InputError(
            given=f"The dark image {path.name} has the shape {dark.shape} and type {dark.dtype}.",
            needed=f"Linear pixel values are floats, of the images' shape {stack.shape[1:]}.",
            remedy="Write dark instead of dark_linear if it is a photograph like the others.",
        )
    return dark


def read_dark(path: Path, stack: ImageStack, response: Response = LINEAR) -> FloatArray:
    """Read the image taken without any of the lights, as linear pixel values (h, w, c).

    Raises
    ------
    InputError
        If size, channels or type differ from those of the images.
    MissingFileError, UnreadableFileError
        If it is not there or damaged.
    """
    image = decode_image(path)
    image = image[..., None] if image.ndim == 2 else image[..., : 3 if image.shape[2] >= 3 else 1]
    if image.shape != stack.shape[1:] or image.dtype != stack.dtype:
        raise InputError(
            given=f"The dark image {path.name} has the shape {image.shape} and type {image.dtype}; "
            f"the images, {stack.shape[1:]} and {stack.dtype}.",
            needed="It must have the images' size, channels and bit depth, so that its values mean the same.",
            remedy="Take it with the same camera settings and convert it like the images, or leave it out.",
        )
    return np.asarray(response.linearise(image, stack.white))


def find_dark(folder: Path, stack: FileStack) -> tuple[FloatArray | None, tuple[str, ...]]:
    """Return ``dark.*`` or ``ambient.*`` of a folder if it is there and none of the images, and a note that says so."""
    names = ("dark", "ambient")
    found = [p for p in images_in(folder) if p.stem.lower() in names and p.name not in stack.names]
    if not found:
        return None, ()
    if len(found) > 1:
        raise InputError(
            given=f"{folder} has several dark images: {', '.join(p.name for p in found)}.",
            needed="One image taken without any of the lights.",
            remedy="Move the others away.",
        )
    return read_dark(found[0], stack), (f"{found[0].name} is subtracted.",)


def find_flat(folder: Path, stack: FileStack, dark: FloatArray | None) -> tuple[FlatField | None, tuple[str, ...]]:
    """Return the flat field of ``flat.*`` in a folder, if it is there and none of the images, and a note."""
    found = [p for p in folder.iterdir() if p.stem.lower() == "flat" and p.suffix.lower() in IMAGE_SUFFIXES]
    found = natural_order(p for p in found if p.name not in stack.names)
    if not found:
        return None, ()
    if len(found) > 1:
        raise InputError(
            given=f"{folder} has several flat frames: {', '.join(p.name for p in found)}.",
            needed="One image of an evenly lit white surface.",
            remedy="Move the others away; for one a light write a capture.toml.",
        )
    return read_flat(tuple(found), stack, dark=dark), (f"Pixels are made even by {found[0].name}.",)


def channel_values(values: FloatArray, channels: int, what: str) -> tuple[FloatArray, tuple[str, ...]]:
    """Fit strengths (m, k) to the channels of the images: coloured strengths of gray images become their mean."""
    if channels != 1 or values.shape[1] != 3:
        return values, ()
    same = np.allclose(values, values[:, :1])
    note = f"The images are gray and the {what} coloured: the mean of R, G and B is taken."
    return values.mean(axis=1, keepdims=True), () if same else (note,)
