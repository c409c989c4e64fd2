"""From the words on the command line to a capture."""

from pathlib import Path

from psstereo.capture import Capture, Truth
from psstereo.types import Map, Progress

__all__ = ["load_capture"]


def load_capture(
    folder: Path,
    *,
    layout: str | None,
    lights: Path | None,
    unknown_lights: bool = False,
    lights_layout: str | None,
    mask: str | None,
    ambient: Path | None = None,
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
    unknown_lights : bool
        Whether the lights are to be found from the images, so that the folder may be without any.
    ambient : Path, optional
        Frame without any of the lights, to subtract.
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
    """
    from dataclasses import replace

    from psstereo.io import Choices, read_capture

    choices = Choices(
        lights=lights,
        lights_layout=lights_layout,
        unknown_lights=unknown_lights,
        mask=Path(mask) if mask not in (None, "none", "auto") else None,
        ignore_mask=mask in ("none", "auto"),
        truth=truth,
    )
    capture, found_truth = read_capture(folder, layout=layout, choices=choices)
    if ambient is not None:
        from psstereo.io.ambient_frame import with_ambient

        capture = with_ambient(capture, ambient)
    if mask == "auto":
        from psstereo.masking import mask_from_brightness

        found = mask_from_brightness(capture.stack, over=over, progress=progress)
        note = f"The mask was found from brightness and covers {found.mean():.1%} of the image."
        capture = replace(capture, mask=found, notes=(*capture.notes, note))
    return capture, found_truth
