"""A capture whose frames are laid over one another."""

from dataclasses import replace

import numpy as np

from psstereo.calibrate.registration.frames import Registration, register_frames
from psstereo.capture import Capture
from psstereo.errors import InputError
from psstereo.io.reading_options import in_linear_light, with_moves
from psstereo.types import BoolArray, FloatArray, Map, Progress, no_progress

__all__ = ["registered"]

_LARGEST = 1400
"""Side of the square that is compared, if the object is larger; it holds more detail than is needed [px]."""
_TIMES = 2.0
"""Standard errors by which a frame must have moved to be moved back: what is not certain would only blur."""
_ROOM = 16
"""Pixels around the compared part that are read with it, for moves [px]."""


def registered(
    capture: Capture,
    *,
    model: str = "shift",
    reference: int = 0,
    over: Map = map,
    progress: Progress = no_progress,
) -> tuple[Capture, Registration]:
    """Find how a capture's frames moved, and return the capture with the moves undone while frames are decoded.

    Parameters
    ----------
    capture : Capture
        The frames; the mask is that of the reference.
    model : {"shift", "affine"}
        What moves are like.
    reference : int
        The frame that stays, from 0.
    over : map-like
        Executes frames while they are read.
    progress : callable
        Told how far reading is.

    Returns
    -------
    capture : Capture
        The same lights, with a note; frames that had moved by more than twice their error are moved back.
    registration : Registration
        The moves, and how well they are known.

    Raises
    ------
    InputError
        As :func:`psstereo.calibrate.registration.frames.register_frames`.
    """
    light = in_linear_light(capture)
    box, inside = _window(light)
    frames = np.zeros((len(light.stack), *inside.shape), np.float32)
    for index, one in enumerate(over(lambda i: _gray(light.stack.frame(i)[box]), range(len(light.stack)))):
        frames[index] = one
        progress("looking at frames", index + 1, len(light.stack))
    found = register_frames(frames, mask=inside, reference=reference, model=model)
    corner = np.array([box[1].start, box[0].start], np.float64)
    affines = found.affines.copy()
    affines[:, :, 2] += corner - affines[:, :, :2] @ corner
    gone = found.distances > _TIMES * found.errors
    if not gone.any():
        note = f"No frame had moved by more than its place is uncertain ({found.errors.max():.3f} px): none is moved."
        return replace(capture, notes=(*capture.notes, note)), found
    affines[~gone] = np.eye(2, 3)
    note = f"{found.quality.verdict} ({np.count_nonzero(gone)} registered on {light.stack.names[reference]})"
    return with_moves(light, affines, note), found


def _gray(frame: FloatArray) -> FloatArray:
    return np.asarray(frame.mean(axis=2), np.float32)


def _window(capture: Capture) -> tuple[tuple[slice, slice], BoolArray]:
    """Return the part of the frames that is compared, and the mask in it."""
    mask = capture.effective_mask
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    parts = []
    for found, size in ((rows, mask.shape[0]), (columns, mask.shape[1])):
        first, last = int(found[0]), int(found[-1]) + 1
        if last - first > _LARGEST:
            first = (first + last - _LARGEST) // 2
            last = first + _LARGEST
        parts.append(slice(max(first - _ROOM, 0), min(last + _ROOM, size)))
    box = (parts[0], parts[1])
    inside = mask[box]
    if not inside.any():
        raise InputError(
            given="The middle of the mask holds no pixel of the object.",
            needed="An object whose middle can be compared.",
            remedy="Crop the images to a part of the object.",
        )
    return box, inside
