"""What a camera wrote beside the pixels: when, how long, through which lens, and where."""

from dataclasses import dataclass
from datetime import datetime, timedelta, timezone
from math import isfinite, pi
from pathlib import Path
from typing import Any

from psstereo.errors import InputError, UnreadableFileError
from psstereo.stack.decode import read_bytes

__all__ = ["Exif", "exposure_times", "read_exif"]

_SUB, _GPS = 0x8769, 0x8825
_MAKE, _MODEL, _WHEN_FILE = 0x010F, 0x0110, 0x0132
_EXPOSURE, _F_NUMBER, _ISO, _WHEN, _ZONE, _FOCAL = 0x829A, 0x829D, 0x8827, 0x9003, 0x9011, 0x920A


@dataclass(frozen=True, kw_only=True)
class Exif:
    """The tags of a photograph that calibration has a use for; None where the file does not say.

    Attributes
    ----------
    taken : datetime or None
        When; with a time zone only if the file names one, else the camera's own clock.
    exposure : float or None
        Exposure time [s].
    f_number : float or None
        Focal length over aperture [1].
    iso : float or None
        Sensitivity [1].
    focal_length : float or None
        Of the lens [mm].
    latitude, longitude : float or None
        North and east positive [rad].
    altitude : float or None
        Above the sea [m].
    camera : str
        Maker and model, empty if unknown.
    """

    taken: datetime | None = None
    exposure: float | None = None
    f_number: float | None = None
    iso: float | None = None
    focal_length: float | None = None
    latitude: float | None = None
    longitude: float | None = None
    altitude: float | None = None
    camera: str = ""


def read_exif(path: Path) -> Exif:
    """Read the tags of a photograph: JPEG, TIFF, PNG, WebP, and RAW files that are built like TIFF (DNG, NEF, ARW).

    Not for CR3 and other RAW files in MP4 boxes, which need a tool of their own; nor for images that were edited by a
    program that drops tags.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Exif
        What it says; nothing at all if it has no tags, and None for values that no camera means, such as an exposure
        of 0.

    Raises
    ------
    MissingFileError
        If the file is not there.
    UnreadableFileError
        If it is damaged, or of a kind whose tags cannot be read.
    """
    from PIL import Image

    read_bytes(path)  # one message for what is missing or empty
    try:
        with Image.open(path) as image:
            tags = image.getexif()
            own, sub, gps = dict(tags), dict(tags.get_ifd(_SUB)), dict(tags.get_ifd(_GPS))
    except (OSError, SyntaxError, ValueError, KeyError, TypeError) as error:
        raise UnreadableFileError(
            given=f"The tags of {path} cannot be read ({error}).",
            needed="A photograph with EXIF: JPEG, TIFF, PNG, or a RAW file that is built like TIFF.",
            remedy="Say the values yourself, or convert the file with a program that keeps its tags.",
        ) from None
    merged = {**own, **sub}  # RAW files keep some of them in the first directory
    return Exif(
        taken=_time(merged.get(_WHEN) or merged.get(_WHEN_FILE), merged.get(_ZONE)),
        exposure=_positive(merged.get(_EXPOSURE)),
        f_number=_positive(merged.get(_F_NUMBER)),
        iso=_positive(merged.get(_ISO)),
        focal_length=_positive(merged.get(_FOCAL)),
        latitude=_angle(gps.get(2), gps.get(1), "S", 90.0),
        longitude=_angle(gps.get(4), gps.get(3), "W", 180.0),
        altitude=_altitude(gps.get(6), gps.get(5)),
        camera=" ".join(filter(None, (_text(own.get(_MAKE)), _text(own.get(_MODEL))))),
    )


def exposure_times(paths: tuple[Path, ...]) -> tuple[float, ...]:
    """Return how long each photograph was exposed, corrected to the first one's sensitivity and aperture [s].

    Parameters
    ----------
    paths : tuple of Path
        The photographs.

    Returns
    -------
    tuple of float
        Times that are proportional to the light that reached the sensor, times the gain [s].

    Raises
    ------
    InputError
        If a photograph does not say its exposure time.
    MissingFileError, UnreadableFileError
        If one is not there or damaged.
    """
    found = [read_exif(path) for path in paths]
    silent = [path.name for path, one in zip(paths, found, strict=True) if one.exposure is None]
    if silent:
        others = f", nor do {len(silent) - 1} more" if silent[1:] else ""
        raise InputError(
            given=f"{silent[0]} does not say how long it was exposed{others}.",
            needed="The exposure time of every photograph, as EXIF or as numbers.",
            remedy="Give the times, in seconds, in the order of the photographs.",
        )
    return tuple((one.exposure or 0.0) * _gain(one, found[0]) for one in found)


def _gain(one: Exif, first: Exif) -> float:
    """Return how much brighter sensitivity and aperture make a photograph than the first."""
    gain = one.iso / first.iso if one.iso and first.iso else 1.0
    return gain * ((first.f_number / one.f_number) ** 2 if one.f_number and first.f_number else 1.0)


def _number(value: Any) -> float:
    """Return a tag as a number, NaN if it is none; rationals of 0 / 0 are such."""
    try:
        return float(value[0] if isinstance(value, tuple) else value)
    except (TypeError, ValueError, ZeroDivisionError, IndexError):
        return float("nan")


def _positive(value: Any) -> float | None:
    number = _number(value)
    return number if isfinite(number) and number > 0 else None


def _text(value: Any) -> str:
    return value.strip("\0 ") if isinstance(value, str) else ""


def _time(value: Any, zone: Any) -> datetime | None:
    try:
        taken = datetime.strptime(_text(value), "%Y:%m:%d %H:%M:%S")
    except ValueError:
        return None
    try:
        sign = -1 if _text(zone).startswith("-") else 1
        hours, minutes = (int(part) for part in _text(zone).lstrip("+-").split(":"))
        return taken.replace(tzinfo=timezone(sign * timedelta(hours=hours, minutes=minutes)))
    except ValueError:
        return taken


def _angle(value: Any, side: Any, negative: str, most: float) -> float | None:
    """Return degrees, minutes and seconds as an angle [rad]."""
    if not isinstance(value, tuple) or len(value) != 3:
        return None
    degrees, minutes, seconds = (_number(part) for part in value)
    angle = degrees + minutes / 60.0 + seconds / 3600.0
    if not (isfinite(angle) and 0 <= angle <= most):
        return None
    return (-angle if _text(side).upper() == negative else angle) * pi / 180.0


def _altitude(value: Any, below: Any) -> float | None:
    height = _number(value)
    if not isfinite(height):
        return None
    return -height if below in (1, b"\x01") else height
