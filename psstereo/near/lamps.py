"""The lamps of a capture as an array, and which captures are refused."""

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.capture import Capture
from psstereo.errors import InputError, RigError, UnsupportedError
from psstereo.lights import Led, Rig
from psstereo.near.view import View
from psstereo.types import FloatArray

__all__ = ["LEAST_LAMPS", "lamp_array", "lamp_fluxes", "lamps_behind", "require_metric", "wants_near"]

LEAST_LAMPS = 4
"""Three give a normal at a known place; the place itself needs one more."""


def wants_near(capture: Capture) -> bool:
    """Return whether a light of a capture is a lamp at a position, so that solvers for distant lights do not serve."""
    return any(isinstance(light, Led) for light in capture.rig.lights)


def lamp_array(rig: Rig) -> FloatArray:
    """Return the lamps as float64 (m, 7): position, axis, exponent.

    Parameters
    ----------
    rig : Rig
        The lamps.

    Raises
    ------
    UnsupportedError
        If one of the lights is no lamp at a position.
    RigError
        If there are fewer than four, or all positions lie on one line.
    """
    other = next((i for i, light in enumerate(rig.lights) if not isinstance(light, Led)), None)
    if other is not None:
        mixed = any(isinstance(light, Led) for light in rig.lights)
        raise UnsupportedError(
            given=f"Light {other + 1} is of the kind {rig.lights[other].name}"
            + (", others are lamps at positions." if mixed else "."),
            needed="For near lights all of them must be lamps with a position, an axis, mu and a flux.",
            remedy="Leave the images under other lights out, or use a solver for distant lights.",
        )
    if len(rig) < LEAST_LAMPS:
        raise RigError(
            given=f"There {'is 1 lamp' if len(rig) == 1 else f'are {len(rig)} lamps'}.",
            needed="Three lamps tell a normal at a known place; the place takes a fourth.",
            remedy="Take more images with other lamps, or solve with distant lights (--lights).",
        )
    lamps = np.array([[*light.position, *light.axis, light.mu] for light in rig.lights if isinstance(light, Led)])
    spread = np.linalg.svd(lamps[:, :3] - lamps[:, :3].mean(axis=0), compute_uv=False)
    if not spread[1] > 1e-6 * spread[0]:
        raise RigError(
            given=f"The positions of all {len(rig)} lamps lie on one line, or are the same.",
            needed="They must spread over two directions, or every light vector lies in one plane with the surface.",
            remedy="Check the columns and the unit of the positions; move lamps away from the line.",
        )
    return lamps


def lamp_fluxes(rig: Rig, channels: int) -> FloatArray:
    """Return radiant intensities, float64 (m, channels).

    Parameters
    ----------
    rig : Rig
        Lamps only.
    channels : int
        Channels of the images.

    Raises
    ------
    RigError
        If a lamp has another number of channels.
    """
    rows = []
    for i, light in enumerate(rig.lights):
        flux = light.flux if isinstance(light, Led) else np.zeros(0)
        if flux.size not in (1, channels):
            raise RigError(
                given=f"Lamp {i + 1} has fluxes for {flux.size} channels; the images, {channels}.",
                needed="A lamp has one flux, or one for each channel of the images.",
                remedy="Correct the lamps' fluxes, or convert the images to the same number of channels.",
            )
        rows.append(np.broadcast_to(flux, channels))
    return np.array(rows)


def require_metric(camera: Camera) -> None:
    """Refuse an orthographic camera without the size of its pixels: lamps and pixels then have no common unit.

    Raises
    ------
    InputError
        If the unit is the pixel.
    """
    if isinstance(camera, Orthographic) and camera.length_unit == "px":
        raise InputError(
            given="The lamps have positions, but nothing says how large a pixel is or where the camera stands.",
            needed="The camera must be known in the unit of the lamps' positions.",
            remedy="Write a capture.toml with K (and the camera's position), or with pixel_size; or give --lights.",
        )


def lamps_behind(lamps: FloatArray, view: View, q: FloatArray) -> FloatArray:
    """Return how far each lamp lies behind the surface that hides it from the camera, −inf where it is not hidden.

    Parameters
    ----------
    lamps : float64 array (m, 7)
        The lamps.
    view : View
        Lines of sight.
    q : float64 array (p,)
        Where the surface is, see :class:`psstereo.near.view.View`.

    Returns
    -------
    float64 array (m,)
        Length along z; positive: the lamp is behind or within the object [length].
    """
    points = view.points(q)
    out = np.full(len(lamps), -np.inf)
    for i, lamp in enumerate(lamps):
        if isinstance(view.camera, Pinhole):
            if lamp[2] >= 0:  # beside or behind the camera
                continue
            away = np.hypot(view.rays[:, 0] + lamp[0] / lamp[2], view.rays[:, 1] + lamp[1] / lamp[2])
            pixel = 1.0 / view.camera.fx
        else:
            away = np.hypot(points[:, 0] - lamp[0], points[:, 1] - lamp[1])
            pixel = view.camera.pixel_size if isinstance(view.camera, Orthographic) else 0.0
        nearest = int(np.argmin(away))
        if away[nearest] <= pixel:
            out[i] = points[nearest, 2] - lamp[2]
    return out
