"""Light domes of relight: ``.dome`` files."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from psstereo.errors import InputError, UnreadableFileError
from psstereo.io.text import read_lines
from psstereo.types import FloatArray

__all__ = ["CONFIGURATIONS", "Dome", "dome_text", "read_dome"]

CONFIGURATIONS = ("directional", "spherical", "lights3d")
"""What the lights of a dome are: far away, on a sphere, or each at a place of its own."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Dome:
    """A dome as its file has it, about the middle of the object, x right, y up, z toward the camera.

    Attributes
    ----------
    configuration : str
        One of :data:`CONFIGURATIONS`.
    directions : float64 array (m, 3)
        Toward the lights [1].
    positions : float64 array (m, 3) or None
        Where they are, of domes that are not directional [mm].
    image_width : float
        Length that the picture's width is on the object, 0 if it is not known [mm].
    diameter, vertical_offset : float
        Of the dome, 0 if it is not known [mm].
    label, notes : str
        What its maker wrote.
    adjusted : bool
        Whether it states colours of single lamps (``ledAdjust``), which are not read: whether they stand for the lamps
        or for what makes up for them is not known.
    """

    configuration: str
    directions: FloatArray
    positions: FloatArray | None = None
    image_width: float = 0.0
    diameter: float = 0.0
    vertical_offset: float = 0.0
    label: str = ""
    notes: str = ""
    adjusted: bool = False


def read_dome(path: str | os.PathLike[str]) -> Dome:
    """Read a ``.dome`` file.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    Dome
        What it holds.

    Raises
    ------
    MissingFileError
        If it is not there.
    UnreadableFileError
        If it is not JSON of this form.
    InputError
        If it has no lights, or not as many positions as directions.
    """
    file = Path(path)
    try:
        content = json.loads("\n".join(read_lines(file)))
    except (ValueError, RecursionError) as error:
        raise _wrong(file, f"is not valid JSON ({error})") from None
    if not isinstance(content, dict):
        raise _wrong(file, "holds no table")
    configuration = content.get("lightConfiguration", "directional")
    if configuration not in CONFIGURATIONS:
        raise _wrong(file, f"has the lightConfiguration {str(configuration)[:40]!r}")
    directions = _vectors(file, content, "directions")
    positions = None
    if configuration != "directional":
        positions = _vectors(file, content, "positionsSphere" if configuration == "spherical" else "positions3d")
        if len(positions) == 0:
            positions = _vectors(file, content, "positions")  # what older versions call both
    found = directions if positions is None else positions
    if len(found) == 0 or (positions is not None and len(directions) not in (0, len(positions))):
        raise InputError(
            given=f"{file.name} has {len(directions)} directions"
            + ("." if positions is None else f" and {len(positions)} positions, and is {configuration}."),
            needed="One direction a light, and one position unless the dome is directional.",
            remedy="Save the dome again in relight.",
        )
    adjust = content.get("ledAdjust") or []
    return Dome(
        configuration=configuration,
        directions=found if len(directions) == 0 else directions,
        positions=positions,
        image_width=_number(file, content, "imageWidth"),
        diameter=_number(file, content, "domeDiameter"),
        vertical_offset=_number(file, content, "verticalOffset"),
        label=str(content.get("label") or ""),
        notes=str(content.get("notes") or ""),
        adjusted=any(not isinstance(one, Mapping) or set(one.values()) != {1} for one in adjust),
    )


def dome_text(dome: Dome) -> str:
    """Return the text of a ``.dome`` file; numbers come back to the last bit.

    Parameters
    ----------
    dome : Dome
        What it is to hold; directions are written as unit vectors.

    Returns
    -------
    str
        JSON.
    """
    unit = dome.directions / np.sqrt((dome.directions**2).sum(axis=1, keepdims=True))
    places = {"spherical": "positionsSphere", "lights3d": "positions3d"}
    content: dict[str, object] = {
        "label": dome.label,
        "notes": dome.notes,
        "imageWidth": dome.image_width,
        "domeDiameter": dome.diameter,
        "verticalOffset": dome.vertical_offset,
        "lightConfiguration": dome.configuration,
        "directions": _as_tables(unit),
        "positionsSphere": [],
        "positions3d": [],
        "ledAdjust": [],
    }
    if dome.positions is not None:
        content[places[dome.configuration]] = _as_tables(dome.positions)
    return json.dumps(content, indent=4, ensure_ascii=False, allow_nan=False) + "\n"


def _as_tables(vectors: FloatArray) -> list[dict[str, float]]:
    return [dict(zip("xyz", (float(x) for x in vector), strict=True)) for vector in vectors]


def _vectors(file: Path, content: Mapping[str, Any], name: str) -> FloatArray:
    rows = content.get(name) or []
    try:
        vectors = np.array([[float(row[axis]) for axis in "xyz"] for row in rows], np.float64).reshape(-1, 3)
    except (TypeError, ValueError, KeyError):
        raise _wrong(file, f"has {name} that are no list of x, y, z") from None
    bad = np.flatnonzero(~np.isfinite(vectors).all(axis=1) | ~(vectors != 0).any(axis=1))
    if len(bad):
        raise _wrong(file, f"has {vectors[bad[0]].tolist()} as entry {bad[0] + 1} of {name}")
    return vectors


def _number(file: Path, content: Mapping[str, Any], name: str) -> float:
    value = content.get(name, 0.0)
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise _wrong(file, f"has the {name} {str(value)[:40]!r}")
    return float(value)


def _wrong(file: Path, how: str) -> UnreadableFileError:
    return UnreadableFileError(
        given=f"The dome {file} {how}.",
        needed='JSON such as {"lightConfiguration": "directional", "directions": [{"x": 0, "y": 0, "z": 1}, …]}.',
        remedy="Save the dome again in relight.",
    )
