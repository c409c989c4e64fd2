"""Images, mask and lights in one MATLAB file, as the University of Copenhagen's Beethoven bust comes."""

from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from psstereo.capture import Capture, Truth
from psstereo.errors import InputError
from psstereo.io.distant_lights import distant_rig
from psstereo.io.light_file import Directions, as_rows
from psstereo.io.mat_file import is_hdf5, read_mat
from psstereo.io.parts import find_mask, first_by_name, natural_order
from psstereo.io.reader import Choices, Reader
from psstereo.stack import MemoryStack
from psstereo.types import Array, BoolArray

__all__ = ["MatStack"]


class MatStack(Reader):
    """A MATLAB file with ``I`` (h, w, m), ``S`` (m, 3) and perhaps ``mask`` (h, w).

    The columns of ``S`` are (down, right, toward the camera). Its rows are nearly unit vectors; only their directions
    count. The file is decoded whole when it is read.
    """

    name: ClassVar[str] = "mat-stack"
    summary: ClassVar[str] = "a .mat file with I (h, w, m), S (m, 3: down, right, toward the camera) and mask"

    def recognise(self, path: Path) -> str | None:
        """See :meth:`Reader.recognise`."""
        if path.is_file():
            if path.suffix.lower() != ".mat":
                return None
            return "it is a .mat file with images I and lights S" if _is_stack(path) or is_hdf5(path) else None
        found = _stacks(path)
        return f"{found[0].name} holds images I and lights S" if found else None

    def read(self, path: Path, choices: Choices) -> tuple[Capture, Truth | None]:
        """See :meth:`Reader.read`."""
        file, notes = (
            first_by_name(_stacks(path), path, ".mat file with images I and lights S") if path.is_dir() else (path, ())
        )
        content = _load(file)
        images = np.asarray(content["I"])
        if images.ndim not in (3, 4):
            raise _wrong(file, f"I has the shape {images.shape}", "I is (h, w, m), or (h, w, 3, m) in colour")
        planes = np.moveaxis(images, -1, 0)
        stack = MemoryStack(planes, names=tuple(f"{file.name} plane {i + 1}" for i in range(len(planes))))
        rig, light_notes = distant_rig(
            stack, choices, lambda: _lights(content["S"], len(stack), file, choices), file.name
        )
        capture = Capture(
            stack=stack,
            rig=rig,
            mask=_mask(content.get("mask"), (stack.shape[1], stack.shape[2]), file, choices),
            name=file.stem,
            notes=(*notes, *light_notes),
        )
        return capture, None


def _lights(values: Array, count: int, file: Path, choices: Choices) -> Directions:
    """Return vectors in the canonical frame; one light a row is this layout's definition."""
    layout = choices.lights_layout or "rows"
    found = as_rows(np.asarray(values, np.float64), count, f"S in {file.name}", layout=layout)
    down, right, near = found.vectors.T
    lengths = np.sqrt((found.vectors**2).sum(axis=1))
    note = f"S in {file.name} was read as (down, right, toward the camera), one light a {layout[:-1]}."
    uneven = f"Its vectors have lengths from {lengths.min():.3g} to {lengths.max():.3g}; only their directions count."
    notes = (note, *((uneven,) if np.abs(lengths - 1).max() > 0.01 else ()))
    return Directions(np.stack([right, -down, near], axis=1), (*found.notes, *notes))


def _mask(values: Array | None, shape: tuple[int, int], file: Path, choices: Choices) -> BoolArray | None:
    if values is None or choices.mask is not None or choices.ignore_mask:
        return find_mask(file.parent, shape, choices)
    mask = np.asarray(values)
    if mask.shape != shape or mask.dtype.kind not in "biuf":
        raise _wrong(file, f"mask has the shape {mask.shape}", f"it has the images' size {shape}")
    return np.asarray(mask > 0.5 * float(mask.max()))


def _stacks(folder: Path) -> list[Path]:
    """Return the .mat files of a folder that hold I and S, in natural order."""
    if not folder.is_dir():
        return []
    return [p for p in natural_order(folder.glob("*.[mM][aA][tT]")) if _is_stack(p)]


def _is_stack(path: Path) -> bool:
    import scipy.io

    try:
        shapes = {name: shape for name, shape, _ in scipy.io.whosmat(path)}
    except Exception:  # whatever the decoder says of a damaged file: it is no stack
        return False
    return len(shapes.get("I", ())) in (3, 4) and len(shapes.get("S", ())) == 2


def _load(file: Path) -> dict[str, Any]:
    content = read_mat(file)
    if not {"I", "S"} <= set(content):
        raise _wrong(
            file, f"holds {', '.join(content) or 'nothing'}", "images I (h, w, m) and lights S (m, 3) are needed"
        )
    return content


def _wrong(file: Path, given: str, needed: str) -> InputError:
    return InputError(
        given=f"In {file}: {given}.",
        needed=f"In this layout {needed}.",
        remedy="Save the file again in that form, or write the images as PNG with a capture.toml.",
    )
