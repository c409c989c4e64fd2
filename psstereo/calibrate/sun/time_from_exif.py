"""When and where photographs were taken, from their EXIF tags, with the zone that a sun's position needs."""

import re
from datetime import UTC, datetime, timedelta, timezone, tzinfo

from psstereo.calibrate.sun.position import Place
from psstereo.errors import InputError, OptionError
from psstereo.io.exif import Exif

__all__ = ["parse_zone", "place_of", "time_of"]


def parse_zone(text: str) -> tzinfo:
    """Read a time zone: an offset such as ``+02:00``, ``Z``, or a name such as ``Europe/Berlin``.

    Parameters
    ----------
    text : str
        The zone.

    Returns
    -------
    tzinfo
        The zone; by name it knows when summer time began.

    Raises
    ------
    OptionError
        If there is no such zone.

    Examples
    --------
    >>> print(parse_zone("+5:30").utcoffset(None))
    5:30:00
    """
    if text.strip().upper() in ("Z", "UTC"):
        return UTC
    match = re.fullmatch(r"\s*([+-])(\d{1,2})(?::?([0-5]\d))?\s*", text)
    if match is not None and int(match[2]) <= 14:
        size = timedelta(hours=int(match[2]), minutes=int(match[3] or 0))
        return timezone(size if match[1] == "+" else -size)
    from zoneinfo import ZoneInfo

    try:
        return ZoneInfo(text.strip())
    except (KeyError, ValueError, OSError):
        raise OptionError(
            given=f"The time zone is {text!r}.",
            needed="An offset from universal time such as +02:00, or a name such as Europe/Berlin.",
            remedy="Positive offsets are east of Greenwich; summer time adds an hour.",
        ) from None


def time_of(tags: Exif, name: str, zone: tzinfo | None = None) -> datetime:
    """Return when a photograph was taken, with its zone.

    Not for edited or scanned pictures, which keep other times or none; and as right as the camera's clock: a minute is
    0.25° of the sun.

    Parameters
    ----------
    tags : Exif
        What the camera wrote.
    name : str
        What the photograph is called, for messages.
    zone : tzinfo, optional
        Zone of the camera's clock, for photographs without an offset; their own offset comes first.

    Returns
    -------
    datetime
        The moment of exposure.

    Raises
    ------
    InputError
        If there is no time; or no offset where no zone is given.
    """
    if tags.taken is None:
        raise InputError(
            given=f"{name} does not say when it was taken (EXIF DateTimeOriginal).",
            needed="The time of each photograph.",
            remedy="Give it with --time, once for each photograph, in their order.",
        )
    if tags.taken.utcoffset() is not None:
        return tags.taken
    if zone is None:
        raise InputError(
            given=f"{name} was taken at {tags.taken.isoformat(sep=' ')} of an unknown time zone.",
            needed="The zone of the camera's clock: an hour turns the sun by 15 degrees.",
            remedy="Give --zone, such as --zone +02:00 or --zone Europe/Berlin.",
        )
    return tags.taken.replace(tzinfo=zone)


def place_of(tags: Exif, name: str) -> Place:
    """Return where a photograph was taken.

    Parameters
    ----------
    tags : Exif
        What the camera wrote.
    name : str
        What the photograph is called, for messages.

    Returns
    -------
    Place
        By GPS, at sea level if it gives no height.

    Raises
    ------
    InputError
        If the camera did not know.
    """
    if tags.latitude is None or tags.longitude is None:
        raise InputError(
            given=f"{name} does not say where it was taken (EXIF GPS).",
            needed="Latitude and longitude: a degree of the globe is a degree of the sun.",
            remedy="Give --place LATITUDE,LONGITUDE in degrees, north and east positive.",
        )
    return Place(latitude=tags.latitude, longitude=tags.longitude, height=tags.altitude or 0.0)
