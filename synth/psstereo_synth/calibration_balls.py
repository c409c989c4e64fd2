"""Pictures of mirror balls and matte balls under one light, ray by ray, for calibrations to be tried on."""

import numpy as np

from psstereo.calibrate.balls import Ball
from psstereo.calibrate.viewing import pixel_rays
from psstereo.errors import InputError
from psstereo.lights import Light
from psstereo.types import BoolArray, FloatArray

__all__ = ["matte_ball_picture", "mirror_ball_picture"]


def mirror_ball_picture(
    ball: Ball,
    light: Light,
    shape: tuple[int, int],
    *,
    size: float,
    radiance: float = 1.0,
    surroundings: float = 0.0,
    samples: int = 4,
) -> FloatArray:
    """Picture a mirror ball that shows one lamp as an even, round spot.

    Rays are reflected one by one, so that the spot has the shape that the ball gives it. Not for what else a ball
    shows: all other directions are equally bright, and the background is black.

    Parameters
    ----------
    ball : Ball
        The ball.
    light : Light
        A directional light or a lamp; its strength is not used.
    shape : (int, int)
        Rows and columns.
    size : float
        Half the angle under which the lamp is seen from the ball [rad].
    radiance : float
        Brightness of the lamp [value].
    surroundings : float
        Brightness of all else [value].
    samples : int
        Rays along each side of a pixel.

    Returns
    -------
    float64 array (h, w)
        The picture [value].

    Raises
    ------
    InputError
        If the lamp has no size, or there are no samples.
    """
    if not 0 < size < np.pi:
        raise InputError(
            given=f"The lamp's half angle is {size} rad.",
            needed="An angle between 0 and π: a point has no highlight of any area.",
            remedy="Give such as 0.02.",
        )
    rows, columns = np.indices(shape, dtype=np.float64)
    middles = np.stack([columns, rows], axis=-1)
    angle, hit = _mirrored_angle(ball, light, middles)
    picture = np.where(hit, np.where(angle < size, radiance, surroundings), 0.0)
    # Rays between the pixels' middles matter only where an edge goes through a pixel: the lamp's, or the ball's.
    across = np.hypot(*np.gradient(angle)) + 1e-6
    rim = np.hypot(*np.gradient(hit.astype(np.float64))) > 0
    edge = rim | (hit & (np.abs(angle - size) < 2.0 * across))
    total = np.zeros(int(np.count_nonzero(edge)))
    for offset in _offsets(samples):
        inner, on = _mirrored_angle(ball, light, middles[edge] + offset)
        total += np.where(on, np.where(inner < size, radiance, surroundings), 0.0)
    picture[edge] = total / samples**2
    return picture


def matte_ball_picture(
    ball: Ball, light: Light, shape: tuple[int, int], *, albedo: float = 1.0, ambient: float = 0.0, samples: int = 3
) -> FloatArray:
    """Picture a matte ball before a black background.

    Parameters
    ----------
    ball : Ball
        The ball.
    light : Light
        Any light, its strength as the value of a white ball that faces it; a ball throws no shadow that it sees itself.
    shape : (int, int)
        Rows and columns.
    albedo : float
        πρ of the ball [1].
    ambient : float
        Added everywhere, to the background too [value].
    samples : int
        Rays along each side of a pixel.

    Returns
    -------
    float64 array (h, w, c)
        The picture [value].

    Raises
    ------
    InputError
        If there are no samples.
    """
    rows, columns = np.indices(shape, dtype=np.float64)
    middles = np.stack([columns, rows], axis=-1)
    total = np.zeros((*shape, light.channels))
    for offset in _offsets(samples):
        points, normals, _, hit = _surface(ball, middles + offset)
        shaded = albedo * light.irradiance(points, normals)
        total += np.where(hit[..., None], shaded, 0.0)
    return total / samples**2 + ambient


def _offsets(samples: int) -> list[FloatArray]:
    """Return the places in a pixel that are looked through, (2,) each."""
    if samples < 1:
        raise InputError(
            given=f"There are {samples} samples along a pixel's side.",
            needed="One or more.",
            remedy="Give 4 for smooth edges.",
        )
    offsets = (np.arange(samples) + 0.5) / samples - 0.5
    return [np.array([a, b]) for a in offsets for b in offsets]


def _mirrored_angle(ball: Ball, light: Light, pixels: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the angle between the mirrored ray and the light, and where there is a ball."""
    points, normals, rays, hit = _surface(ball, pixels)
    mirrored = rays - 2.0 * (rays * normals).sum(axis=-1, keepdims=True) * normals
    toward = light.directions(points)
    across = np.cross(mirrored, toward)
    return np.arctan2(np.sqrt((across * across).sum(axis=-1)), (mirrored * toward).sum(axis=-1)), hit


def _surface(ball: Ball, pixels: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Return points, normals, viewing rays and where there is a ball at all.

    Beside the ball, points are put on its rim, so that nothing is undefined.
    """
    centre, radius = ball.sphere
    origins, rays = pixel_rays(ball.camera, pixels)
    b = ((origins - centre) * rays).sum(axis=-1)
    c = ((origins - centre) ** 2).sum(axis=-1) - radius * radius
    square = b * b - c
    hit = square > 0
    along = -b - np.sqrt(np.where(hit, square, 0.0))
    points = origins + along[..., None] * rays
    normals = points - centre
    normals = normals / np.sqrt((normals * normals).sum(axis=-1, keepdims=True))
    return centre + radius * normals, normals, rays, np.asarray(hit)
