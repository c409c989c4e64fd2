"""What a mirror ball shows: from a place on it to the ray that comes from the lamp, and from a lamp to the place.

The light comes along the *reflected* ray: its direction is the viewing direction mirrored about the ball's normal, and
turns twice as fast as that. (Taking the normal itself is a mistake that is in use.) The way back has no closed form for
a lamp or an eye at a finite distance. Eye, lamp and the ball's centre span a plane, in which one angle is unknown: that
of the point where both are seen under the same angle to the normal.
"""

import numpy as np

from psstereo.calibrate.viewing import Homogeneous, eye_of, pixel_rays, project
from psstereo.camera import Camera
from psstereo.types import BoolArray, FloatArray

__all__ = ["mirrored_pixels", "reflected_rays"]

_ROUNDS = 60
"""Steps at most; from a distance of a few radii five are enough."""
_ENOUGH = 1e-8
"""Step after which the next one is below rounding, since steps shrink to their squares [rad]."""


def reflected_rays(
    camera: Camera, centre: FloatArray, radius: float, pixels: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the rays that mirror balls send on to certain pixels, backwards: from the ball toward the lamp.

    Parameters
    ----------
    camera : Camera
        A pinhole or a parallel projection.
    centre : float array (3,)
        Middle of the ball [length].
    radius : float
        Of the ball [length].
    pixels : float array (..., 2)
        Columns and rows [px].

    Returns
    -------
    points : float64 array (..., 3)
        Where they leave the ball; NaN where a pixel does not see it [length].
    directions : float64 array (..., 3)
        Unit vectors toward the lamp [1].
    """
    origins, rays = pixel_rays(camera, pixels)
    arm = origins - centre
    along = (arm * rays).sum(axis=-1)
    nearest = arm - along[..., None] * rays
    # From the point nearest to the centre, so that nothing is lost where the camera is far away.
    square = radius * radius - (nearest * nearest).sum(axis=-1)
    half = np.sqrt(np.where(square >= 0, square, np.nan))
    normals = (nearest - half[..., None] * rays) / radius
    cosine = half / radius
    return centre + radius * normals, np.asarray(rays + 2.0 * cosine[..., None] * normals)


def mirrored_pixels(camera: Camera, centre: FloatArray, radius: FloatArray, lamps: Homogeneous) -> FloatArray:
    """Return where mirror balls show lamps.

    Parameters
    ----------
    camera : Camera
        A pinhole or a parallel projection.
    centre : float array (..., 3)
        Middles of the balls [length].
    radius : float array (...)
        Of the balls [length].
    lamps : Homogeneous
        Lamps, near ones or directions; their arrays go with those of the balls (...).

    Returns
    -------
    float64 array (..., 2)
        Columns and rows of the highlights; NaN for a lamp inside of the ball or hidden behind it [px].
    """
    eye = eye_of(camera)
    centre, radius = np.asarray(centre, np.float64), np.asarray(radius, np.float64)
    to_eye, to_lamp = eye.seen_from(centre), lamps.seen_from(centre)
    first = to_eye / np.sqrt((to_eye * to_eye).sum(axis=-1, keepdims=True))
    across = to_lamp - (to_lamp * first).sum(axis=-1, keepdims=True) * first
    length = np.sqrt((across * across).sum(axis=-1, keepdims=True))
    straight = np.asarray(length == 0)  # lamp and eye in one line: any direction across serves
    second = np.where(straight, 0.0, across / np.where(straight, 1.0, length))
    e = _plane(to_eye, first, second)
    s = _plane(to_lamp, first, second)
    pull_e = radius * np.broadcast_to(eye.inverse, radius.shape)
    pull_s = radius * lamps.inverse
    angle = _bisecting(e, s, pull_e, pull_s)
    normal = np.cos(angle)[..., None] * first + np.sin(angle)[..., None] * second
    # A lamp behind the ball may have no such point, and Newton's steps end anywhere then.
    above: BoolArray = s[0] * np.cos(angle) + s[1] * np.sin(angle) > pull_s
    blind = (~above | _beyond(s, pull_s) | (straight[..., 0] & (s[0] < 0)))[..., None]
    return np.where(blind, np.nan, project(camera, centre + radius[..., None] * normal))


def _plane(vectors: FloatArray, first: FloatArray, second: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a vector's parts along the two axes of the plane."""
    return (vectors * first).sum(axis=-1), (vectors * second).sum(axis=-1)


def _beyond(s: tuple[FloatArray, FloatArray], pull: FloatArray) -> BoolArray:
    """Return where a lamp is inside of the ball: its vector at the centre is shorter than the pull of one radius."""
    return np.asarray((pull > 0) & (np.hypot(s[0], s[1]) <= pull))


def _bisecting(
    e: tuple[FloatArray, FloatArray], s: tuple[FloatArray, FloatArray], pull_e: FloatArray, pull_s: FloatArray
) -> FloatArray:
    """Return the angle of the normal that halves the angle between the vectors toward eye and lamp.

    At the angle t a vector v from the centre becomes v − pull (cos t, sin t) at the surface. The normal lies between
    those that face the eye and the lamp; a step of Newton's that leaves what is left of this range is a bisection.
    """
    high = np.broadcast_to(np.arctan2(s[1], s[0]), np.broadcast_shapes(np.shape(s[1]), np.shape(pull_s))).astype(float)
    low, t = np.zeros_like(high), 0.5 * high
    for _ in range(_ROUNDS):
        cosine, sine = np.cos(t), np.sin(t)
        total, slope = -2.0 * t, np.full_like(t, -2.0)
        for v, pull in ((e, pull_e), (s, pull_s)):
            x, y = v[0] - pull * cosine, v[1] - pull * sine
            square = x * x + y * y
            total = total + np.arctan2(y, x)
            slope = slope - pull * (x * cosine + y * sine) / np.where(square > 0, square, np.nan)
        low, high = np.where(total > 0, t, low), np.where(total > 0, high, t)
        with np.errstate(divide="ignore", invalid="ignore"):
            moved = t - total / slope
        moved = np.where((moved >= low) & (moved <= high), moved, 0.5 * (low + high))
        step, t = float(np.abs(moved - t).max(initial=0.0)), moved
        if step <= _ENOUGH:
            break
    return np.asarray(t)
