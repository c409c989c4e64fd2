"""What files of lights say, in one form, and the interface of the formats."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.capture import Capture
from psstereo.errors import UnsupportedError
from psstereo.io.layout_writer import Save
from psstereo.io.rig_file import RigFile
from psstereo.lights import Led, Rig, StrengthUnit
from psstereo.stack import MemoryStack
from psstereo.types import FloatArray

__all__ = ["LightFormat", "LightTable", "as_capture", "default_names"]


@dataclass(frozen=True, kw_only=True, eq=False)
class LightTable:
    """Lights, and what else their file says.

    Attributes
    ----------
    rig : Rig
        Distant lights, or lamps: in the frame of a pinhole camera, else about the middle of the object.
    names : tuple of str
        Image names, in the order of the lights; empty if the file has none.
    camera : Camera or None
        The camera, if it is known.
    size : (int, int) or None
        Rows and columns of the images.
    distance : float or None
        Mean distance of the object from the camera [mm].
    width : float or None
        Length that the picture's width is on the object [mm].
    balls : float64 array (k, 3) or None
        Circles of mirror balls: x, y, radius, the origin at the lower left [px].
    file : RigFile or None
        The rig file that it came from, with what only such a file can hold.
    source : str
        File that it came from.
    notes : tuple of str
        What was found or left unread, as sentences.
    """

    rig: Rig
    names: tuple[str, ...] = ()
    camera: Camera | None = None
    size: tuple[int, int] | None = None
    distance: float | None = None
    width: float | None = None
    balls: FloatArray | None = None
    file: RigFile | None = None
    source: str = "given"
    notes: tuple[str, ...] = ()

    @classmethod
    def of_capture(cls, capture: Capture) -> "LightTable":
        """Return the lights of a capture, with names and size of its images."""
        ideal = tuple(light.idealised() for light in capture.rig.lights)
        return cls(
            rig=Rig(ideal, capture.rig.strength_unit, capture.rig.source),
            names=capture.stack.names,
            camera=capture.camera,
            size=capture.shape,
            source=capture.name,
        )


@dataclass(frozen=True)
class LightFormat(ABC):
    """A way in which files hold lights.

    Attributes
    ----------
    name, summary : str
        Its name at the command, and what it is.
    file_name : str
        Ending or name of its file; empty if it is several files in a folder.
    holds : frozenset of str
        What it has a place for: ``strengths``, ``unit`` of them, ``names``, ``pinhole``, ``pixel size``,
        ``size``, ``distance``, ``width``, ``balls``, and of rig files ``response``, ``frames``, ``lens``, ``quality``.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    file_name: ClassVar[str] = ""
    holds: ClassVar[frozenset[str]] = frozenset()

    @abstractmethod
    def recognise(self, path: Path) -> bool:
        """Return whether a file or folder is of this format; looks at names, and at no more than it must."""

    @abstractmethod
    def read(self, path: Path) -> LightTable:
        """Read a file or folder.

        Raises
        ------
        PsstereoError
            If it is not there, damaged, or of another form.
        """

    @abstractmethod
    def files(self, table: LightTable) -> Mapping[str, Save]:
        """Return what writes each file; a format of one file calls it by the empty name.

        Raises
        ------
        PsstereoError
            If the format cannot hold the lights, or needs what the table does not say; nothing is written then.
        """

    def left_out(self, table: LightTable) -> tuple[str, ...]:
        """Return what the format has no place for although the table has it, as sentences; images tell their size."""
        lost = [words for part, words in _parts(table) if part not in self.holds]
        return (f"The format {self.name} has no place for {', '.join(lost)}.",) if lost else ()


def _parts(table: LightTable) -> list[tuple[str, str]]:
    """Return the parts that a table has, with their words."""
    strengths = [
        np.asarray(getattr(light, "flux", getattr(light, "strength", np.ones(1)))) for light in table.rig.lights
    ]
    flat = np.concatenate(strengths) if strengths else np.ones(1)
    camera, file = table.camera, table.file
    found = {
        "strengths": ("the lights' strengths", bool(flat.min() != flat.max())),
        "unit": ("the unit of the strengths", table.rig.strength_unit is not StrengthUnit.RELATIVE),
        "names": ("the images' names", bool(table.names)),
        "pinhole": ("the camera's matrix", isinstance(camera, Pinhole)),
        "pixel size": ("the size of a pixel", isinstance(camera, Orthographic) and camera != Orthographic()),
        "distance": ("the distance of the object", table.distance is not None),
        "width": ("the width of the picture", table.width is not None),
        "balls": ("the circles of the mirror balls", table.balls is not None),
        "response": ("the camera's response", file is not None and not file.response.is_linear),
        "frames": ("dark image and flat field", file is not None and (file.dark is not None or file.flat is not None)),
        "lens": ("the lens's distortion", file is not None and file.lens is not None),
        "quality": (
            "how good it is and how it was made",
            file is not None and bool(file.quality.verdict or file.provenance),
        ),
    }
    return [(part, words) for part, (words, there) in found.items() if there]


def default_names(table: LightTable) -> tuple[str, ...]:
    """Return the images' names, or numbers with four digits where they have none."""
    return table.names or tuple(f"{i + 1:04d}.png" for i in range(len(table.rig)))


def as_capture(table: LightTable, wanted: str, *, lamps: bool) -> Capture:
    """Return a capture of black images under these lights, as the writers of layouts take it.

    Parameters
    ----------
    table : LightTable
        The lights.
    wanted : str
        Name of the format, for messages.
    lamps : bool
        Whether it holds lamps, or else distant lights.

    Returns
    -------
    Capture
        Its images take no memory.

    Raises
    ------
    UnsupportedError
        If a light is of the other kind, or lamps have no pinhole camera.
    """
    other = [i for i, light in enumerate(table.rig.lights) if isinstance(light, Led) != lamps]
    if other:
        kinds = ("distant", "a lamp at a position")
        raise UnsupportedError(
            given=f"Light {other[0] + 1} is {kinds[not lamps]}.",
            needed=f"The format {wanted} holds {'position, axis and flux' if lamps else 'a direction'} of each.",
            remedy=f"Choose rig, or {'lp, dome, diligent, psbox or meshroom' if lamps else 'luces, near-ps or dome'}.",
        )
    if lamps and not isinstance(table.camera, Pinhole):
        raise UnsupportedError(
            given="There is no pinhole camera with the lamps.",
            needed=f"Positions in the format {wanted} are in the frame of one, and the file holds its matrix.",
            remedy="Write the camera into a rig file and convert that, or choose rig or dome.",
        )
    channels = max(light.channels for light in table.rig.lights)
    rows, columns = table.size or (1, 1)
    black = np.broadcast_to(np.zeros(1, np.uint16), (len(table.rig), rows, columns, channels))
    mask = np.zeros((rows, columns), np.bool_)
    mask[0, 0] = True  # one pixel, so that means over it are exact
    return Capture(
        stack=MemoryStack(black, names=default_names(table)),
        rig=table.rig,
        camera=table.camera or Orthographic(),
        mask=mask,
    )
