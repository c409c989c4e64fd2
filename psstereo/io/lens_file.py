"""A camera with its lens in a TOML file: the section [camera] that rig files and descriptions of captures have too."""

import tomllib
from pathlib import Path

from psstereo.camera import Lens, Pinhole
from psstereo.errors import InputError, MissingFileError, UnreadableFileError
from psstereo.io.toml_section import Section
from psstereo.io.toml_text import toml_number, toml_rows
from psstereo.stack.decode import read_bytes

__all__ = ["lens_text", "read_lens"]


def read_lens(path: Path) -> tuple[Pinhole, Lens]:
    """Read camera and lens from a file that ``psstereo calibrate lens`` wrote, a rig file or a ``capture.toml``.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    camera : Pinhole
        The camera without the lens.
    lens : Lens
        What the lens does.

    Raises
    ------
    MissingFileError, UnreadableFileError
        If it is not there, or no TOML.
    InputError
        If it has no matrix or no lens.
    """
    try:
        raw = read_bytes(path).tobytes()
    except (MissingFileError, UnreadableFileError) as error:
        raise type(error)(
            given=error.given,
            needed="A file with the camera's matrix and its lens.",
            remedy="Check the name; psstereo calibrate lens writes such files.",
        ) from None
    try:
        values = tomllib.loads(raw.decode("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise UnreadableFileError(
            given=f"{path} is not valid TOML: {error}.",
            needed="A section [camera] with K and lens.",
            remedy="Write it with psstereo calibrate lens.",
        ) from None
    camera = Section(values, "", path).section("camera")
    matrix, lens = camera.matrix("K", 3), camera.matrix("lens", 1)
    if matrix is None or lens is None:
        raise InputError(
            given=f"{path.name} has no {'matrix K' if matrix is None else 'lens'} in [camera].",
            needed="Both: the lens is told in units of the focal length.",
            remedy="Write it with psstereo calibrate lens.",
        )
    return Pinhole.from_matrix(matrix), Lens(tuple(float(number) for number in lens[:, 0]))


def is_lens_file(path: Path) -> bool:
    """Return whether a file holds a camera and its lens and nothing else, as it is written here; never raises."""
    try:
        values = tomllib.loads(path.read_text("utf-8-sig"))
    except (OSError, ValueError):
        return False
    camera = values.get("camera")
    return set(values) == {"camera"} and isinstance(camera, dict) and {"K", "lens"} <= set(camera)


def lens_text(camera: Pinhole, lens: Lens) -> str:
    """Return the section of a camera and its lens, TOML text that :func:`read_lens` reads."""
    numbers = ", ".join(toml_number(number) for number in lens.coefficients)
    return "\n".join(["[camera]", 'type = "pinhole"', *toml_rows("K", camera.matrix), f"lens = [{numbers}]", ""])
