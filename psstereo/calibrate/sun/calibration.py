"""Suns of some photographs as a rig: from times, place and the standing of the camera."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from psstereo.calibrate.sun.cone import SunCone, judge_cone, require_above_horizon, require_open_cone
from psstereo.calibrate.sun.position import Place, SunPositions, clear_sky_strength, sun_positions
from psstereo.errors import InputError, OptionError
from psstereo.io.rig_file import RigQuality
from psstereo.lights import Rig
from psstereo.radiometry.checks import in_range
from psstereo.types import FloatArray

__all__ = ["SunCalibration", "calibrate_sun"]

_EPHEMERIS = np.radians(0.01)
"""Error of the ephemeris and of the refraction, above 5 degrees of elevation [rad]."""
_LOW = np.radians(10.0)
"""Elevation below which weather bends and reddens the light beyond what is computed."""
_TURN = 2.0 * np.pi / 86400.0
"""Turn of the sun about the pole [rad s⁻¹]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SunCalibration:
    """A rig of suns.

    Attributes
    ----------
    rig : Rig
        One directional light a photograph, in the camera's frame; strengths are relative.
    quality : RigQuality
        How far to trust it.
    positions : SunPositions
        The suns over the place.
    cone : SunCone
        How their directions lie.
    """

    rig: Rig
    quality: RigQuality
    positions: SunPositions
    cone: SunCone


def calibrate_sun(
    times: Sequence[datetime],
    place: Place,
    rotation: FloatArray,
    *,
    names: Sequence[str] = (),
    strength: str = "clear-sky",
    clock_error: float = 1.0,
    standing_error: float | None = None,
    worst_condition: float = 50.0,
) -> SunCalibration:
    """Return the suns of photographs as lights in the camera's frame.

    Not for a camera that moved between photographs, nor for pictures under clouds or in the shade. Skylight is no part
    of the rig: :mod:`psstereo.calibrate.sun.sky` finds it from the images.

    Parameters
    ----------
    times : sequence of datetime (m,)
        When they were taken, with time zones.
    place : Place
        Where.
    rotation : float array (3, 3)
        The camera's axes as columns, x east, y north, z up; see :mod:`psstereo.calibrate.sun.rotation` [1].
    names : sequence of str
        What the photographs are called, for messages; numbers if empty.
    strength : {"clear-sky", "equal"}
        Whether a low sun is weaker, as clear air makes it, or all are equal, as where each picture was exposed anew.
    clock_error : float
        Error of the clock; EXIF times are whole seconds [s].
    standing_error : float, optional
        Error of the camera's rotation; errors of directions are not told without it [rad].
    worst_condition : float
        Condition number of the directions above which to refuse, infinity for any [1].

    Returns
    -------
    SunCalibration
        Rig, quality, positions.

    Raises
    ------
    InputError
        If a time has no zone, a sun is below the horizon, or the rotation is none.
    OptionError
        If an option is unknown or out of range.
    RigError
        If the sun's path is too flat a cone to give normals, such as a day at an equinox.
    UnsupportedError
        If PyEphem is not installed.
    """
    turn = _rotation(rotation)
    if strength not in ("clear-sky", "equal"):
        raise OptionError(
            given=f"The strength of the sun is {strength!r}.",
            needed="clear-sky or equal.",
            remedy="Choose one of them.",
        )
    clock = float(in_range("clock's error", clock_error, unit="s"))
    positions = sun_positions(times, place)
    words = [time.isoformat(sep=" ") for time in times]
    require_above_horizon(positions, names or [f"photograph {k + 1}" for k in range(len(words))], words)
    cone = judge_cone(positions, place)
    require_open_cone(cone, worst_condition)
    strengths = clear_sky_strength(positions) if strength == "clear-sky" else np.ones(len(words))
    spread = None
    if standing_error is not None:
        standing = float(in_range("error of the camera's standing", standing_error, unit="rad"))
        arc = clock * _TURN * np.cos(positions.declination)
        spread = np.sqrt(standing**2 + arc**2 + _EPHEMERIS**2)
    source = f"sun over {np.degrees(place.latitude):.4f}° N, {np.degrees(place.longitude):.4f}° E"
    return SunCalibration(
        rig=Rig.distant(positions.directions @ turn, strengths, source=source),
        quality=RigQuality(
            direction_error=spread, verdict=cone.sentence, advice=_advice(positions, cone, strength, spread)
        ),
        positions=positions,
        cone=cone,
    )


def _rotation(rotation: FloatArray) -> FloatArray:
    r = np.asarray(rotation, np.float64)
    if r.shape != (3, 3) or not np.abs(r.T @ r - np.eye(3)).max() < 1e-9 or np.linalg.det(r) < 0:
        raise InputError(
            given=f"The camera's rotation is {r.tolist()}.",
            needed="A proper rotation matrix, 3 × 3.",
            remedy="Build it with rotation_from_heading or rotation_from_pole.",
        )
    return r


def _advice(positions: SunPositions, cone: SunCone, strength: str, spread: FloatArray | None) -> tuple[str, ...]:
    said = []
    if cone.flat:
        said.append(
            "Add pictures of another season or of more hours: the sun moves on a flat cone, and skylight or a wrong"
            " strength tilts normals along its axis."
        )
    low = int((positions.elevation < _LOW).sum())
    if low:
        said.append(
            f"{low} of the suns stand below 10°, where haze weakens and bends the light: leave them out if you can."
        )
    if strength == "equal":
        said.append(
            "All suns are taken as equally strong: let the images tell strengths unless exposure was automatic."
        )
    else:
        said.append(
            "Strengths are those of clear air at one exposure: let the images tell them if there was haze, or if the"
            " exposure changed."
        )
    if spread is None:
        said.append("Errors of directions are not told: give the error of the camera's heading and pitch.")
    return tuple(said)
