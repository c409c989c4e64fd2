"""From a capture to a folder in one of the known layouts."""

from pathlib import Path

from psstereo.capture import Capture, Truth
from psstereo.catalogue import choose
from psstereo.io.atomic import new_folder
from psstereo.io.writer_catalogue import WRITERS
from psstereo.types import Map, Progress, no_progress

__all__ = ["write_capture"]


def write_capture(
    capture: Capture,
    folder: Path | str,
    layout: str = "capture",
    *,
    truth: Truth | None = None,
    overwrite: bool = False,
    over: Map = map,
    progress: Progress = no_progress,
) -> tuple[str, ...]:
    """Write a capture into a folder, which appears whole or not at all.

    Images are asked for one at a time, so that a stack that renders or decodes them is never held. The same capture
    gives the same bytes, with any `over`.

    Parameters
    ----------
    capture : Capture
        What is written.
    folder : Path or str
        Where; it must be new or empty.
    layout : str
        A key of :data:`WRITERS`; only ``"capture"``, our own, holds all that a capture and its truth can say.
    truth : Truth, optional
        What is known of it; each layout has a place for some parts of it.
    overwrite : bool
        Whether a folder may be replaced whose files are, by their names, just those that will be written, no other and
        none less. Any other folder with content is refused even then.
    over : map-like
        Executes the writing of single images, such as ``ThreadPoolExecutor().map``.
    progress : callable
        Told how many images are written.

    Returns
    -------
    tuple of str
        What the layout has no place for and was left out, as sentences; empty if nothing.

    Raises
    ------
    OptionError
        If the layout is unknown.
    UnsupportedError
        If lights, camera or images are of a kind that the layout cannot hold; nothing is written then.
    InputError
        If the truth does not have the images' size, or an image is not what its stack promises.
    ExistingResultError
        If something is in the way.
    """
    writer = choose(WRITERS, layout, "layout")
    writer.check(capture, truth)
    with new_folder(Path(folder), overwrite=overwrite, names=writer.file_names(capture, truth)) as work:
        writer.write(work, capture, truth, over=over, progress=progress)
    return writer.left_out(capture, truth)
