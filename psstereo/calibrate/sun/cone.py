"""Whether the sun's way over some photographs can tell normals.

Over a day the sun stays on a cone about the celestial pole, 90° minus the declination wide: nearly a plane around an
equinox, and the part of a normal along the pole is then all but untold.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psstereo.calibrate.sun.position import Place, SunPositions
from psstereo.errors import InputError, OptionError, RigError
from psstereo.types import FloatArray

__all__ = ["SunCone", "judge_cone", "require_above_horizon", "require_open_cone"]

_FLAT = 15.0
"""Condition from which the verdict warns: one per cent of unexplained light then tilts normals by some degrees."""
_NOISE = 0.01
"""Error of brightness that the predicted error of normals is stated for, as a share of the sun's [1]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SunCone:
    """How the directions of a rig of suns lie.

    Attributes
    ----------
    condition : float
        Largest over smallest singular value of the directions, infinite if they lie in a plane [1].
    weak : float64 array (3,)
        Direction of which the images tell least, in the frame of the directions [1].
    declination : (float, float)
        Least and greatest declination [rad].
    window : float
        Hours of the day from the first to the last, whatever the date [h].
    expected_error : float
        Root-mean-square angle of a normal's error that noise of one per cent of the sun's brightness makes, where
        nothing is in shadow; infinite if the directions lie in a plane [rad].
    """

    condition: float
    weak: FloatArray
    declination: tuple[float, float]
    window: float
    expected_error: float

    @property
    def flat(self) -> bool:
        """Whether the cone is so flat that small errors of the model show."""
        return not self.condition < _FLAT

    @property
    def sentence(self) -> str:
        """How good the path is, as a sentence."""
        low, high = np.degrees(self.declination)
        where = f"{low:.1f}°" if high - low < 0.5 else f"{low:.1f}° to {high:.1f}°"
        path = f"The sun's path spans {self.window:.1f} h at declination {where}; condition {self.condition:.3g}"
        if not np.isfinite(self.expected_error):
            return f"{path}: all in one plane, which tells no normals."
        error = np.degrees(self.expected_error)
        quality = "a flat cone, on which small errors tilt normals much" if self.flat else "good for normals"
        much = f"{error:.2g}° of error" if error < 45.0 else "them worthless"
        return f"{path}, {quality}; noise of 1 % makes {much}."


def judge_cone(positions: SunPositions, place: Place) -> SunCone:
    """Say how well the sun's directions tell normals.

    Parameters
    ----------
    positions : SunPositions
        The suns of the photographs.
    place : Place
        Where; it tells hours from directions.

    Returns
    -------
    SunCone
        Condition, weak direction, window, and what noise does.
    """
    values, rows = np.linalg.svd(positions.directions, full_matrices=True)[1:]
    values = np.concatenate([values, np.zeros(3 - len(values))])
    spans = values[2] > 1e-9 * values[0]
    # A normal's error has two directions of three; the mean over all normals leaves out a third of the trace.
    error = _NOISE * np.sqrt(2.0 / 3.0 * (values**-2.0).sum()) if spans else np.inf
    return SunCone(
        condition=float(values[0] / values[2]) if spans else float("inf"),
        weak=rows[2],
        declination=(float(positions.declination.min()), float(positions.declination.max())),
        window=_window(positions.directions, place),
        expected_error=float(error),
    )


def require_above_horizon(positions: SunPositions, names: Sequence[str], times: Sequence[str]) -> None:
    """Refuse suns of the night, and say so if the clock seems half a day off.

    Parameters
    ----------
    positions : SunPositions
        The suns.
    names, times : sequence of str
        What the photographs are called, and when they were taken, for the message.

    Raises
    ------
    InputError
        If one is not above the horizon.
    """
    below = np.flatnonzero(positions.elevation <= 0)
    if len(below) == 0:
        return
    k = int(below[0])
    others = f", and of {len(below) - 1} more" if len(below) > 1 else ""
    raise InputError(
        given=f"The sun of {names[k]} ({times[k]}) is {-np.degrees(positions.elevation[k]):.1f}° below the horizon"
        f"{others}.",
        needed="A sun above the horizon in every photograph.",
        remedy="The clock, its zone or am and pm are wrong (12 h off turns day into night), or the sign of the"
        " longitude (east is positive); leave pictures of the night out.",
    )


def require_open_cone(cone: SunCone, worst_condition: float) -> None:
    """Refuse a path that is too flat a cone to give normals.

    Parameters
    ----------
    cone : SunCone
        The path.
    worst_condition : float
        Condition above which to refuse, at least 1 [1].

    Raises
    ------
    OptionError
        If the limit is below 1.
    RigError
        If the condition exceeds it.
    """
    if not worst_condition >= 1:
        raise OptionError(
            given=f"The worst condition is {worst_condition}.",
            needed="A number of at least 1, infinity to accept anything.",
            remedy="Leave it at its default.",
        )
    if cone.condition <= worst_condition:
        return
    low, high = np.abs(np.degrees(cone.declination)).min(), np.abs(np.degrees(cone.declination)).max()
    near = high < 10.0
    why = (
        f"near an equinox (declination within {high:.1f}° of the equator) the sun's path over a day is almost a plane"
        if near
        else f"{cone.window:.1f} h of one path are too short an arc of its cone (declination {low:.0f}° to {high:.0f}°)"
    )
    more = "" if near else " photograph over more than 6 h of the day,"
    raise RigError(
        given=f"The directions of the sun have the condition {cone.condition:.3g}: {why}.",
        needed=f"A condition of at most {worst_condition:g}: in a flatter cone the part of a normal along the weak"
        " direction drowns in any error of brightness.",
        remedy=f"Add pictures of another season, a month or more away;{more} or add a lamp or a mirror beside the sun.",
    )


def _window(directions: FloatArray, place: Place) -> float:
    """Return the hours between the first and the last hour angle, over the longest gap that has no photograph."""
    south = np.array([0.0, -np.sin(place.latitude), np.cos(place.latitude)])
    west = np.array([-1.0, 0.0, 0.0])
    turns = np.sort(np.arctan2(directions @ west, directions @ south))
    gaps = np.diff(np.concatenate([turns, turns[:1] + 2.0 * np.pi]))
    return float((2.0 * np.pi - gaps.max()) * 12.0 / np.pi)
