"""The interface of capture readers."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from psstereo.capture import Capture, Truth

__all__ = ["Choices", "Reader"]


@dataclass(frozen=True, kw_only=True)
class Choices:
    """What a person says about a capture instead of its own files.

    Attributes
    ----------
    lights : Path or None
        File of light directions to take instead of the folder's own; strengths are then all one, unless that file
        (Meshroom's .json) or one of the folder holds them.
    lights_layout : {"rows", "columns"} or None
        One light a row or a column, where the numbers cannot tell.
    unknown_lights : bool
        Whether the capture's own lights are of no interest, so that they may be missing: all then come from the camera.
    mask : Path or None
        Mask to take instead of the folder's own.
    ignore_mask : bool
        Whether to take every pixel, whatever mask there is.
    truth : bool
        Whether to read the truth too; a reconstruction has no use for it.
    """

    lights: Path | None = None
    lights_layout: str | None = None
    unknown_lights: bool = False
    mask: Path | None = None
    ignore_mask: bool = False
    truth: bool = True


@dataclass(frozen=True)
class Reader(ABC):
    """Reads one layout of folders; it holds nothing and decodes nothing but the first image."""

    name: ClassVar[str]
    summary: ClassVar[str]

    @abstractmethod
    def recognise(self, path: Path) -> str | None:
        """Say by which files a folder or file is recognised, as a clause, or None if it is not.

        Looks at names and at a few small text files only, and never raises for what it finds there.
        """

    @abstractmethod
    def read(self, path: Path, choices: Choices) -> tuple[Capture, Truth | None]:
        """Read the capture; images are decoded later, when they are needed.

        Raises
        ------
        PsstereoError
            If something is missing, damaged or contradictory.
        """
