"""Formats that hold distant lights as well as lamps: relight's ``.dome`` and our own rig file."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from psstereo.camera import Orthographic, Pinhole
from psstereo.errors import UnsupportedError
from psstereo.io.dome_file import Dome, dome_text, read_dome
from psstereo.io.layout_writer import Save
from psstereo.io.light_bridge_table import LightFormat, LightTable
from psstereo.io.rig_file import RigFile, is_rig_file, read_rig
from psstereo.io.rig_writer import rig_text
from psstereo.lights import Led, Rig
from psstereo.types import FloatArray

__all__ = ["DomeLights", "RigLights"]


class DomeLights(LightFormat):
    """relight's ``.dome``: directions, or bare lamps about the middle of the object."""

    name: ClassVar[str] = "dome"
    summary: ClassVar[str] = "NAME.dome: directions, or positions about the object's middle (relight)"
    file_name: ClassVar[str] = ".dome"
    holds: ClassVar[frozenset[str]] = frozenset({"width"})

    def recognise(self, path: Path) -> bool:
        """See :meth:`LightFormat.recognise`."""
        return path.is_file() and path.suffix.lower() == ".dome"

    def read(self, path: Path) -> LightTable:
        """See :meth:`LightFormat.read`; lamps are taken to shine all around, equally strong at the object."""
        dome = read_dome(path)
        words = {
            f"{path.name} is labelled {dome.label!r}.": bool(dome.label),
            f"{path.name} says: {dome.notes}": bool(dome.notes),
            "ledAdjust was left out: whether it is of the lamps or makes up for them is not known.": dome.adjusted,
        }
        notes = tuple(sentence for sentence, there in words.items() if there)
        if dome.positions is None:
            rig = Rig.distant(dome.directions, source=path.name)
        else:
            squares = (dome.positions**2).sum(axis=1)
            lamps = (
                Led(position=p, axis=-p, mu=0.0, flux=np.array([s]))
                for p, s in zip(dome.positions, squares, strict=True)
            )
            rig = Rig(tuple(lamps), source=path.name)
        return LightTable(rig=rig, width=dome.image_width or None, source=path.name, notes=notes)

    def files(self, table: LightTable) -> Mapping[str, Save]:
        """See :meth:`LightFormat.files`."""
        lamps = [light for light in table.rig.lights if isinstance(light, Led)]
        if not lamps:
            text = dome_text(
                Dome(configuration="directional", directions=table.rig.directions, image_width=table.width or 0.0)
            )
        else:
            text = dome_text(_near_dome(table, lamps))
        return {"": lambda path: _put(path, text)}

    def left_out(self, table: LightTable) -> tuple[str, ...]:
        """See :meth:`LightFormat.left_out`; fluxes that make lamps equally strong at the object are no loss."""
        lamps = [light for light in table.rig.lights if isinstance(light, Led)]
        if lamps:
            squares = np.array([lamp.position @ lamp.position for lamp in lamps])
            there = np.array([lamp.flux.mean() for lamp in lamps]) / squares
            if np.ptp(there) <= 1e-9 * there.max():
                even = Rig(tuple(replace(lamp, flux=np.ones(1)) for lamp in lamps), table.rig.strength_unit)
                table = replace(table, rig=even)
        return super().left_out(table)


class RigLights(LightFormat):
    """Our own rig file in TOML, the only one that holds all that a calibration finds."""

    name: ClassVar[str] = "rig"
    summary: ClassVar[str] = "NAME.toml: lights, camera and what is known of both (psstereo reconstruct --rig)"
    file_name: ClassVar[str] = ".toml"
    holds: ClassVar[frozenset[str]] = frozenset(
        {"strengths", "unit", "names", "pinhole", "pixel size", "response", "frames", "lens", "quality"}
    )

    def recognise(self, path: Path) -> bool:
        """See :meth:`LightFormat.recognise`."""
        return path.suffix.lower() == ".toml" and is_rig_file(path)

    def read(self, path: Path) -> LightTable:
        """See :meth:`LightFormat.read`."""
        found = read_rig(path)
        return LightTable(rig=found.rig, names=found.names, camera=found.camera, file=found, source=path.name)

    def files(self, table: LightTable) -> Mapping[str, Save]:
        """See :meth:`LightFormat.files`."""
        camera = None if table.camera == Orthographic() else table.camera
        if table.file is None:
            made = RigFile(
                rig=table.rig, names=table.names, camera=camera, provenance=(f"Converted from {table.source}.",)
            )
        else:
            made = replace(table.file, rig=table.rig, names=table.names, camera=camera)
        rig_text(made, Path().absolute())  # refused before anything is written
        return {"": lambda path: _put(path, rig_text(made, path.absolute().parent))}


def _near_dome(table: LightTable, lamps: list[Led]) -> Dome:
    if len(lamps) < len(table.rig):
        distant = next(i for i, light in enumerate(table.rig.lights) if not isinstance(light, Led))
        raise UnsupportedError(
            given=f"Light {distant + 1} is distant, others are lamps.",
            needed="A dome holds lights of one kind.",
            remedy="Convert them separately.",
        )
    if isinstance(table.camera, Pinhole):
        raise UnsupportedError(
            given="The lamps stand in the frame of a pinhole camera.",
            needed="A .dome has its origin at the middle of the object, which no such file tells.",
            remedy="Choose rig, luces or near-ps; or move the lamps by the object's place first.",
        )
    lobed = [i for i, lamp in enumerate(lamps) if lamp.mu != 0]
    if lobed:
        raise UnsupportedError(
            given=f"Light {lobed[0] + 1} has a lobe, mu = {lamps[lobed[0]].mu:g}.",
            needed="Lamps of a .dome shine all around.",
            remedy="Choose rig, luces or near-ps.",
        )
    if table.width is None:
        raise UnsupportedError(
            given="It is not known how wide the picture is on the object (--image-width).",
            needed="relight measures the lamps of a .dome by it.",
            remedy="Give it in millimetres.",
        )
    positions: FloatArray = np.array([lamp.position for lamp in lamps])
    radii = np.sqrt((positions**2).sum(axis=1))
    return Dome(
        configuration="lights3d",
        directions=positions,
        positions=positions,
        image_width=table.width,
        diameter=2.0 * float(np.median(radii)),
    )


def _put(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")
