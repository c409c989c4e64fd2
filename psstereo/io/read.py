"""From a folder to a capture: which layout it is, why, and what is in it."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from psstereo.capture import Capture, Truth
from psstereo.catalogue import choose
from psstereo.errors import InputError, MissingFileError
from psstereo.io.catalogue import READERS
from psstereo.io.image_folder import ImageFolder
from psstereo.io.parts import images_in, natural_order
from psstereo.io.reader import Choices

__all__ = ["Recognition", "read_capture", "recognise"]


@dataclass(frozen=True)
class Recognition:
    """A layout that fits a folder.

    Attributes
    ----------
    format : str
        Name of the reader.
    reason : str
        Why it fits.
    """

    format: str
    reason: str


def recognise(path: Path) -> list[Recognition]:
    """Return every layout that fits, the one that would be taken first."""
    return list(_recognitions(path))


def _recognitions(path: Path) -> Iterator[Recognition]:
    """Ask one reader after the other; some of them have to look into files."""
    for name, reader in READERS.items():
        reason = reader.recognise(path)
        if reason:
            yield Recognition(name, reason)


def read_capture(
    path: Path | str, *, layout: str | None = None, choices: Choices | None = None
) -> tuple[Capture, Truth | None]:
    """Read a capture from a folder, or from the file that describes it.

    Parameters
    ----------
    path : Path or str
        A folder in a known layout, or a ``capture.toml``, ``.lp``, ``.mat`` or list of images.
    layout : str, optional
        Name of the reader; the first that recognises the folder if absent.
    choices : Choices, optional
        What is said about lights and mask instead of the folder's own files.

    Returns
    -------
    capture : Capture
        What was measured; images are decoded when they are needed.
    truth : Truth or None
        What is known of the surface, if the folder holds it.

    Raises
    ------
    MissingFileError
        If the path does not exist, or a file that is listed in it.
    InputError
        If no layout fits.
    OptionError
        If `layout` is no known name.
    """
    source = Path(path)
    if not source.exists():
        raise MissingFileError(
            given=f"{source} does not exist.",
            needed="A folder with photographs and a file that says where the lights were.",
            remedy="Check the name; quote names with blanks.",
        )
    if layout is not None:
        choose(READERS, layout, "format")
    name = layout
    if name is None:
        first = next(_recognitions(source), None)
        if first is not None:
            name = first.format
        elif source.is_dir() and _lights_elsewhere(choices) and images_in(source):
            name = ImageFolder.name  # nothing but the lights was missing
        else:
            raise _unknown(source)
    return READERS[name].read(source, choices or Choices())


def _lights_elsewhere(choices: Choices | None) -> bool:
    """Return whether a folder may be without lights."""
    return choices is not None and (choices.lights is not None or choices.unknown_lights)


def _unknown(path: Path) -> InputError:
    if path.is_file():
        return InputError(
            given=f"The file {path} is no description of a capture that is known.",
            needed="A capture.toml, an .lp file, a .mat or .npz file with images and lights, or a list of images.",
            remedy="Name the folder of the photographs instead, or write a capture.toml (psstereo info --template).",
        )
    images = len(images_in(path))
    endings = (".txt", ".lp", ".toml", ".csv", ".npy", ".mat")
    texts = sorted(p.name for p in path.iterdir() if p.suffix.lower() in endings)
    inside = [p.name for p in natural_order(path.iterdir()) if p.is_dir() and any(_recognitions(p))]
    if inside:
        return InputError(
            given=f"{path} is no capture; its sub-folders {', '.join(inside[:4])}{' …' if inside[4:] else ''} are.",
            needed="One capture at a time.",
            remedy=f"Name one of them, such as {path / inside[0]}.",
        )
    return InputError(
        given=f"{path} has {images} images and "
        + (f"the files {', '.join(texts[:4])}{' …' if len(texts) > 4 else ''}" if texts else "no file of lights")
        + ", which is no layout that is known.",
        needed="The images and a file with the light directions, such as light_directions.txt or an .lp file.",
        remedy="Add one, or write a capture.toml (psstereo info --template); psstereo info --formats lists layouts.",
    )
