"""Formats of lamps at positions: LUCES's ``led_params.txt`` and the files of near_ps."""

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

import numpy as np

from psstereo.camera import Pinhole
from psstereo.capture import Truth
from psstereo.errors import InputError, UnreadableFileError, UnsupportedError
from psstereo.io.lamps import read_led_params
from psstereo.io.layout_writer import Save
from psstereo.io.led_rig import led_rig
from psstereo.io.light_bridge_table import LightFormat, LightTable, as_capture
from psstereo.io.luces_writer import LucesWriter
from psstereo.io.mat_file import read_mat
from psstereo.io.near_ps_writer import NearPsWriter
from psstereo.io.text import parse_numbers, read_lines
from psstereo.types import FloatArray

__all__ = ["LucesLights", "NearPsLights"]

_LED_PARAMS = "led_params.txt"


class LucesLights(LightFormat):
    """LUCES's ``led_params.txt``: lamps and a pinhole of one focal length, y down and z into the scene."""

    name: ClassVar[str] = "luces"
    summary: ClassVar[str] = "led_params.txt: lamps, pinhole camera, image size, mean distance (LUCES)"
    file_name: ClassVar[str] = ".txt"
    holds: ClassVar[frozenset[str]] = frozenset({"strengths", "pinhole", "size", "distance"})

    def recognise(self, path: Path) -> bool:
        """See :meth:`LightFormat.recognise`."""
        file = _led_params(path)
        return file.is_file() and file.suffix.lower() == ".txt" and read_lines(file)[0].startswith("N_img")

    def read(self, path: Path) -> LightTable:
        """See :meth:`LightFormat.read`; programs disagree on the order of rows and columns, so the camera decides."""
        file = _led_params(path)
        camera, values = read_led_params(file)
        rig = led_rig(
            positions=values[:, :3],
            axes=values[:, 3:6],
            mu=values[:, -1],
            flux=values[:, 6:-1],
            frame="opencv",
            source=file.name,
        )
        first, second, distance = _header(file)
        as_named = abs(camera.cx - second / 2) + abs(camera.cy - first / 2)
        turned = abs(camera.cx - first / 2) + abs(camera.cy - second / 2)
        size = (first, second) if as_named <= turned else (second, first)
        note = f"{file.name} has columns before rows: its principal point fits images of {size[1]} × {size[0]}."
        return LightTable(
            rig=rig,
            camera=camera,
            size=size if min(size) > 0 else None,
            distance=distance if distance > 0 else None,
            source=file.name,
            notes=() if as_named <= turned else (note,),
        )

    def files(self, table: LightTable) -> Mapping[str, Save]:
        """See :meth:`LightFormat.files`."""
        capture = as_capture(table, self.name, lamps=True)
        missing = {"the images' size (--size)": table.size, "the object's mean distance (--distance)": table.distance}
        unknown = [words for words, value in missing.items() if value is None]
        if unknown:
            raise UnsupportedError(
                given=f"It is not known: {', '.join(unknown)}.",
                needed=f"The second line of {_LED_PARAMS} states them.",
                remedy="Give what is missing.",
            )
        depth = np.full(capture.shape, table.distance, np.float64)
        return {"": LucesWriter().parts(capture, Truth(depth=depth))[_LED_PARAMS]}


class NearPsLights(LightFormat):
    """``light.mat`` and ``camera.mat`` of near_ps: y down and z into the scene."""

    name: ClassVar[str] = "near-ps"
    summary: ClassVar[str] = "a folder: light.mat (S, Dir, mu, Phi) and camera.mat (K) (near_ps)"
    holds: ClassVar[frozenset[str]] = frozenset({"strengths", "pinhole"})

    def recognise(self, path: Path) -> bool:
        """See :meth:`LightFormat.recognise`."""
        return (path / "light.mat").is_file() and (path / "camera.mat").is_file()

    def read(self, path: Path) -> LightTable:
        """See :meth:`LightFormat.read`."""
        light, camera = read_mat(path / "light.mat"), read_mat(path / "camera.mat")
        missing = [name for name in ("S", "Dir", "mu", "Phi") if name not in light] + ["K"] * ("K" not in camera)
        if missing:
            raise UnreadableFileError(
                given=f"light.mat and camera.mat in {path} have no {', '.join(missing)}.",
                needed="S, Dir, mu and Phi in the one, K in the other.",
                remedy="Name the folder that holds the right files.",
            )
        parts = {name: np.atleast_2d(np.asarray(light[name], np.float64)) for name in ("S", "Dir", "mu", "Phi")}
        parts["mu"] = parts["mu"].reshape(-1, 1)
        count = len(parts["S"])
        for name, array in parts.items():
            if len(array) != count or (name in ("S", "Dir") and array.shape[1] != 3):
                raise InputError(
                    given=f"{name} in light.mat has the shape {array.shape}; S has {count} rows.",
                    needed="S and Dir are (m, 3), mu (m, 1) and Phi (m, c), one row a lamp.",
                    remedy="Name the folder that holds the right files.",
                )
        rig = led_rig(
            positions=parts["S"],
            axes=parts["Dir"],
            mu=parts["mu"][:, 0],
            flux=parts["Phi"],
            frame="opencv",
            source="light.mat",
        )
        matrix: FloatArray = np.asarray(camera["K"], np.float64)
        return LightTable(rig=rig, camera=Pinhole.from_matrix(matrix), source=path.name)

    def files(self, table: LightTable) -> Mapping[str, Save]:
        """See :meth:`LightFormat.files`."""
        parts = NearPsWriter().parts(as_capture(table, self.name, lamps=True), None)
        return {name: parts[name] for name in ("light.mat", "camera.mat")}


def _led_params(path: Path) -> Path:
    return path / _LED_PARAMS if path.is_dir() else path


def _header(file: Path) -> tuple[int, int, float]:
    """Return the two numbers of pixels and the mean distance of a file that :func:`read_led_params` has read."""
    filled = [line for line in read_lines(file) if line.strip()]
    parsed = parse_numbers(filled[1])
    values = parsed[0] if parsed else [0.0] * 7
    whole = [int(value) if np.isfinite(value) and 0 < value < 1e6 else 0 for value in values[1:3]]
    return whole[0], whole[1], values[6] if np.isfinite(values[6]) else 0.0
