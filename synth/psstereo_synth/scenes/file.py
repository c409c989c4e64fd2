"""Scene files: a scene written down in TOML."""

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from psstereo.errors import InputError, MissingFileError, UnreadableFileError
from psstereo.io.toml_section import Section
from psstereo.stack import LINEAR, Response
from psstereo_synth.faults import FAULTS, Fault
from psstereo_synth.scenes.build import build, build_member
from psstereo_synth.scenes.camera_section import read_viewpoints
from psstereo_synth.scenes.light_section import read_ambient, read_lights
from psstereo_synth.scenes.scene import Scene
from psstereo_synth.scenes.surface_section import read_material, read_surface
from psstereo_synth.scenes.values import real, truth, whole
from psstereo_synth.sensor import Sensor

__all__ = ["Changes", "parse_scene", "read_scene"]

_KEYS = (
    "name",
    "summary",
    "size",
    "seed",
    "unit",
    "camera",
    "views",
    "surface",
    "material",
    "albedo",
    "lights",
    "ambient",
    "render",
    "sensor",
    "faults",
)

_LARGEST = 20_000
"""Rows or columns beyond which a size is taken for a slip."""
_MOST_DIRECTIONS = 65_536
"""Beams of a light or directions of bounced light beyond which a number is taken for a slip."""
_WHOLE = 2**63
"""Whole numbers from here on are none of TOML's."""


@dataclass(frozen=True, kw_only=True)
class Changes:
    """What is asked for instead of what a scene file says.

    Attributes
    ----------
    size : (int, int) or None
        Rows and columns.
    lights : int or None
        Number of lights to arrange.
    seed : int or None
        Of the faults and of the sensor's noise.
    """

    size: tuple[int, int] | None = None
    lights: int | None = None
    seed: int | None = None


def read_scene(path: Path, changes: Changes | None = None) -> Scene:
    """Read a scene from a TOML file; other files that it names are relative to its folder.

    Parameters
    ----------
    path : Path
        The file.
    changes : Changes, optional
        What to take instead of what it says.

    Returns
    -------
    Scene
        The scene; its name is the file's if it gives none.

    Raises
    ------
    PsstereoError
        If the file is missing, is no TOML, or holds what a scene has not; the nearest names are offered.
    """
    try:
        raw = path.read_bytes()
    except FileNotFoundError:
        raise MissingFileError(
            given=f"The scene file {path} does not exist.",
            needed="A TOML file, or the name of a scene of the gallery.",
            remedy="Check its name; psstereo synth --list names the gallery's.",
        ) from None
    except (OSError, ValueError) as error:
        raise UnreadableFileError(
            given=f"The scene file {path} cannot be read ({getattr(error, 'strerror', None) or error}).",
            needed="A readable file.",
            remedy="Check that it is a file and that you may read it.",
        ) from None
    return parse_scene(raw, path, changes)


def parse_scene(raw: bytes, path: Path, changes: Changes | None = None) -> Scene:
    """Return the scene that the bytes of a TOML file describe; `path` is for messages and for files it names."""
    top, wanted = Section(_toml(raw, path), "", path), changes or Changes()
    top.allow(_KEYS)
    size = wanted.size or _size(top)
    _check_size(size)
    seed = whole(top, "seed", 0, least=0, most=_WHOLE - 1) if wanted.seed is None else wanted.seed
    surface, reach = read_surface(top.section("surface"))
    ambient, dark = read_ambient(top.section("ambient"))
    return Scene(
        name=top.text("name") or path.stem,
        summary=top.text("summary") or "",
        surface=surface,
        material=read_material(top.section("material"), top.section("albedo")),
        viewpoints=read_viewpoints(top, size, reach),
        size=size,
        lights=read_lights(top.section("lights"), wanted.lights),
        ambient=ambient,
        dark_frame=dark,
        sensor=_sensor(top.section("sensor"), seed, replaced=wanted.seed is not None),
        faults=_faults(top),
        unit=top.text("unit") or "mm",
        seed=seed,
        **_render(top.section("render")),
    )


def _toml(raw: bytes, path: Path) -> dict[str, Any]:
    try:
        values = tomllib.loads(raw.decode("utf-8-sig"))
        _require_small(values)
    except (ValueError, RecursionError) as error:  # among them numbers of more digits than Python reads
        raise UnreadableFileError(
            given=f"{path} is not valid TOML: {error}.",
            needed='Lines such as name = "hills", below headings such as [surface], in UTF-8.',
            remedy="Correct that place; psstereo synth --template shows a scene.",
        ) from None
    return values


def _require_small(value: Any) -> None:
    """Refuse whole numbers that TOML does not know, and that are nothing but trouble further on."""
    if isinstance(value, dict):
        for item in value.values():
            _require_small(item)
    elif isinstance(value, list):
        for item in value:
            _require_small(item)
    elif isinstance(value, int) and not -_WHOLE <= value < _WHOLE:
        raise ValueError("a whole number has more than 64 bits")


def _size(top: Section) -> tuple[int, int]:
    value = top.values.get("size", [256, 256])
    if not (isinstance(value, list) and len(value) == 2 and all(type(v) is int for v in value)):
        raise top.wrong("size", "width and height in pixels, such as [256, 256]")
    return int(value[1]), int(value[0])


def _check_size(size: tuple[int, int]) -> None:
    if not all(1 <= v <= _LARGEST for v in size):
        raise InputError(
            given=f"Images of {size[1]} × {size[0]} pixels are asked for.",
            needed=f"Width and height from 1 to {_LARGEST} pixels.",
            remedy="Give another size, such as 256 or 612x512.",
        )


def _render(section: Section) -> dict[str, Any]:
    section.allow(("cast_shadows", "beams", "bounce", "extinction"))
    return {
        "cast_shadows": truth(section, "cast_shadows", default=True),
        "beams": whole(section, "beams", 64, least=1, most=_MOST_DIRECTIONS),
        "bounce": whole(section, "bounce", 0, least=0, most=_MOST_DIRECTIONS),
        "extinction": real(section, "extinction", 0.0),
    }


def _sensor(section: Section, seed: int, *, replaced: bool) -> Sensor:
    """Return the sensor; its noise has the scene's seed, unless the table has one and nothing else is asked for."""
    values = dict(section.values)
    response = _response(section, values.pop("response", "linear"))
    bits = values.pop("bits", 16)
    if not (bits == "float" or (type(bits) is int and bits in (8, 10, 12, 14, 16))):
        raise section.wrong("bits", '8, 10, 12, 14, 16 or "float"')
    sensor = build(Sensor, Section(values, "sensor", section.file), known=("response", "bits"))
    own_seed = "seed" in values and not replaced
    return replace(
        sensor, response=response, bits=None if bits == "float" else bits, seed=sensor.seed if own_seed else seed
    )


def _response(section: Section, value: Any) -> Response:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return Response("gamma", float(value))
    if value not in ("linear", "srgb"):
        raise section.wrong("response", '"linear", "srgb" or the exponent of a gamma curve such as 2.2')
    return LINEAR if value == "linear" else Response("srgb")


def _faults(top: Section) -> tuple[Fault, ...]:
    tables = top.values.get("faults", [])
    if not (isinstance(tables, list) and all(isinstance(table, dict) for table in tables)):
        raise top.wrong("faults", "tables [[faults]], each with the name of a fault")
    return tuple(build_member(FAULTS, Section(table, "faults", top.file), "fault", "fault") for table in tables)
