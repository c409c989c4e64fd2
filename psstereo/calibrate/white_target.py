"""Strengths of lights from a white card in the pictures."""

from dataclasses import dataclass, replace

import numpy as np

from psstereo.calibrate.viewing import pixel_rays
from psstereo.camera import Camera, Orthographic
from psstereo.errors import InputError
from psstereo.lights import Directional, Led, Light, Rig
from psstereo.stack import LINEAR, ImageStack, Response
from psstereo.types import FloatArray

__all__ = ["WhiteStrengths", "white_strengths"]

_CLIPPED = 0.98
"""Share of full scale from which a value counts as clipped."""
_GRAZING = 0.1
"""Cosine below which a card tells next to nothing of a light."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WhiteStrengths:
    """Strengths that a white card shows.

    Attributes
    ----------
    rig : Rig
        The same lights with the strengths found.
    strengths : float64 array (m, c)
        Factors on the strengths that the rig had [1].
    error : float64 array (m,)
        Relative standard errors, from how uneven the card is [1].
    """

    rig: Rig
    strengths: FloatArray
    error: FloatArray


def white_strengths(
    stack: ImageStack,
    rig: Rig,
    box: tuple[int, int, int, int],
    *,
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0),
    albedo: float = 1.0,
    camera: Camera | None = None,
    distance: float | None = None,
    response: Response = LINEAR,
    dark: FloatArray | None = None,
) -> WhiteStrengths:
    """Measure strengths of lights, one a channel, by a matte white card.

    Not for cards that shine or throw shadows on themselves, nor for lights along the card.

    Parameters
    ----------
    stack : ImageStack
        Pictures with the card, one a light.
    rig : Rig
        The lights, directional ones or lamps; with the strengths that they have in it the card would show 1.
    box : (int, int, int, int)
        First column, first row, last column and last row of a part of the card [px].
    normal : (float, float, float)
        Of the card [1].
    albedo : float
        πρ of the card [1].
    camera : Camera, optional
        For lamps that are near: what sees the card; parallel projection in pixels if absent.
    distance : float, optional
        For a pinhole and lamps: distance of the card along the optical axis [length].
    response : Response
        Camera response to undo.
    dark : float array (h, w, c), optional
        Linear values without any light, to subtract.

    Returns
    -------
    WhiteStrengths
        The rig with strengths.

    Raises
    ------
    InputError
        If the box is not in the pictures or too small, the card is clipped or black, a light grazes it, or numbers of
        pictures and lights differ.
    """
    u0, v0, u1, v1 = box
    height, width = stack.shape[1], stack.shape[2]
    if not (0 <= u0 <= u1 < width and 0 <= v0 <= v1 < height) or (u1 - u0 + 1) * (v1 - v0 + 1) < 9:
        raise InputError(
            given=f"The white card is said to be at columns {u0} to {u1} and rows {v0} to {v1} of pictures of {width} ×"
            f" {height} pixels.",
            needed="A box of nine pixels or more inside of the pictures.",
            remedy="Give first column, first row, last column, last row, counted from 0.",
        )
    if len(stack) != len(rig) or not 0 < albedo < np.inf:
        raise InputError(
            given=f"There are {len(stack)} pictures of the card, {len(rig)} lights, and the albedo is {albedo}.",
            needed="One picture a light, and a positive albedo.",
            remedy="Name the pictures of the same lights, in the same order.",
        )
    rows, columns = np.mgrid[v0 : v1 + 1, u0 : u1 + 1]
    points = _points(np.stack([columns, rows], axis=-1).astype(np.float64), camera or Orthographic(), distance)
    facing = np.asarray(normal, np.float64)
    facing = facing / np.sqrt(facing @ facing)
    factors, errors = [], []
    for i, light in enumerate(rig.lights):
        raw = stack.frame(i)[v0 : v1 + 1, u0 : u1 + 1]
        values = response.linearise(raw, stack.white).astype(np.float64)
        values = (values if dark is None else values - dark[v0 : v1 + 1, u0 : u1 + 1]) / stack.white
        cosine = float((light.directions(points) @ facing).mean())
        _require_useful(raw / stack.white, values, cosine, stack, i)
        ratio = values / (light.irradiance(points, np.broadcast_to(facing, points.shape)) * albedo)
        middle = np.median(ratio, axis=(0, 1))
        factors.append(middle)
        # Unevenness of a card is much the same all over it, so that more pixels do not average it out.
        errors.append(float((1.4826 * np.median(np.abs(ratio / middle - 1.0), axis=(0, 1))).max()))
    strengths = np.array(factors)
    lights = tuple(_stronger(light, strengths[i]) for i, light in enumerate(rig.lights))
    return WhiteStrengths(rig=replace(rig, lights=lights), strengths=strengths, error=np.array(errors))


def _points(pixels: FloatArray, camera: Camera, distance: float | None) -> FloatArray:
    """Return where the card is, at the height 0 under parallel projection."""
    origins, rays = pixel_rays(camera, pixels)
    return origins if distance is None else np.asarray(origins - rays / rays[..., 2:] * distance)


def _require_useful(raw: FloatArray, values: FloatArray, cosine: float, stack: ImageStack, index: int) -> None:
    clipped = float((raw >= _CLIPPED).mean()) if stack.saturates else 0.0
    if cosine < _GRAZING or clipped > 0.01 or not np.median(values) > 0:
        raise InputError(
            given=f"In {stack.names[index]} the card has the median {np.median(values):.3g} of full scale, "
            f"{100 * clipped:.0f} % of it clipped, and the cosine of the light is {cosine:.2f}.",
            needed=f"A card that is neither clipped nor black, under a light of a cosine above {_GRAZING}.",
            remedy="Expose less, turn the card toward the lights, or check the box.",
        )


def _stronger(light: Light, factor: FloatArray) -> Light:
    if isinstance(light, Led):
        return replace(light, flux=light.flux * factor)
    if isinstance(light, Directional):
        return replace(light, strength=light.strength * factor)
    raise InputError(
        given=f"A light is of the kind {light.name}.",
        needed="Strengths are measured of directional lights and of lamps.",
        remedy="Leave that light out.",
    )
