"""Sizes of images that suites are asked for."""

from psstereo.errors import OptionError

__all__ = ["dimensions"]


def dimensions(text: str) -> tuple[int, int]:
    """Read width and height in pixels.

    Examples
    --------
    >>> dimensions("612x512")
    (612, 512)
    """
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdecimal() and 8 <= int(part) <= 20000 for part in parts):
        raise OptionError(
            given=f"The size is {text!r}.",
            needed="WIDTHxHEIGHT in pixels, from 8 to 20000 each.",
            remedy="Write, for example, 612x512.",
        )
    return int(parts[0]), int(parts[1])
