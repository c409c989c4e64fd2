"""Verdicts on observations as files: an array for programs, and one picture an image to look at and to paint in.

``verdicts.npz`` holds the array ``verdicts``, uint8 (m, h, w). The folder ``verdicts`` holds ``0001.png`` … in the
order of the images, 8 bit R, G, B in plain colours:

| colour | R, G, B | verdict |
| -- | -- | -- |
| white | 255, 255, 255 | USED |
| blue | 0, 0, 255 | SHADOW |
| yellow | 255, 255, 0 | HIGHLIGHT |
| magenta | 255, 0, 255 | DARK_OUTLIER |
| red | 255, 0, 0 | UNUSABLE |
| gray | 128, 128, 128 | NOT_NEEDED |
| black | 0, 0, 0 | outside the mask |

Fed back as an observation mask, white and gray take part and all else is left out, so that a person paints white to
take an observation in and black or red to leave it out. A picture has to be painted with a hard brush: a colour between
two others has no meaning and is refused. ``written.txt`` beside the pictures holds their SHA-256 sums, by which one
that was painted in is known, so that it is never overwritten.
"""

import hashlib
import re
from pathlib import Path

import numpy as np

from psstereo.errors import InputError, MissingFileError, UnreadableFileError
from psstereo.io.parts import natural_order
from psstereo.io.pictures import write_png
from psstereo.stack.decode import decode_image, read_bytes
from psstereo.types import Array, BoolArray
from psstereo.verdict import OUTSIDE, Verdict, VerdictArray

__all__ = ["PALETTE", "edited_pictures", "read_observation_mask", "write_verdicts"]

PALETTE: dict[int, tuple[int, int, int]] = {
    int(Verdict.USED): (255, 255, 255),
    int(Verdict.SHADOW): (0, 0, 255),
    int(Verdict.HIGHLIGHT): (255, 255, 0),
    int(Verdict.DARK_OUTLIER): (255, 0, 255),
    int(Verdict.UNUSABLE): (255, 0, 0),
    int(Verdict.NOT_NEEDED): (128, 128, 128),
    OUTSIDE: (0, 0, 0),
}
"""Colour of each verdict, R, G, B."""

_NAME = "verdicts"
_SUMS = "written.txt"
_PICTURE = re.compile(r"\d{4,}\.png")


def write_verdicts(folder: Path, verdicts: VerdictArray) -> None:
    """Write ``verdicts.npz`` and the folder ``verdicts`` into a folder.

    Parameters
    ----------
    folder : Path
        An existing folder without them.
    verdicts : uint8 array (m, h, w)
        Values of :class:`psstereo.verdict.Verdict`, and 255 outside the mask.
    """
    np.savez_compressed(folder / f"{_NAME}.npz", verdicts=np.asarray(verdicts, np.uint8))
    colours = np.zeros((256, 3), np.uint8)
    for code, colour in PALETTE.items():
        colours[code] = colour
    pictures = folder / _NAME
    pictures.mkdir()
    sums = []
    for i, one in enumerate(verdicts, start=1):
        path = pictures / f"{i:04d}.png"
        write_png(path, colours[one])
        sums.append(f"{_sum(path)}  {path.name}\n")
    (pictures / _SUMS).write_text("".join(sums), encoding="utf-8")


def edited_pictures(folder: Path) -> list[str]:
    """Return the files in a folder of verdicts that are not as they were written, with the folder's name before them.

    Parameters
    ----------
    folder : Path
        The folder ``verdicts`` of a result.

    Returns
    -------
    list of str
        Painted pictures and whatever else somebody put there; empty if the folder may go.
    """
    try:
        lines = (folder / _SUMS).read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        lines = []
    known = {name: digest for digest, _, name in (line.partition("  ") for line in lines)}
    return [
        f"{folder.name}/{path.name}"
        for path in natural_order(folder.iterdir())
        if path.name != _SUMS and not (path.is_file() and known.get(path.name) == _sum(path))
    ]


def _sum(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def read_observation_mask(path: Path, shape: tuple[int, int, int]) -> BoolArray | VerdictArray:
    """Read which observations may take part.

    Parameters
    ----------
    path : Path
        ``.npz`` with an array ``verdicts``; ``.npy`` with verdicts or with true for what may take part; or a folder of
        pictures in the colours of `PALETTE`, one an image, in the order of their names.
    shape : (int, int, int)
        Images, rows and columns of the capture.

    Returns
    -------
    bool or uint8 array (m, h, w)
        For :func:`psstereo.normals.estimate_normals`, which checks what it means.

    Raises
    ------
    MissingFileError, UnreadableFileError
        If it is not there or damaged.
    InputError
        If it does not fit the images, or a picture has a colour that means nothing.
    """
    if path.is_dir():
        return _read_pictures(path, shape)
    if path.suffix.lower() not in (".npz", ".npy"):
        raise InputError(
            given=f"The observation mask {path} is no folder and no .npz or .npy file.",
            needed="The verdicts of an earlier run: its verdicts.npz, or its folder verdicts, painted in perhaps.",
            remedy="Run with --verdicts to get them. A mask of the object goes to --mask.",
        )
    mask = _load(path)
    if mask.shape != shape or mask.dtype not in (np.dtype(np.bool_), np.dtype(np.uint8)):
        m, h, w = shape
        raise InputError(
            given=f"The observation mask {path.name} has the shape {mask.shape} and the type {mask.dtype}.",
            needed=f"({m}, {h}, {w}), an entry an observation: true or false, or a verdict as uint8.",
            remedy="Use the one that belongs to these images.",
        )
    return mask


def _load(path: Path) -> Array:
    read_bytes(path)
    try:
        with path.open("rb") as stream:
            content = np.load(stream, allow_pickle=False)
            return np.asarray(content if isinstance(content, np.ndarray) else content[_NAME])
    except Exception as error:  # damaged archives raise errors of many kinds
        raise UnreadableFileError(
            given=f"The observation mask {path} cannot be decoded ({error or type(error).__name__}).",
            needed="A whole .npy file, or a whole .npz file with an array verdicts.",
            remedy="Copy it again, or write it again with --verdicts.",
        ) from error


def _read_pictures(folder: Path, shape: tuple[int, int, int]) -> VerdictArray:
    paths = natural_order(p for p in folder.iterdir() if p.suffix.lower() == ".png" and not p.name.startswith("."))
    if (folder / _NAME).is_dir() and not any(_PICTURE.fullmatch(p.name) for p in paths):
        raise InputError(
            given=f"{folder} is a result, not a folder of verdicts.",
            needed="It is not clear whether its pictures or its array are meant.",
            remedy=f"Name {folder / _NAME} or {folder / _NAME}.npz.",
        )
    if len(paths) != shape[0]:
        raise (InputError if paths else MissingFileError)(
            given=f"The folder {folder} holds {len(paths)} pictures (.png).",
            needed=f"One for each of the {shape[0]} images, in the same order.",
            remedy="Start from the folder verdicts that a run with --verdicts wrote, and keep all of its pictures.",
        )
    verdicts = np.full(shape, OUTSIDE, np.uint8)
    for out, path in zip(verdicts, paths, strict=True):
        out[:] = _read_picture(path, (shape[1], shape[2]))
    return verdicts


def _read_picture(path: Path, shape: tuple[int, int]) -> VerdictArray:
    image = _eight_bit(path, decode_image(path))
    if image.shape[:2] != shape:
        raise InputError(
            given=f"The picture {path.name} is {image.shape[1]} × {image.shape[0]} pixels.",
            needed=f"It must have the size of the images, {shape[1]} × {shape[0]}.",
            remedy="Paint in it without cropping or scaling it.",
        )
    verdicts, known = np.full(shape, OUTSIDE, np.uint8), np.zeros(shape, np.bool_)
    for code, colour in PALETTE.items():
        same = (image == np.array(colour, np.uint8)).all(axis=2)
        verdicts[same] = code
        known |= same
    if not known.all():
        row, column = (int(i[0]) for i in np.nonzero(~known))
        raise InputError(
            given=f"{int((~known).sum())} pixels of {path.name} have a colour that means nothing, the first of them"
            f" {tuple(int(v) for v in image[row, column])} in column {column}, row {row}.",
            needed="White or gray for what may take part; black, red, blue, yellow or magenta for what may not.",
            remedy="Paint with a hard brush (a pencil) in one of these colours, and save as PNG.",
        )
    return verdicts


def _eight_bit(path: Path, image: Array) -> Array:
    """Return R, G, B, uint8; editors save a picture without colours as gray, and some with an opaque alpha channel."""
    if image.dtype == np.uint16 and not (image % 257).any():
        image = (image // 257).astype(np.uint8)
    gray = image[..., None] if image.ndim == 2 else image
    colours = 3 if gray.shape[2] >= 3 else 1
    opaque = gray.shape[2] == colours or bool((gray[..., -1] == 255).all())
    if image.dtype != np.uint8 or not opaque:
        raise InputError(
            given=f"The picture {path.name} {'is partly transparent' if opaque is False else f'is {image.dtype}'}.",
            needed="8 bit R, G, B, opaque.",
            remedy="Paint black instead of erasing, and save with 8 bits a channel.",
        )
    return np.asarray(np.broadcast_to(gray[..., :colours], (*gray.shape[:2], 3)))
