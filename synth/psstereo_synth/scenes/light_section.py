"""The section [lights] of a scene file: an arrangement of directions, and what stands there."""

from collections.abc import Callable

import numpy as np

from psstereo.catalogue import choose
from psstereo.errors import InputError, OptionError
from psstereo.io.environment_file import read_environment
from psstereo.io.toml_section import Section
from psstereo.lights import Ambient, Directional, Disc, Harmonics, Led, Light, Polygon, Sun, sun_path
from psstereo.types import FloatArray
from psstereo_synth.rigs import arc, ring, spiral
from psstereo_synth.scenes.values import as_numbers, numbers, positive, real, truth, whole

__all__ = ["read_ambient", "read_lights"]

_MOST = 100_000
"""Lights beyond which a number is taken for a slip."""
_SHARPEST = 10_000
"""Exponent of a lamp's lobe beyond which it is a laser."""

_IRRADIANCE = "a positive number, three for red, green and blue, or a row for each light"
_DEFAULT_TILT = {"spiral": 60.0, "ring": np.degrees(np.arctan(np.sqrt(2.0))), "arc": 60.0}

_ARRANGED = {
    "spiral": ("count", "tilt_deg"),
    "ring": ("count", "tilt_deg"),
    "arc": ("count", "tilt_deg", "azimuth_deg"),
    "day": ("count", "latitude_deg", "day", "hours"),
    "list": ("directions",),
}
_MADE = {
    "directional": (),
    "sun": ("angular_radius_deg",),
    "led": ("distance", "mu"),
    "disc": ("distance", "radius"),
    "window": ("distance", "width"),
}


def read_lights(section: Section, count: int | None) -> tuple[Light, ...]:
    """Return the lights of a scene.

    Parameters
    ----------
    section : Section
        The table [lights].
    count : int or None
        Number of lights to arrange instead of the file's.

    Returns
    -------
    tuple of Light
        In the order of the images, in the scene's frame.

    Raises
    ------
    PsstereoError
        If a word or key is unknown, a value is missing or means nothing, or no light is above the horizon.
    """
    arrangement = section.text("arrangement") or ("list" if "directions" in section.values else "spiral")
    kind = section.text("kind") or "directional"
    keys = choose(_ARRANGED, arrangement, "arrangement of lights") + choose(_MADE, kind, "kind of light")
    section.allow(("arrangement", "kind", "irradiance", *keys))
    if count is not None and not 1 <= count <= _MOST:
        raise OptionError(
            given=f"{count} lights are asked for.",
            needed=f"From one to {_MOST}.",
            remedy="Give another number with --lights.",
        )
    if arrangement == "list" and count is not None:
        raise OptionError(
            given=f"{count} lights are asked for, and {section.file.name} lists its lights one by one.",
            needed="An arrangement, such as a spiral, can have any number of lights.",
            remedy='Leave --lights out, or write arrangement = "spiral".',
        )
    directions = _arrange(section, arrangement, count)
    irradiance = _irradiance(section, len(directions))
    make = _maker(section, kind)
    return tuple(make(d, e) for d, e in zip(directions, irradiance, strict=True))


def read_ambient(section: Section) -> tuple[Light | None, bool]:
    """Return the light that is there in every image, and whether an image of it alone comes along.

    Parameters
    ----------
    section : Section
        The table [ambient].

    Returns
    -------
    light : Light or None
        None if the table has none.
    dark_frame : bool
        Whether there is a dark frame.

    Raises
    ------
    PsstereoError
        If there is more than one light, a key is unknown, a value means nothing, or a file cannot be used.
    """
    section.allow(("radiance", "environment", "harmonics", "dark_frame"))
    given = [key for key in ("radiance", "environment", "harmonics") if key in section.values]
    dark = truth(section, "dark_frame", default=False)
    if len(given) > 1:
        raise InputError(
            given=f"[ambient] in {section.file.name} has {' and '.join(given)}.",
            needed="One of radiance (the same from everywhere), environment (a map) or harmonics (coefficients).",
            remedy="Keep one of them.",
        )
    if not given:
        return None, dark
    if given == ["environment"]:
        path = section.path("environment")
        assert path is not None
        return read_environment(path), dark
    if given == ["radiance"]:
        return Ambient(radiance=_colour(section, "radiance")), dark
    return Harmonics(coefficients=numbers(section, "harmonics", "nine numbers, or nine rows of three")), dark


def _colour(section: Section, key: str) -> FloatArray:
    """Return a positive number, or three for red, green and blue."""
    found = np.atleast_1d(numbers(section, key, "a positive number, or three for red, green and blue"))
    if found.shape not in ((1,), (3,)) or not ((found > 0) & np.isfinite(found)).all():
        raise section.wrong(key, "a positive number, or three for red, green and blue")
    return found


def _arrange(section: Section, arrangement: str, given: int | None) -> FloatArray:
    if arrangement == "list":
        return _listed(section)
    count = whole(section, "count", 24, least=1, most=_MOST)
    count = count if given is None else given
    if arrangement == "day":
        return _day(section, count)
    tilt = np.deg2rad(real(section, "tilt_deg", float(_DEFAULT_TILT[arrangement])))
    if not 0 < tilt < np.pi / 2:
        raise section.wrong("tilt_deg", "an angle between 0 and 90 degrees from the view")
    if arrangement == "spiral":
        return spiral(count, max_tilt=tilt)
    if arrangement == "ring":
        return ring(count, tilt=tilt)
    return arc(count, max_tilt=tilt, azimuth=np.deg2rad(real(section, "azimuth_deg", 0.0)))


def _listed(section: Section) -> FloatArray:
    """Return directions that stand in the scene file, or in a file of their own."""
    needed = "a list of directions [x, y, z] toward the lights, or the name of a file of them"
    value = section.values.get("directions")
    found = section.matrix("directions", 3) if isinstance(value, str) and value else as_numbers(value)
    if found is None or found.ndim != 2 or found.shape[1] != 3 or not 1 <= len(found) <= _MOST:
        raise section.wrong("directions", needed)
    wrong = [i for i, row in enumerate(found, 1) if not (np.isfinite(row).all() and row.any())]
    if wrong:
        raise InputError(
            given=f"Direction {wrong[0]} of [lights] in {section.file.name} is {found[wrong[0] - 1].tolist()}.",
            needed="Three finite numbers that are not all zero.",
            remedy="Correct that row.",
        )
    return found


def _day(section: Section, count: int) -> FloatArray:
    """Return the sun's directions over a day: x east, y north, z up."""
    value = as_numbers(section.values.get("hours", [6.0, 18.0]))
    if value is None or value.shape != (2,) or not 0 <= value[0] < value[1] <= 24:
        raise section.wrong("hours", "the first and the last hour, such as [8, 16]")
    latitude, day = real(section, "latitude_deg", 0.0), real(section, "day", 172.0)
    if not -90 <= latitude <= 90:
        raise section.wrong("latitude_deg", "a latitude from -90 to 90 degrees, positive in the north")
    if not 1 <= day < 367:
        raise section.wrong("day", "a day of the year, from 1 to 366")
    path = sun_path(np.deg2rad(latitude), day, np.linspace(value[0], value[1], count))
    below = np.count_nonzero(path[:, 2] <= 0)
    if below:
        raise InputError(
            given=f"At {below} of {count} hours of [lights] in {section.file.name} the sun is below the horizon.",
            needed="A sun that is up.",
            remedy="Give hours from after sunrise to before sunset, or another day of the year.",
        )
    return path


def _irradiance(section: Section, count: int) -> FloatArray:
    """Return the irradiance at the origin of a surface that faces each light, (m, c) [W m⁻²]."""
    found = as_numbers(section.values.get("irradiance", 1000.0))
    if found is None or found.ndim > 2 or not ((found > 0) & np.isfinite(found)).all():
        raise section.wrong("irradiance", _IRRADIANCE)
    found = np.atleast_1d(found)
    if found.shape[-1] not in (1, 3) or found.size == 0:
        raise section.wrong("irradiance", _IRRADIANCE)
    if found.ndim == 2 and len(found) != count:
        raise section.wrong("irradiance", f"one row for each of the {count} lights")
    return np.broadcast_to(found, (count, found.shape[-1]))


def _maker(section: Section, kind: str) -> Callable[[FloatArray, FloatArray], Light]:
    """Return what turns a direction and an irradiance into a light."""
    if kind == "directional":
        return lambda d, e: Directional(direction=d, strength=e)
    if kind == "sun":
        degrees = real(section, "angular_radius_deg", 0.2666)
        if not 0 < degrees <= 90:
            raise section.wrong("angular_radius_deg", "an angle above 0 and up to 90 degrees")
        angle = float(np.deg2rad(degrees))
        return lambda d, e: Sun.of_irradiance(d, e, angular_radius=angle)
    distance = positive(section, "distance", 3.0)

    def place(direction: FloatArray) -> tuple[FloatArray, FloatArray]:
        toward = direction / np.linalg.norm(direction)
        return distance * toward, -toward

    def led(direction: FloatArray, irradiance: FloatArray) -> Light:
        position, axis = place(direction)
        return Led(position=position, axis=axis, mu=mu, flux=irradiance * distance**2)

    def disc(direction: FloatArray, irradiance: FloatArray) -> Light:
        centre, axis = place(direction)
        seen = np.pi * radius**2 / (radius**2 + distance**2)  # E = π L sin² of the angle under which it is seen
        return Disc(centre=centre, axis=axis, radius=radius, radiance=irradiance / seen)

    def window(direction: FloatArray, irradiance: FloatArray) -> Light:
        centre, axis = place(direction)
        corners = _square(centre, axis, width)
        unit = Polygon(vertices=corners, radiance=np.ones(1)).irradiance(np.zeros(3), -axis)
        return Polygon(vertices=corners, radiance=irradiance / unit)

    mu = real(section, "mu", 1.0)
    if not 0 <= mu <= _SHARPEST:
        raise section.wrong("mu", f"an exponent from 0, all around, to {_SHARPEST}")
    radius, width = positive(section, "radius", 0.5), positive(section, "width", 1.0)
    return {"led": led, "disc": disc, "window": window}[kind]


def _square(centre: FloatArray, axis: FloatArray, width: float) -> FloatArray:
    """Return the corners of a square that shines along an axis, counter-clockwise seen from its lit side."""
    side = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
    u = side / np.linalg.norm(side) * width / 2
    v = np.cross(axis, u)
    return np.array([centre - u - v, centre + u - v, centre + u + v, centre - u + v])
