"""Options on how photographs are read: tone curve, flat field, lens, part, registration, coarser pixels."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from psstereo.errors import OptionError
from psstereo.types import Map, Progress

if TYPE_CHECKING:
    from psstereo.capture import Capture

__all__ = ["ReadingOptions", "read_otherwise"]


@dataclass(frozen=True, kw_only=True)
class ReadingOptions:
    """What was said on the command line.

    Attributes
    ----------
    response : str or None
        ``linear``, ``srgb`` or the exponent of a gamma curve.
    flat : Path or None
        Photograph of a white card, or light as floats.
    lens : Path or None
        File with camera and lens, of ``psstereo calibrate lens``.
    crop : str or None
        ``X,Y,WIDTH,HEIGHT`` in pixels.
    register : str or None
        ``shift`` or ``affine``.
    size : int
        Pixels along a side of the squares that become one [px].
    """

    response: str | None = None
    flat: Path | None = None
    lens: Path | None = None
    crop: str | None = None
    register: str | None = None
    size: int = 1


def read_otherwise(capture: "Capture", options: ReadingOptions, *, over: Map = map, progress: Progress) -> "Capture":
    """Return a capture that is read as the options say, in the order in which light met the camera.

    Parameters
    ----------
    capture : Capture
        As its own files describe it.
    options : ReadingOptions
        What is to be done besides.
    over : map-like
        Executes images, if frames are registered.
    progress : callable
        Told how far that is.

    Returns
    -------
    Capture
        The same capture if nothing is to be done.
    """
    from psstereo.io.lens_file import read_lens
    from psstereo.io.reading_options import binned, cropped, with_flat, with_lens, with_response
    from psstereo_cli.cameras import parse_response

    if options.response is not None:
        capture = with_response(capture, parse_response(options.response))
    if options.flat is not None:
        capture = with_flat(capture, (options.flat,))
    if options.lens is not None:
        camera, lens = read_lens(options.lens)
        capture = with_lens(capture, lens, camera)
    if options.crop is not None:
        x, y, width, height = _crop(options.crop)
        capture = cropped(capture, (y, y + height), (x, x + width))
    if options.register not in (None, "shift", "affine"):
        raise OptionError(
            given=f"The registration is {options.register!r}.",
            needed="shift, or affine, which turns and stretches too.",
            remedy="Leave it out if nothing moved.",
        )
    if options.register is not None:
        from psstereo.calibrate.registration import registered

        capture, _ = registered(capture, model=options.register, over=over, progress=progress)
    return binned(capture, options.size)


def _crop(words: str) -> tuple[int, int, int, int]:
    from psstereo_cli.execution import parse_floats

    numbers = parse_floats(words, 4, "part (X,Y,WIDTH,HEIGHT)")
    if not all(number.is_integer() for number in numbers):
        raise OptionError(
            given=f"The part is {words!r}.", needed="Whole pixels: X,Y,WIDTH,HEIGHT.", remedy="Such as 100,50,800,600."
        )
    x, y, width, height = (int(number) for number in numbers)
    return x, y, width, height
