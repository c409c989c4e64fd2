"""Rig files written: one TOML that a person can read, and nothing half-written."""

import os
from pathlib import Path

import numpy as np

from psstereo.camera import Orthographic, Pinhole
from psstereo.errors import UnsupportedError
from psstereo.io.one_file import put_file, require_file_place
from psstereo.io.response_section import response_line
from psstereo.io.rig_file import RigFile, RigQuality, is_rig_file
from psstereo.io.toml_text import toml_number, toml_rows, toml_text
from psstereo.lights import Directional, Led, StrengthUnit
from psstereo.types import FloatArray

__all__ = ["require_rig_place", "rig_text", "write_rig"]

_KIND = "rig file"
_HEAD = """\
# Lights and camera as a calibration found them: x right, y up, z toward the camera, light vectors toward the light.
# The next object needs no ball: psstereo reconstruct FOLDER --rig THIS_FILE -o RESULT
"""


def write_rig(path: Path, rig: RigFile, *, overwrite: bool = False) -> None:
    """Write a rig file.

    Parameters
    ----------
    path : Path
        The file.
    rig : RigFile
        What it is to hold.
    overwrite : bool
        Whether an earlier rig file may be replaced; anything else is refused even then.

    Raises
    ------
    ExistingResultError
        If something is in the way.
    MissingFileError, UnreadableFileError
        If its folder does not exist, or cannot be written to.
    UnsupportedError
        If a light is neither directional nor a lamp, or lights of both kinds are mixed.
    """
    text = rig_text(rig, path.absolute().parent).encode("utf-8")
    put_file(path, text, overwrite=overwrite, ours=is_rig_file, kind=_KIND)


def require_rig_place(path: Path, *, overwrite: bool) -> None:
    """Refuse a name that cannot be taken for a rig file, before the work.

    Parameters
    ----------
    path : Path
        The file that is to be written.
    overwrite : bool
        Whether an earlier rig file may be replaced.

    Raises
    ------
    ExistingResultError
        If something is there that nobody asked to replace.
    MissingFileError
        If its folder does not exist.
    """
    require_file_place(path, overwrite=overwrite, ours=is_rig_file, kind=_KIND)


def rig_text(rig: RigFile, folder: Path) -> str:
    """Return the text of a rig file.

    Parameters
    ----------
    rig : RigFile
        What it is to hold.
    folder : Path
        Where it will lie; names of other files are told from there.

    Returns
    -------
    str
        TOML.

    Raises
    ------
    UnsupportedError
        If it holds what such a file cannot.
    """
    lines = [_HEAD, "rig = 1", *_quality(rig.quality), *_made(rig.provenance)]
    lines += ["", "[lights]", *_lights(rig), *_images(rig, folder), *_camera(rig)]
    return "\n".join(lines) + "\n"


def _lights(rig: RigFile) -> list[str]:
    lights = rig.rig.lights
    unit = ['unit = "W/m2"'] if rig.rig.strength_unit is StrengthUnit.IRRADIANCE else []
    distant = [light for light in lights if isinstance(light, Directional)]
    lamps = [light for light in lights if isinstance(light, Led)]
    if len(distant) == len(lights):
        width = max(light.strength.size for light in distant)
        strengths = np.array([np.broadcast_to(light.strength, width) for light in distant])
        return [*toml_rows("directions", rig.rig.directions), *toml_rows("strengths", strengths), *unit]
    if len(lamps) != len(lights):
        names = ", ".join(sorted({light.name for light in lights}))
        raise UnsupportedError(
            given=f"The rig has lights of the kinds {names}.",
            needed="A rig file holds directional lights, or lamps at positions, not both.",
            remedy="Write what the lights look like from afar, or two files.",
        )
    width = max(lamp.flux.size for lamp in lamps)
    return [
        *toml_rows("positions", np.array([lamp.position for lamp in lamps])),
        *toml_rows("axes", np.array([lamp.axis for lamp in lamps])),
        *toml_rows("mu", np.array([[lamp.mu] for lamp in lamps])),
        *toml_rows("flux", np.array([np.broadcast_to(lamp.flux, width) for lamp in lamps])),
        *unit,
    ]


def _images(rig: RigFile, folder: Path) -> list[str]:
    lines = [*response_line(rig.response)]
    for key, path in (("dark", rig.dark), ("flat", rig.flat)):
        if path is not None:
            lines.append(f"{key} = {toml_text(_relative(path, folder), f'name of the {key} image')}")
    if rig.names:
        lines += ["names = [", *(f"    {toml_text(name, 'name of an image')}," for name in rig.names), "]"]
    return ["", "[images]", *lines] if lines else []


def _relative(path: Path, folder: Path) -> str:
    try:
        return Path(os.path.relpath(path.absolute(), folder)).as_posix()
    except ValueError:  # on another drive
        return path.absolute().as_posix()


def _camera(rig: RigFile) -> list[str]:
    camera, lens = rig.camera, rig.lens
    lines = []
    if isinstance(camera, Pinhole):
        lines = ['type = "pinhole"', *toml_rows("K", camera.matrix)]
    elif isinstance(camera, Orthographic):
        lines = ['type = "orthographic"']
        if camera.length_unit != "px" or camera.pixel_size != 1:
            unit = toml_text(camera.length_unit, "unit of length")
            lines += [f"pixel_size = {toml_number(camera.pixel_size)}", f"unit = {unit}"]
    elif camera is not None:
        raise UnsupportedError(
            given=f"The camera is {camera.name}.",
            needed="A rig file describes an orthographic or a pinhole camera.",
            remedy="Use one of the two.",
        )
    if lens is not None:
        lines.append(f"lens = [{', '.join(toml_number(value) for value in lens.coefficients)}]")
    return ["", "[camera]", *lines] if lines else []


def _quality(quality: RigQuality) -> list[str]:
    lines = [f"verdict = {toml_text(quality.verdict, 'verdict')}"] if quality.verdict else []
    if quality.advice:
        lines += ["advice = [", *(f"    {toml_text(line, 'advice')}," for line in quality.advice), "]"]
    figures = (("residual_deg", _degrees(quality.residual_angle)), ("residual_percent", _share(quality)))
    lines += [f"{key} = {value:.6g}" for key, value in figures if value is not None and value > 0]
    if quality.direction_error is not None:
        lines += _figures("direction_error_deg", np.rad2deg(quality.direction_error)[:, None])
    if quality.strength_error is not None:
        lines += _figures("strength_error_percent", 100 * quality.strength_error[:, None])
    if quality.position_covariance is not None:
        lines += _figures("position_covariance", quality.position_covariance.reshape(-1, 9))
    return ["", "[quality]", *lines] if lines else []


def _figures(key: str, values: FloatArray) -> list[str]:
    """Return rows of figures to six digits, which are more than any of them has."""
    return toml_rows(key, np.array([[float(f"{value:.6g}") for value in row] for row in values]))


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else float(np.rad2deg(angle))


def _share(quality: RigQuality) -> float | None:
    return None if quality.residual_brightness is None else 100 * quality.residual_brightness


def _made(lines: tuple[str, ...]) -> list[str]:
    if not lines:
        return []
    return ["", "[provenance]", "made = [", *(f"    {toml_text(line, 'provenance')}," for line in lines), "]"]
