"""How a camera stands outdoors: from compass and level, or from one vertical and its shadow.

A rotation here has the camera's axes as its columns, x right, y up, z toward the viewer, in the frame x east, y north,
z up. Its transpose takes directions of the world to those of the camera.
"""

from dataclasses import dataclass

import numpy as np

from psstereo.camera import Pinhole
from psstereo.errors import InputError
from psstereo.lights.solar import from_azimuth
from psstereo.lights.vectors import unit_vector
from psstereo.radiometry.checks import in_range
from psstereo.types import FloatArray

__all__ = ["ShadowedPole", "rotation_from_heading", "rotation_from_pole"]

_STEPS = 720
"""Leanings of the pole that are tried before a root is closed in on."""
_MARGIN = 1e-3
"""Share of the angle between the two rays that is kept from its ends, where the pole would be endless [1]."""
_SAME = np.radians(0.01)
"""Solutions nearer than this are one [rad]."""


def rotation_from_heading(heading: float, pitch: float, roll: float = 0.0) -> FloatArray:
    """Return the rotation of a camera whose line of sight is known by compass and level.

    Not for a magnetic heading as it is: add the declination of the place, up to 20° in inhabited places. An error of
    the heading turns all normals with it.

    Parameters
    ----------
    heading : float
        Azimuth of the line of sight, clockwise from true north. Looking straight down or up, that of the top of the
        image, or of its bottom [rad].
    pitch : float
        How far the line of sight is above the horizon, −π/2 … π/2 [rad].
    roll : float
        How far the camera is turned clockwise, as seen by who holds it: its right side goes down [rad].

    Returns
    -------
    float64 array (3, 3)
        The camera's axes as columns, x east, y north, z up [1].

    Raises
    ------
    InputError
        If an angle is not finite, or the pitch is outside its range.

    Examples
    --------
    >>> print(rotation_from_heading(0.0, -np.pi / 2).round(6) + 0.0)  # straight down, north at the top
    [[1. 0. 0.]
     [0. 1. 0.]
     [0. 0. 1.]]
    """
    turn = float(in_range("heading", heading, unit="rad", low=-np.inf))
    tilt = float(in_range("pitch", pitch, unit="rad", low=-0.5 * np.pi, high=0.5 * np.pi))
    lean = float(in_range("roll", roll, unit="rad", low=-np.inf))
    forward = from_azimuth(turn, tilt)
    right = np.array([np.cos(turn), -np.sin(turn), 0.0])
    up = np.cross(right, forward)
    c, s = np.cos(lean), np.sin(lean)
    return np.stack([c * right - s * up, s * right + c * up, -forward], axis=1)


@dataclass(frozen=True, kw_only=True, eq=False)
class ShadowedPole:
    """A vertical edge and its shadow on level ground, in one photograph.

    Attributes
    ----------
    base, top, tip : float array (2,)
        Foot and head of the edge, and the end of its shadow: column and row [px].

    Raises
    ------
    InputError
        If the points are not finite, or two of them coincide.
    """

    base: FloatArray
    top: FloatArray
    tip: FloatArray

    def __post_init__(self) -> None:
        points = np.array([self.base, self.top, self.tip], np.float64)
        apart = [np.linalg.norm(points[i] - points[j]) for i, j in ((0, 1), (0, 2), (1, 2))] if points.ndim == 2 else []
        if points.shape != (3, 2) or not np.isfinite(points).all() or min(apart) < 1.0:
            raise InputError(
                given=f"Base, top and tip of the shadow are at {points.tolist()}.",
                needed="Three different places in the image, column and row in pixels.",
                remedy="Take a tall edge that the picture shows whole, and its whole shadow.",
            )


def rotation_from_pole(
    pole: ShadowedPole, camera: Pinhole, sun: FloatArray, *, pitch: float | None = None
) -> FloatArray:
    """Return the rotation of a camera that sees a vertical edge and its shadow on level ground.

    The unknown leaning of the edge in the plane of its two rays makes base, top and tip three points in space up to
    scale, of which the angle between edge and sunlight must be that of the ephemeris: one equation in one unknown.
    Not where the ground is not level, and weak where the shadow is short or points at the camera.

    Parameters
    ----------
    pole : ShadowedPole
        Where base, top and tip are seen.
    camera : Pinhole
        The camera, lens distortion removed.
    sun : float array (3,)
        Direction toward the sun at that moment, x east, y north, z up [1].
    pitch : float, optional
        How far the line of sight is above the horizon, roughly: chooses where two standings fit [rad].

    Returns
    -------
    float64 array (3, 3)
        The camera's axes as columns, x east, y north, z up [1].

    Raises
    ------
    InputError
        If no leaning fits, or two that differ do and there is no pitch; or the sun is below the horizon or in the
        zenith.
    """
    from scipy.optimize import brentq

    toward = unit_vector(sun, "sun direction")
    if not 0.02 < toward[2] < 0.999:
        raise InputError(
            given=f"The sun stands {np.degrees(np.arctan2(toward[2], np.hypot(toward[0], toward[1]))):.1f}° high.",
            needed="A sun that throws a shadow on the ground, which does not end at the foot.",
            remedy="Check time, zone and place, or take the picture at another hour.",
        )
    rays = np.array([_ray(camera, point) for point in (pole.base, pole.top, pole.tip)])
    across = np.cross(rays[0], rays[1])
    opening = float(np.arctan2(np.linalg.norm(across), rays[0] @ rays[1]))
    side = np.cross(across / np.linalg.norm(across), rays[0])

    def misfit(lean: float) -> float:
        found = _space(rays, rays[0] * np.cos(lean) + side * np.sin(lean))
        return float("nan") if found is None else float(found[1] @ found[0] - toward[2])

    # At a lean equal to the opening the edge lies along the ray of its top, and would be endless.
    leans = np.linspace(opening * (1.0 + _MARGIN), np.pi * (1.0 - _MARGIN), _STEPS)
    values = np.array([misfit(lean) for lean in leans])
    crossings = np.flatnonzero(values[:-1] * values[1:] <= 0.0)  # false where one is NaN
    found = []
    for k in crossings:
        lean = brentq(misfit, leans[k], leans[k + 1], xtol=1e-14)
        pair = _space(rays, rays[0] * np.cos(lean) + side * np.sin(lean))
        if pair is not None:
            found.append(_align(pair, toward))
    return _chosen(found, pitch)


def _ray(camera: Pinhole, point: FloatArray) -> FloatArray:
    x, y = np.asarray(point, np.float64)
    v = (y - camera.cy) / camera.fy
    ray = np.array([(x - camera.cx - camera.skew * v) / camera.fx, -v, -1.0])
    return np.asarray(ray / np.linalg.norm(ray))


def _space(rays: FloatArray, up: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Return upward direction and direction toward the sun in the camera's frame; None for what cannot be seen."""
    base, top, tip = rays
    ground, slope = base @ up, tip @ up
    # The camera looks down on the ground, and its ray meets it: both products are negative.
    if not (ground < 0 and slope < 0):
        return None
    end = tip * (ground / slope)
    # base + height up = reach top, in the plane that they span
    (height, reach), *_ = np.linalg.lstsq(np.stack([-up, top], axis=1), base, rcond=None)
    if not (height > 0 and reach > 0):
        return None
    light = base + height * up - end
    return up, light / np.linalg.norm(light)


def _align(pair: tuple[FloatArray, FloatArray], sun: FloatArray) -> FloatArray:
    """Return the rotation that takes the camera's up and sun to those of the world."""
    vertical = np.array([0.0, 0.0, 1.0])
    frames = []
    for up, light in (pair, (vertical, sun)):
        flat = light - (light @ up) * up
        flat = flat / np.linalg.norm(flat)
        frames.append(np.stack([flat, np.cross(up, flat), up], axis=1))
    return np.asarray(frames[1] @ frames[0].T)


def _chosen(found: list[FloatArray], pitch: float | None) -> FloatArray:
    """Return the solution nearest in pitch, or the only one; refuse none, and two that differ."""
    if not found:
        raise InputError(
            given="No standing of the camera explains base, top and tip of the shadow.",
            needed="A vertical edge and its shadow on level ground, seen from above, under the sun of that time.",
            remedy="Check the three points (column, row), K, time, zone and place.",
        )
    pitches = np.array([np.arctan2(-one[2, 2], np.hypot(one[0, 2], one[1, 2])) for one in found])
    if pitch is not None:
        return found[int(np.abs(pitches - in_range("pitch", pitch, unit="rad", low=-np.pi, high=np.pi)).argmin())]
    if max(_angle(found[0].T @ other) for other in found) > _SAME:
        words = " and ".join(f"{value:.1f}°" for value in np.degrees(pitches))
        raise InputError(
            given=f"Standings of the camera with a pitch of {words} explain the shadow equally well.",
            needed="One of them; a pitch known to some degrees tells which.",
            remedy="Give the pitch too, or use another edge, with its shadow to the side.",
        )
    return found[0]


def _angle(turned: FloatArray) -> float:
    axis = [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
    return float(np.arctan2(np.linalg.norm(axis), np.trace(turned) - 1.0))
