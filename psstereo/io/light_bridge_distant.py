"""Formats of distant lights: ``.lp``, DiLiGenT's and PSBox's text files, Meshroom's JSON."""

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

import numpy as np

from psstereo.camera import Pinhole
from psstereo.errors import InputError, RigError, UnsupportedError
from psstereo.io.layout_writer import Save, camera_file, numbers, text_file, three
from psstereo.io.light_bridge_table import LightFormat, LightTable, as_capture, default_names
from psstereo.io.light_file import read_directions
from psstereo.io.light_json import read_light_json
from psstereo.io.lp_file import read_lp, write_lp
from psstereo.io.meshroom_writer import MeshroomWriter
from psstereo.io.parts import find_camera, natural_order
from psstereo.io.text import read_lines, read_table
from psstereo.io.write_checks import distant_lights
from psstereo.lights import Rig
from psstereo.types import FloatArray

__all__ = ["DiligentLights", "LpLights", "MeshroomLights", "PsBoxLights", "matrix_of_lights"]

_DIRECTIONS = "light_directions.txt"
_CIRCLE = "circle_data.txt"


class LpLights(LightFormat):
    """RTI's ``.lp``: image names and directions, no strengths."""

    name: ClassVar[str] = "lp"
    summary: ClassVar[str] = "NAME.lp: image names and directions (RTI: relight, Meshroom), z > 0"
    file_name: ClassVar[str] = ".lp"
    holds: ClassVar[frozenset[str]] = frozenset({"names"})

    def recognise(self, path: Path) -> bool:
        """See :meth:`LightFormat.recognise`."""
        return path.is_file() and path.suffix.lower() == ".lp"

    def read(self, path: Path) -> LightTable:
        """See :meth:`LightFormat.read`."""
        found = read_lp(path)
        rig = Rig.distant(found.vectors, source=path.name)
        return LightTable(rig=rig, names=found.names, source=path.name, notes=found.notes)

    def files(self, table: LightTable) -> Mapping[str, Save]:
        """See :meth:`LightFormat.files`."""
        directions, _ = distant_lights(as_capture(table, self.name, lamps=False), self.name)
        below = np.flatnonzero(directions[:, 2] <= 0)
        if below.size:
            raise UnsupportedError(
                given=f"Light {below[0] + 1} has z = {directions[below[0], 2]:.3g}, from the side or from behind.",
                needed="RTI programs know lights on the upper half of the dome only, z > 0.",
                remedy="Leave that light out, or choose another format.",
            )
        names = default_names(table)
        return {"": lambda path: write_lp(path, names, directions, digits=17)}

    def left_out(self, table: LightTable) -> tuple[str, ...]:
        """See :meth:`LightFormat.left_out`; it also says when names had to be made up."""
        made = () if table.names else ("The lights had no image names; they were made up: 0001.png ….",)
        return (*super().left_out(table), *made)


class DiligentLights(LightFormat):
    """DiLiGenT's ``light_directions.txt`` with one row a light, and what lies beside it."""

    name: ClassVar[str] = "diligent"
    summary: ClassVar[str] = "a folder: light_directions.txt (m × 3), light_intensities.txt, filenames.txt, K.txt"
    holds: ClassVar[frozenset[str]] = frozenset({"strengths", "names", "pinhole"})

    def recognise(self, path: Path) -> bool:
        """See :meth:`LightFormat.recognise`."""
        return _columns(path) == "rows"

    def read(self, path: Path) -> LightTable:
        """See :meth:`LightFormat.read`."""
        if path.is_file():
            return matrix_of_lights(path, layout="rows")
        found = read_directions(path / _DIRECTIONS, layout="rows")
        powers, names = path / "light_intensities.txt", path / "filenames.txt"
        strengths = _strengths(powers, len(found.vectors)) if powers.is_file() else None
        camera, _ = find_camera(path)
        return LightTable(
            rig=Rig.distant(found.vectors, strengths, source=_DIRECTIONS),
            names=_names(names, len(found.vectors)) if names.is_file() else (),
            camera=camera if isinstance(camera, Pinhole) else None,
            source=path.name,
            notes=found.notes,
        )

    def files(self, table: LightTable) -> Mapping[str, Save]:
        """See :meth:`LightFormat.files`."""
        directions, strengths = distant_lights(as_capture(table, self.name, lamps=False), self.name)
        files = {
            _DIRECTIONS: text_file([numbers(row) for row in directions]),
            "light_intensities.txt": text_file([numbers(row) for row in three(strengths)]),
        }
        if table.names:
            files["filenames.txt"] = text_file(list(table.names))
        if isinstance(table.camera, Pinhole):
            files["K.txt"] = camera_file(table.camera)
        return files


class PsBoxLights(LightFormat):
    """PSBox's ``light_directions.txt`` with one column a light, strengths, circles of mirror balls."""

    name: ClassVar[str] = "psbox"
    summary: ClassVar[str] = "a folder: light_directions.txt (3 × m), light_strength.txt, LightProbe-1/circle_data.txt"
    holds: ClassVar[frozenset[str]] = frozenset({"strengths", "balls"})

    def recognise(self, path: Path) -> bool:
        """See :meth:`LightFormat.recognise`."""
        return _columns(path) == "columns" or (path / "refined_light.txt").is_file()

    def read(self, path: Path) -> LightTable:
        """See :meth:`LightFormat.read`."""
        if path.is_file():
            return matrix_of_lights(path, layout="columns")
        refined, powers = path / "refined_light.txt", path / "light_strength.txt"
        source = refined if refined.is_file() else path / _DIRECTIONS
        found = read_directions(source, layout="columns")
        strengths = None
        if source is refined:  # a refined light's length is its strength
            strengths = np.sqrt((found.vectors**2).sum(axis=1))
        elif powers.is_file():
            strengths = _strengths(powers, len(found.vectors))
        probes = natural_order(probe for probe in path.glob("LightProbe-*") if (probe / _CIRCLE).is_file())
        return LightTable(
            rig=Rig.distant(found.vectors, strengths, source=source.name),
            balls=np.array([_circle(probe / _CIRCLE) for probe in probes]) if probes else None,
            source=path.name,
        )

    def files(self, table: LightTable) -> Mapping[str, Save]:
        """See :meth:`LightFormat.files`."""
        directions, strengths = distant_lights(as_capture(table, self.name, lamps=False), self.name)
        if (strengths != strengths[:, :1]).any():
            raise UnsupportedError(
                given="The lights have colours: strengths that differ between channels.",
                needed="PSBox knows one strength a light.",
                remedy="Choose diligent, meshroom or rig.",
            )
        files = {
            _DIRECTIONS: text_file([numbers(row) for row in directions.T]),
            "light_strength.txt": text_file([numbers(row) for row in strengths[:, :1]]),
        }
        for i, circle in enumerate(() if table.balls is None else table.balls):
            files[f"LightProbe-{i + 1}/{_CIRCLE}"] = text_file([numbers(circle[k : k + 1]) for k in range(3)])
        return files


class MeshroomLights(LightFormat):
    """Meshroom's JSON file: y down and z into the scene, numbers as texts."""

    name: ClassVar[str] = "meshroom"
    summary: ClassVar[str] = "NAME.json: directions and intensities (Meshroom), views numbered from 1"
    file_name: ClassVar[str] = ".json"
    holds: ClassVar[frozenset[str]] = frozenset({"strengths"})

    def recognise(self, path: Path) -> bool:
        """See :meth:`LightFormat.recognise`."""
        return path.is_file() and path.suffix.lower() == ".json"

    def read(self, path: Path) -> LightTable:
        """See :meth:`LightFormat.read`."""
        found = read_light_json(path)
        named = all(found.keys) and not any(key.isdecimal() for key in found.keys)  # numbers are views, not images
        return LightTable(
            rig=Rig.distant(found.vectors, found.strengths, source=path.name),
            names=found.keys if named else (),
            source=path.name,
        )

    def files(self, table: LightTable) -> Mapping[str, Save]:
        """See :meth:`LightFormat.files`."""
        return {"": MeshroomWriter().parts(as_capture(table, self.name, lamps=False), None)["lights.json"]}


def matrix_of_lights(path: Path, *, layout: str | None = None) -> LightTable:
    """Read a bare matrix of light directions, the way that ``psstereo reconstruct --lights`` does.

    Parameters
    ----------
    path : Path
        Text, ``.npy`` or ``.mat``.
    layout : {"rows", "columns"}, optional
        One light a row or a column, where the numbers cannot tell.

    Returns
    -------
    LightTable
        Directions, all of the strength 1.

    Raises
    ------
    InputError
        If it is no such matrix, rows cannot be told from columns, or a light has no direction.
    PsstereoError
        If the file is not there or damaged.
    """
    try:
        found = read_directions(path, layout=layout)
    except InputError:
        if layout is not None:
            raise
        read_directions(path, layout="rows")  # refused again, unless 3 × 3 numbers were all that was wrong
        raise InputError(
            given=f"{path.name} holds 3 × 3 numbers.",
            needed="It must be known whether a light is a row or a column; the numbers cannot tell.",
            remedy="psstereo convert makes a rig file of it: --from diligent takes rows, --from psbox columns.",
        ) from None
    try:
        rig = Rig.distant(found.vectors, source=path.name)
    except RigError as error:
        raise RigError(given=f"{path.name}: {error.given}", needed=error.needed, remedy=error.remedy) from None
    return LightTable(rig=rig, source=path.name, notes=found.notes)


def _columns(path: Path) -> str:
    """Return whether a folder's lights are rows or columns, "" if it has none or both fit."""
    file = path / _DIRECTIONS
    if not file.is_file():
        return ""
    rows, columns = read_table(file).values.shape
    return "rows" if columns == 3 != rows else "columns" if rows == 3 != columns else ""


def _strengths(path: Path, count: int) -> FloatArray:
    values = read_table(path).values
    values = values.T if len(values) != count and values.shape[1] == count else values
    if len(values) != count or values.shape[1] not in (1, 3):
        raise InputError(
            given=f"{path.name} holds {values.shape[0]} rows of {values.shape[1]} numbers; there are {count} lights.",
            needed="One strength a light, or three for R, G and B.",
            remedy="Check for missing or extra rows.",
        )
    return values


def _names(path: Path, count: int) -> tuple[str, ...]:
    names = tuple(line.strip() for line in read_lines(path) if line.strip())
    if len(names) != count:
        raise InputError(
            given=f"{path.name} lists {len(names)} images; there are {count} lights.",
            needed="One name a light.",
            remedy="Check for missing or extra lines.",
        )
    return names


def _circle(path: Path) -> FloatArray:
    values = read_table(path).values.ravel()
    if values.shape != (3,) or not np.isfinite(values).all() or values[2] <= 0:
        raise InputError(
            given=f"{path} holds {values.size} numbers: {values[:4].tolist()}.",
            needed="The circle of a ball: x, y and radius in pixels.",
            remedy="Correct the file, or take it away.",
        )
    return values
