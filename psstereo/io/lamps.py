"""Lamps at known positions as files of several makers describe them, in one form."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.errors import InputError, MissingFileError, UnreadableFileError
from psstereo.io.mat_file import read_mat
from psstereo.io.parts import find_camera, images_in
from psstereo.io.text import parse_numbers, read_lines, read_table
from psstereo.types import FloatArray

__all__ = ["LAYOUTS", "LampLayout", "Lamps", "read_led_params"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Lamps:
    """Lamps, images and camera of a near-light capture.

    Attributes
    ----------
    files : tuple of Path
        One image a lamp.
    positions, axes : float64 array (m, 3)
        In the frame `frame` [length]; [1].
    mu : float64 array (m,)
        Exponent of the lobe [1].
    flux : float64 array (m, c)
        Radiant intensity along the axis.
    frame : str
        Convention of positions and axes.
    camera : Camera
        The camera.
    source : str
        File that the lamps came from.
    mask : str
        Name of the mask beside the images.
    dark : Path or None
        Image without any of the lamps.
    notes : tuple of str
        What was found, as sentences.
    """

    files: tuple[Path, ...]
    positions: FloatArray
    axes: FloatArray
    mu: FloatArray
    flux: FloatArray
    frame: str = "opencv"
    camera: Camera
    source: str
    mask: str = "mask.png"
    dark: Path | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class LampLayout:
    """One way in which files describe lamps: by which file it is known, in words, and how it is read."""

    key: str
    reason: str
    read: Callable[[Path], Lamps]


def _led_files(path: Path) -> Lamps:
    """Read ``led_*.png`` with ``led_positions_mm.txt``, ``led_axes.txt``, ``led_intensity_rgb.txt``, ``led_mu.txt``."""
    files = tuple(p for p in images_in(path) if re.fullmatch(r"led_\d+", p.stem, re.IGNORECASE))
    count = _require(files, path, "led_1.png …")
    camera, notes = find_camera(path)
    if isinstance(camera, Orthographic):
        notes = ("There is no K.txt: how pixels and the lamps' millimetres belong together is unknown.",)
    mu, flux = path / "led_mu.txt", path / "led_intensity_rgb.txt"
    dark = path / "ambient.png"
    if not dark.is_file():
        notes = (*notes, "There is no ambient.png to subtract.")
    return Lamps(
        files=files,
        positions=_rows(path / "led_positions_mm.txt", count, 3),
        axes=_rows(path / "led_axes.txt", count, 3),
        mu=_rows(mu, count, 1)[:, 0] if mu.is_file() else np.ones(count),
        flux=_rows(flux, count, None) if flux.is_file() else np.ones((count, 1)),
        camera=camera,
        source="led_positions_mm.txt",
        dark=dark if dark.is_file() else None,
        notes=notes,
    )


def _luces(path: Path) -> Lamps:
    """Read the LUCES layout: ``01.png …`` and ``led_params.txt``."""
    files = tuple(p for p in images_in(path) if p.stem.isdigit())
    count = _require(files, path, "01.png, 02.png …")
    camera, values = read_led_params(path / "led_params.txt")
    if len(values) != count:
        raise InputError(
            given=f"led_params.txt lists {len(values)} lamps; there are {count} images in {path}.",
            needed="Each image needs its lamp.",
            remedy="Check for missing images.",
        )
    return Lamps(
        files=files,
        positions=values[:, :3],
        axes=values[:, 3:6],
        mu=values[:, -1],
        flux=values[:, 6:-1],
        camera=camera,
        source="led_params.txt",
        notes=(f"The camera is a pinhole of focal length {camera.fx:.6g} px (led_params.txt).",),
    )


def read_led_params(path: Path) -> tuple[Pinhole, FloatArray]:
    """Read ``led_params.txt`` of LUCES.

    Its second line holds the number of lamps, the image's size (in either order, so that it is not used), focal length
    and principal point [px], and the mean distance. Each further line is a lamp: position [mm], axis, flux (three
    numbers, one in older files), mu, and a zero that older files lack.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    camera : Pinhole
        The camera.
    values : float64 array (m, 8) or (m, 10)
        Position, axis, flux (1 or 3 numbers), mu.

    Raises
    ------
    MissingFileError
        If the file is not there.
    UnreadableFileError
        If a line is of another form, or the number of lamps disagrees with the lines.
    """
    lines = [(number, line) for number, line in enumerate(read_lines(path), start=1) if line.strip()]
    numbers = [(number, parse_numbers(line)) for number, line in lines]
    head = numbers[1][1] if len(numbers) > 1 else None
    if head is None or len(head[0]) != 7:
        raise _bad_line(
            path, lines[min(1, len(lines) - 1)] if lines else (1, ""), "seven numbers N rows columns f x0 y0 distance"
        )
    rows: list[list[float]] = []
    for (number, parsed), line in zip(numbers[2:], lines[2:], strict=True):
        if parsed is None or len(parsed[0]) not in (8, 9, 10, 11) or (rows and len(parsed[0]) != len(rows[0])):
            raise _bad_line(path, (number, line[1]), "a lamp's position, axis, flux, mu and 0")
        rows.append(parsed[0])
    if len(rows) != int(head[0][0]) or not rows:
        raise UnreadableFileError(
            given=f"{path} says {head[0][0]:g} lamps on its second line and has {len(rows)} lines of lamps.",
            needed="The two numbers must agree; otherwise part of the file may be missing.",
            remedy="Copy the file again.",
        )
    values = np.array(rows, np.float64)
    flux = 3 if values.shape[1] >= 10 else 1
    focal, x0, y0 = head[0][3:6]
    camera = Pinhole(fx=focal, fy=focal, cx=x0, cy=y0)
    return camera, values[:, : 6 + flux + 1]


def _near_ps(path: Path) -> Lamps:
    """Read the layout of near_ps: ``photometric_sample_raw_0001.png …``, ``light.mat`` and ``camera.mat``."""
    stem = "photometric_sample_raw_"
    files = tuple(p for p in images_in(path) if re.fullmatch(stem + r"\d+", p.stem))
    count = _require(files, path, f"{stem}0001.png …")
    light = _mat(path / "light.mat", ("S", "Dir", "mu", "Phi"))
    dark = path / f"{stem}ambient.png"
    parts = {name: np.asarray(light[name], np.float64) for name in light}
    parts["mu"] = parts["mu"].reshape(-1, 1)
    for name, array in parts.items():
        if array.ndim != 2 or len(array) != count or (name in ("S", "Dir") and array.shape[1] != 3):
            raise InputError(
                given=f"{name} in light.mat has the shape {array.shape}; there are {count} images in {path}.",
                needed="S and Dir are (m, 3), mu (m, 1) and Phi (m, c), one row an image.",
                remedy="Check for missing images, or name the right folder.",
            )
    camera = Pinhole.from_matrix(np.asarray(_mat(path / "camera.mat", ("K",))["K"], np.float64))
    return Lamps(
        files=files,
        positions=parts["S"],
        axes=parts["Dir"],
        mu=parts["mu"][:, 0],
        flux=parts["Phi"],
        camera=camera,
        source="light.mat",
        mask="photometric_sample_mask_raw.png",
        dark=dark if dark.is_file() else None,
        notes=() if dark.is_file() else (f"There is no {dark.name} to subtract.",),
    )


def _positions_beside_diligent(path: Path) -> Lamps:
    """Read ``light_positions.txt`` beside a DiLiGenT layout: isotropic lamps, positions in the object's frame."""
    from psstereo.io.diligent import light_intensities, listed_images

    stack, notes = listed_images(path)
    positions = _rows(path / "light_positions.txt", len(stack), 3)
    strengths, found = light_intensities(path / "light_intensities.txt", stack)
    squared = (positions * positions).sum(axis=1, keepdims=True)
    camera, camera_notes = find_camera(path)
    where = (
        "light_positions.txt was read as x right, y up, z toward the camera from the object's centre, and "
        "light_intensities.txt as the irradiance there; a capture.toml can say where the camera is (camera.position)."
    )
    return Lamps(
        files=stack.paths,
        positions=positions,
        axes=-positions,
        mu=np.zeros(len(stack)),
        flux=squared * (np.ones((len(stack), 1)) if strengths is None else strengths),
        frame="opengl",
        camera=camera,
        source="light_positions.txt",
        notes=(*notes, *found, *camera_notes, where),
    )


def _require(files: tuple[Path, ...], path: Path, names: str) -> int:
    if not files:
        raise MissingFileError(
            given=f"There are no images {names} in {path}.",
            needed="The photographs lie beside the files on the lamps.",
            remedy="Name the folder that holds both.",
        )
    return len(files)


def _rows(path: Path, count: int, columns: int | None) -> FloatArray:
    values = read_table(path).values
    values = values.T if columns == 1 and values.shape == (1, count) else values
    if len(values) != count or (columns is not None and values.shape[1] != columns):
        raise InputError(
            given=f"{path} holds {values.shape[0]} rows of {values.shape[1]} numbers; there are {count} images.",
            needed=f"Each image needs one row of {columns or 'one or three'} numbers.",
            remedy="Check for missing or extra rows, or missing images.",
        )
    return values


def _mat(path: Path, names: tuple[str, ...]) -> dict[str, Any]:
    content = read_mat(path)
    if not set(names) <= set(content):
        raise UnreadableFileError(
            given=f"{path} holds {', '.join(content) or 'nothing'}.",
            needed=f"It needs the variables {', '.join(names)}.",
            remedy="Name the folder that holds the right file.",
        )
    return {name: content[name] for name in names}


def _bad_line(path: Path, line: tuple[int, str], needed: str) -> UnreadableFileError:
    return UnreadableFileError(
        given=f"Line {line[0]} of {path} reads {line[1].strip()[:80]!r}.",
        needed=f"{needed[0].upper()}{needed[1:]} are expected on it.",
        remedy="Correct that line, or copy the file again.",
    )


LAYOUTS = (
    LampLayout("led_positions_mm.txt", "led_positions_mm.txt is there", _led_files),
    LampLayout("led_params.txt", "led_params.txt is there (LUCES)", _luces),
    LampLayout("light.mat", "light.mat and camera.mat are there (near_ps)", _near_ps),
    LampLayout("light_positions.txt", "light_positions.txt is there", _positions_beside_diligent),
)
"""Known ways in which files describe lamps, the most specific first."""
