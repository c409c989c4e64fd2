"""From the words on the command line to a capture."""

from pathlib import Path
from typing import TYPE_CHECKING

from psstereo.capture import Capture, Truth
from psstereo.types import Map, Progress

if TYPE_CHECKING:
    from psstereo.io.rig_file import RigFile
    from psstereo_cli.reading import ReadingOptions

__all__ = ["load_capture"]


def load_capture(
    folder: Path,
    *,
    layout: str | None,
    lights: Path | None,
    rig: Path | None = None,
    unknown_lights: bool = False,
    lights_layout: str | None,
    mask: str | None,
    ambient: Path | None = None,
    reading: "ReadingOptions | None" = None,
    truth: bool,
    over: Map = map,
    progress: Progress,
) -> tuple[Capture, Truth | None]:
    """Read a capture with what was said about its lights and mask.

    Parameters
    ----------
    folder : Path
        The capture.
    layout, lights, lights_layout, mask
        As on the command line.
    rig : Path, optional
        Rig file with lights, and what is known of the camera, to take instead of the folder's own.
    unknown_lights : bool
        Whether the lights are to be found from the images, so that the folder may be without any.
    ambient : Path, optional
        Frame without any of the lights, to subtract.
    reading : ReadingOptions, optional
        What is to be undone or changed in the photographs besides.
    truth : bool
        Whether to read the truth too.
    over : map-like
        Executes images, if a mask has to be found.
    progress : callable
        Told how far that is.

    Returns
    -------
    Capture, Truth or None
        What the reader found.

    Raises
    ------
    OptionError
        If both a rig and lights are chosen.
    """
    from dataclasses import replace

    from psstereo.io import Choices, read_capture

    rig_file = _rig_file(rig, lights, unknown_lights=unknown_lights)
    choices = Choices(
        lights=lights,
        lights_layout=lights_layout,
        unknown_lights=unknown_lights or rig_file is not None,
        mask=Path(mask) if mask not in (None, "none", "auto") else None,
        ignore_mask=mask in ("none", "auto"),
        truth=truth,
    )
    capture, found_truth = read_capture(folder, layout=layout, choices=choices)
    if rig_file is not None and rig is not None:
        from psstereo.io.rig_use import with_rig

        capture = with_rig(capture, rig_file, rig.name)
    if ambient is not None:
        from psstereo.io.ambient_frame import with_ambient

        capture = with_ambient(capture, ambient)
    if reading is not None:
        from psstereo_cli.reading import read_otherwise

        capture = read_otherwise(capture, reading, over=over, progress=progress)
    if mask == "auto":
        from psstereo.masking import mask_from_brightness

        found = mask_from_brightness(capture.stack, over=over, progress=progress)
        note = f"The mask was found from brightness and covers {found.mean():.1%} of the image."
        capture = replace(capture, mask=found, notes=(*capture.notes, note))
    return capture, found_truth


def _rig_file(path: Path | None, lights: Path | None, *, unknown_lights: bool) -> "RigFile | None":
    """Read the rig file before any image, and refuse it beside other lights."""
    from psstereo.errors import OptionError
    from psstereo.io.rig_file import read_rig

    if path is None:
        return None
    if lights is not None or unknown_lights:
        raise OptionError(
            given="Both --rig and --lights say where the lights are.",
            needed="One of the two.",
            remedy="Leave --lights out; a rig file holds directions, strengths and what is known of the camera.",
        )
    return read_rig(path)
