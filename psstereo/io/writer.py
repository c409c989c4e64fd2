"""The interface of capture writers."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from psstereo.capture import Capture, Truth
from psstereo.types import Map, Progress, no_progress

__all__ = ["Writer"]


@dataclass(frozen=True)
class Writer(ABC):
    """Writes captures in one layout of folders."""

    name: ClassVar[str]
    summary: ClassVar[str]

    @abstractmethod
    def check(self, capture: Capture, truth: Truth | None) -> None:
        """Refuse what the layout cannot hold, before anything is rendered or written.

        Raises
        ------
        PsstereoError
            If lights, camera or images are of a kind that the layout has no place for.
        """

    @abstractmethod
    def file_names(self, capture: Capture, truth: Truth | None) -> frozenset[str]:
        """Return the names of all files of a capture that :meth:`check` lets pass, relative, with forward slashes."""

    @abstractmethod
    def left_out(self, capture: Capture, truth: Truth | None) -> tuple[str, ...]:
        """Say what the layout has no place for although the capture is written without it, as sentences."""

    @abstractmethod
    def write(
        self,
        folder: Path,
        capture: Capture,
        truth: Truth | None,
        *,
        over: Map = map,
        progress: Progress = no_progress,
    ) -> None:
        """Write a capture into an empty folder that exists.

        Parameters
        ----------
        folder : Path
            An empty folder; the caller puts it in its place when it is complete.
        capture : Capture
            What is written: each image is asked for once.
        truth : Truth or None
            What is known of it.
        over : map-like
            Executes the writing of single images.
        progress : callable
            Told how many images are written.

        Raises
        ------
        PsstereoError
            If lights, camera or images are of a kind that the layout has no place for.
        """
