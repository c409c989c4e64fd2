"""The rig file: what a calibration has found of lights and camera, in one TOML that the next object uses again."""

import re
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.camera.lens import Lens
from psstereo.errors import InputError, MissingFileError, OptionError, PsstereoError, UnreadableFileError
from psstereo.io.led_rig import led_rig
from psstereo.io.response_section import read_response
from psstereo.io.toml_section import Section
from psstereo.lights import Rig, StrengthUnit
from psstereo.stack import LINEAR, Response
from psstereo.stack.decode import read_bytes
from psstereo.types import FloatArray

__all__ = ["RIG_KEYS", "UNITS", "RigFile", "RigQuality", "is_rig_file", "meant_as_rig_file", "read_rig"]

UNITS = {"relative": StrengthUnit.RELATIVE, "W/m2": StrengthUnit.IRRADIANCE}
"""Units of lights' strengths, by their words."""

RIG_KEYS = {
    "": ("rig", "images", "lights", "camera", "quality", "provenance"),
    "images": ("names", "response", "dark", "flat"),
    "lights": ("directions", "strengths", "unit", "positions", "axes", "mu", "flux"),
    "camera": ("type", "K", "pixel_size", "unit", "lens"),
    "quality": (
        "verdict",
        "advice",
        "residual_deg",
        "residual_percent",
        "direction_error_deg",
        "strength_error_percent",
        "position_covariance",
    ),
    "provenance": ("made",),
}
"""What a rig file may hold, by section."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RigQuality:
    """How far a rig can be trusted.

    Attributes
    ----------
    direction_error : float array (m,) or None
        Root-mean-square angle of each direction's error [rad].
    position_covariance : float array (m, 3, 3) or None
        Covariance of lamps' positions [square of their unit of length].
    strength_error : float array (m,) or None
        Standard error of each strength, as a share of it [1].
    residual_angle : float or None
        How far the observations disagree with the result [rad].
    residual_brightness : float or None
        The same of brightness, as a share of it [1].
    verdict : str
        One sentence on how good it is.
    advice : tuple of str
        What would improve it, a sentence each.
    """

    direction_error: FloatArray | None = None
    position_covariance: FloatArray | None = None
    strength_error: FloatArray | None = None
    residual_angle: float | None = None
    residual_brightness: float | None = None
    verdict: str = ""
    advice: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class RigFile:
    """Lights, and what is known of the camera that saw them.

    Attributes
    ----------
    rig : Rig
        Directional lights, or lamps at positions in the camera's frame.
    names : tuple of str
        Images that the lights belong to, in their order; empty if the order alone tells.
    camera : Camera or None
        The camera, if the calibration knows more of it than the images do.
    response : Response
        Camera response to undo.
    dark : Path or None
        Image without any of the lights.
    flat : Path or None
        Image of an evenly lit, even surface.
    lens : Lens or None
        Distortion of the lens.
    quality : RigQuality
        How far all this can be trusted.
    provenance : tuple of str
        How it was made, a sentence each.

    Raises
    ------
    InputError
        If names or figures are not as many as the lights.
    """

    rig: Rig
    names: tuple[str, ...] = ()
    camera: Camera | None = None
    response: Response = LINEAR
    dark: Path | None = None
    flat: Path | None = None
    lens: Lens | None = None
    quality: RigQuality = field(default_factory=RigQuality)
    provenance: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        quality = self.quality
        counted = {
            "names of images": len(self.names) or None,
            "errors of directions": _length(quality.direction_error),
            "errors of strengths": _length(quality.strength_error),
            "covariances of positions": _length(quality.position_covariance),
        }
        for what, count in counted.items():
            if count is not None and count != len(self.rig):
                raise InputError(
                    given=f"A rig of {len(self.rig)} lights has {count} {what}.",
                    needed="As many as there are lights, or none.",
                    remedy="Give each light its own, in the same order.",
                )


def is_rig_file(path: Path) -> bool:
    """Return whether a file says that it is a rig file; never raises."""
    try:
        return path.is_file() and "rig" in tomllib.loads(path.read_text("utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return False


def meant_as_rig_file(path: Path) -> bool:
    """Return whether a file that may be broken is a rig file rather than a description of a capture; never raises.

    What cannot be parsed is told by its lines: a capture's have images and do not begin with ``rig =``.
    """
    if not path.is_file() or path.suffix.lower() != ".toml" or path.name == "capture.toml":
        return False
    try:
        raw = path.read_bytes()
    except OSError:
        return False
    try:
        values = tomllib.loads(raw.decode("utf-8-sig"))
    except (ValueError, RecursionError):
        return not re.search(rb"(?m)^\s*\[images", raw) or bool(re.search(rb"(?m)^\s*rig\s*=", raw))
    return "rig" in values or "images" not in values


def read_rig(path: Path) -> RigFile:
    """Read a rig file.

    Parameters
    ----------
    path : Path
        The file; names of other files in it are relative to its folder.

    Returns
    -------
    RigFile
        What it holds.

    Raises
    ------
    MissingFileError
        If it is not there.
    UnreadableFileError
        If it is not TOML.
    PsstereoError
        If something in it is unknown, missing, or not as many as the lights.
    """
    top = _parse(path)
    images, quality = top.section("images"), top.section("quality")
    try:
        return RigFile(
            rig=_lights(top.section("lights")),
            names=_texts(images, "names"),
            camera=_camera(top.section("camera")),
            response=read_response(images),
            dark=images.path("dark"),
            flat=images.path("flat"),
            lens=_lens(top.section("camera")),
            quality=_quality(quality),
            provenance=_texts(top.section("provenance"), "made"),
        )
    except PsstereoError as error:
        if path.name in error.given:
            raise
        raise type(error)(given=f"{path.name}: {error.given}", needed=error.needed, remedy=error.remedy) from None


def _bytes(path: Path) -> bytes:
    try:
        return read_bytes(path).tobytes()
    except MissingFileError as error:
        remedy = "Check its name and folder; psstereo calibrate and psstereo convert write rig files."
        raise MissingFileError(given=error.given, needed="The rig file that was named.", remedy=remedy) from None
    except UnreadableFileError as error:
        raise UnreadableFileError(
            given=error.given,
            needed="A rig file, as psstereo calibrate writes it.",
            remedy="Name the right file, copy it again, or calibrate again.",
        ) from None


def _parse(path: Path) -> Section:
    raw = _bytes(path)
    try:
        values = tomllib.loads(raw.decode("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise UnreadableFileError(
            given=f"{path} is not valid TOML: {error}.",
            needed="A rig file in UTF-8 with decimal points, as psstereo calibrate writes it.",
            remedy="Correct that place, save it as UTF-8 if an editor changed that, or calibrate again.",
        ) from None
    top = Section(values, "", path)
    if values.get("rig") != 1:
        raise UnreadableFileError(
            given=f"{path} does not begin with rig = 1.",
            needed="A rig file of version 1, as psstereo calibrate writes it.",
            remedy="Files of light directions go with --lights, descriptions of captures are named themselves; "
            "psstereo convert makes a rig file of either.",
        )
    top.allow(RIG_KEYS[""])
    for name, keys in RIG_KEYS.items():
        if name:
            top.section(name).allow(keys)
    return top


def _lights(lights: Section) -> Rig:
    unit = UNITS[lights.choice("unit", tuple(UNITS)) or "relative"]
    lamps = "positions" in lights.values
    needed = ("positions", "axes", "mu", "flux") if lamps else ("directions", "strengths")
    missing = [key for key in needed if key not in lights.values]
    surplus = [key for key in lights.values if key not in (*needed, "unit")]
    if missing or surplus:
        raise OptionError(
            given=f"[lights] in {lights.file.name} has {', '.join(lights.values) or 'nothing'}.",
            needed="Distant lights have directions and strengths; lamps have positions, axes, mu and flux.",
            remedy=f"Add {', '.join(missing)}." if missing else f"Take {', '.join(surplus)} out.",
        )
    columns = {"positions": 3, "axes": 3, "mu": 1, "directions": 3}
    found = {key: _numbers(lights, key, columns.get(key)) for key in needed}
    counts = {key: len(rows) for key, rows in found.items()}
    if len(set(counts.values())) > 1:
        raise InputError(
            given=f"[lights] in {lights.file.name} has " + ", ".join(f"{n} {key}" for key, n in counts.items()) + ".",
            needed="One of each for every light.",
            remedy="Check for missing or extra rows.",
        )
    if lamps:
        return led_rig(
            positions=found["positions"],
            axes=found["axes"],
            mu=found["mu"][:, 0],
            flux=found["flux"],
            frame="opengl",
            source=lights.file.name,
            strength_unit=unit,
        )
    return Rig.distant(found["directions"], found["strengths"], strength_unit=unit, source=lights.file.name)


def _camera(section: Section) -> Camera | None:
    kind = section.choice("type", ("orthographic", "pinhole"))
    if kind is None:
        return None
    if kind == "pinhole":
        return Pinhole.from_matrix(_numbers(section, "K", 3))
    size = section.number("pixel_size")
    return Orthographic(
        pixel_size=1.0 if size is None else size, length_unit=section.text("unit") or ("px" if size is None else "mm")
    )


def _lens(section: Section) -> Lens | None:
    if "lens" not in section.values:
        return None
    return Lens(coefficients=tuple(float(value) for value in _numbers(section, "lens", 1)[:, 0]))


def _quality(section: Section) -> RigQuality:
    angle, share = section.number("residual_deg"), section.number("residual_percent")
    covariance = _figures(section, "position_covariance", 9)
    directions, strengths = _figures(section, "direction_error_deg", 1), _figures(section, "strength_error_percent", 1)
    return RigQuality(
        direction_error=None if directions is None else np.deg2rad(directions[:, 0]),
        position_covariance=None if covariance is None else covariance.reshape(-1, 3, 3),
        strength_error=None if strengths is None else strengths[:, 0] / 100,
        residual_angle=None if angle is None else float(np.deg2rad(angle)),
        residual_brightness=None if share is None else share / 100,
        verdict=section.text("verdict") or "",
        advice=_texts(section, "advice"),
    )


def _numbers(section: Section, key: str, columns: int | None) -> FloatArray:
    values = _rows(section, key, columns)
    if values is None or not np.isfinite(values).all():
        raise section.wrong(key, "finite numbers, written here")
    return values


def _rows(section: Section, key: str, columns: int | None) -> FloatArray | None:
    """Return rows of numbers, which stand in the rig file itself and not in one that it names."""
    if isinstance(section.values.get(key), str):
        return None
    try:
        return section.matrix(key, columns)
    except InputError:
        rows = "a list of numbers" if columns == 1 else f"a list of rows of {columns or 'equally many'} numbers each"
        raise section.wrong(key, rows) from None


def _figures(section: Section, key: str, columns: int) -> FloatArray | None:
    """Return rows of figures, of which nan says that one is not known; None if there are none."""
    values = _rows(section, key, columns)
    if key in section.values and (values is None or np.isinf(values).any()):
        raise section.wrong(key, "numbers, written here, or nan where one is not known")
    return values


def _texts(section: Section, key: str) -> tuple[str, ...]:
    values = section.values.get(key, [])
    if not isinstance(values, list) or not all(isinstance(value, str) and value for value in values):
        raise section.wrong(key, "a list of texts in quotation marks")
    return tuple(values)


def _length(values: FloatArray | None) -> int | None:
    return None if values is None else len(values)
