"""What all writers of captures share: a list of files, and images written one at a time by any number of threads."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Condition
from typing import ClassVar, TypeAlias

import numpy as np

from psstereo.camera import Orthographic, Pinhole
from psstereo.capture import Capture, Truth
from psstereo.errors import InputError
from psstereo.io.pictures import write_png
from psstereo.io.write_checks import require_truth
from psstereo.io.writer import Writer
from psstereo.lights import StrengthUnit
from psstereo.stack import ImageStack
from psstereo.stack.stack import full_scale
from psstereo.types import Array, BoolArray, FloatArray, Map, Progress, no_progress

__all__ = [
    "LayoutWriter",
    "Save",
    "camera_file",
    "mask_file",
    "numbers",
    "rgb",
    "sixteen_bits",
    "text_file",
    "three",
    "whole_type",
]

Save: TypeAlias = Callable[[Path], None]
"""Writes one file under the path that it is given."""

_TRUTH = {
    "normals": "the true normals",
    "depth": "the true depth",
    "albedo": "the true albedo",
    "visibility": "the true visibility of the lights",
}


@dataclass(frozen=True)
class LayoutWriter(Writer):
    """A writer that lists its files: images by number, and all others with what writes them.

    Attributes
    ----------
    holds : frozenset of str
        Parts that the layout has a place for, of ``normals``, ``depth``, ``albedo``, ``visibility``, ``radiance``
        (units of strengths and of full scale) and ``pixel size``.
    """

    holds: ClassVar[frozenset[str]] = frozenset()

    @abstractmethod
    def image_name(self, index: int, stack: ImageStack) -> str:
        """Return the name of an image, counted from 0."""

    @abstractmethod
    def image_saver(self, stack: ImageStack) -> Callable[[Path, Array], None]:
        """Return a function that writes one image; it is called by several threads at once."""

    @abstractmethod
    def parts(self, capture: Capture, truth: Truth | None) -> Mapping[str, Save]:
        """Return all files but the images, by relative name; checks of lights, camera and dark image are made here."""

    def check_images(self, capture: Capture) -> None:
        """Refuse images that the layout cannot hold."""

    def check(self, capture: Capture, truth: Truth | None) -> None:
        """See :meth:`Writer.check`."""
        self.check_images(capture)
        require_truth(capture, truth)
        self.parts(capture, truth)

    def file_names(self, capture: Capture, truth: Truth | None) -> frozenset[str]:
        """See :meth:`Writer.file_names`."""
        images = {self.image_name(i, capture.stack) for i in range(len(capture.stack))}
        return frozenset(images | set(self.parts(capture, truth)))

    def left_out(self, capture: Capture, truth: Truth | None) -> tuple[str, ...]:
        """See :meth:`Writer.left_out`."""
        given = [] if truth is None else [name for name in _TRUTH if getattr(truth, name) is not None]
        lost = [_TRUTH[name] for name in given if name not in self.holds]
        if "radiance" not in self.holds:
            if capture.rig.strength_unit is not StrengthUnit.RELATIVE:
                lost.append("the unit of the lights' strengths")
            if capture.radiance_at_white is not None:
                lost.append("the radiance of full scale")
        camera = capture.camera
        if "pixel size" not in self.holds and isinstance(camera, Orthographic) and camera != Orthographic():
            lost.append("the size of a pixel")
        return (f"The layout {self.name} has no place for {', '.join(lost)}.",) if lost else ()

    def write(
        self,
        folder: Path,
        capture: Capture,
        truth: Truth | None,
        *,
        over: Map = map,
        progress: Progress = no_progress,
    ) -> None:
        """See :meth:`Writer.write`."""
        self.check(capture, truth)
        stack = capture.stack
        parts = self.parts(capture, truth)
        names = [self.image_name(i, stack) for i in range(len(stack))]
        for name in (*parts, *names):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
        save = self.image_saver(stack)
        _for_each(len(stack), lambda i: save(folder / names[i], _checked(stack, i)), over, progress)
        for name, write in parts.items():
            write(folder / name)


def _checked(stack: ImageStack, index: int) -> Array:
    frame = stack.frame(index)
    if frame.shape != stack.shape[1:] or frame.dtype != stack.dtype:
        raise InputError(
            given=f"{stack.names[index]} has the shape {frame.shape} and type {frame.dtype}.",
            needed=f"The stack promises {stack.shape[1:]} and {stack.dtype}.",
            remedy="Give images of one size and type.",
        )
    return frame


def _for_each(count: int, job: Callable[[int], None], over: Map, progress: Progress) -> None:
    """Run a job for every image; when one fails no other is begun, and all have ended before this returns.

    A thread that still wrote while the unfinished folder is removed would leave something of it behind.
    """
    ended = Condition()
    failures: list[tuple[int, BaseException]] = []
    running, stopped = 0, False

    def guarded(index: int) -> None:
        nonlocal running, stopped
        with ended:
            if stopped:
                return
            running += 1
        try:
            job(index)
        except BaseException as error:
            stopped = True
            failures.append((index, error))
        finally:
            with ended:
                running -= 1
                ended.notify_all()

    try:
        for done, _ in enumerate(over(guarded, range(count)), start=1):
            if not stopped:
                progress("writing images", done, count)
    finally:
        with ended:
            stopped = True
            ended.wait_for(lambda: running == 0)
    if failures:
        raise min(failures, key=lambda failure: failure[0])[1]


def numbers(row: FloatArray) -> str:
    """Return numbers with 17 digits and blanks between, which come back to the last bit.

    Examples
    --------
    >>> numbers(np.array([0.1, -2.0]))
    '0.10000000000000001 -2'
    """
    return " ".join(f"{value:.17g}" for value in row)


def text_file(lines: list[str]) -> Save:
    """Return what writes lines of UTF-8; the last one ends too, since Meshroom loses one that does not."""
    data = "".join(f"{line}\n" for line in lines).encode("utf-8")
    return lambda path: _put(path, data)


def _put(path: Path, data: bytes) -> None:
    path.write_bytes(data)


def mask_file(mask: BoolArray) -> Save:
    """Return what writes a mask: 255 on the object."""
    return lambda path: write_png(path, mask.astype(np.uint8) * np.uint8(255))


def camera_file(camera: Pinhole) -> Save:
    """Return what writes the camera's matrix K, three rows of text."""
    return text_file([numbers(row) for row in camera.matrix])


def whole_type(stack: ImageStack) -> Callable[[Array], Array]:
    """Return what makes images fill their type: 8 and 16 bits stay, other full scales are stretched to 16 bits.

    A stretched value is round(value · 65535 / white), at most 65535, so that round(value · white / 65535) is the
    original one; what lies beyond full scale becomes full scale.
    """
    if stack.white == full_scale(stack.dtype):
        return lambda frame: frame
    return sixteen_bits(stack)


def sixteen_bits(stack: ImageStack) -> Callable[[Array], Array]:
    """Return what stretches images to 16 bits, 65535 for full scale; see :func:`whole_type`."""
    top = full_scale(stack.dtype)
    if stack.white == 65535:
        return lambda frame: frame
    table = np.minimum(np.rint(np.arange(int(top) + 1) * (65535.0 / stack.white)), 65535.0).astype(np.uint16)
    return lambda frame: np.asarray(table[frame])


def rgb(frame: Array) -> Array:
    """Return an image (h, w, 3), three equal channels of a gray one."""
    return np.broadcast_to(frame, (*frame.shape[:2], 3))


def three(values: FloatArray) -> FloatArray:
    """Return strengths (m, 3), three equal ones of (m, 1)."""
    return np.broadcast_to(values, (len(values), 3))
