"""Surfaces with exact normals that tell integrators apart: smooth ones, cliffs that fade, a hinged plate."""

from dataclasses import dataclass

import numpy as np

from psstereo.errors import OptionError
from psstereo.types import BoolArray, FloatArray
from psstereo_synth.hills import normals_of_slopes

__all__ = ["RELIEFS", "Relieved", "relieved"]

RELIEFS = {
    "smooth": "a dome with bumps",
    "cliff": "the same, and half a hill: a cliff that fades at both ends",
    "gentle cliff": "the same, and half a wide hill: a cliff that fades toward the mask's rim",
    "flap": "the same, and a plate that is hinged on one side and open on three",
}
"""What the surfaces are, by name."""

_RADIUS = 0.427
"""Of the round mask, as a share of the shorter side."""


@dataclass(frozen=True, eq=False)
class Relieved:
    """A surface to be integrated.

    Attributes
    ----------
    normals : float64 array (h, w, 3)
        Exact unit normals of the ground on either side of a jump [1].
    height : float64 array (h, w)
        Heights with mean 0 over the mask [px].
    mask : bool array (h, w)
        Where it is known.
    """

    normals: FloatArray
    height: FloatArray
    mask: BoolArray


def relieved(kind: str, width: int, height: int, *, whole: bool = False, seed: int = 0) -> Relieved:
    """Make one of the surfaces.

    Parameters
    ----------
    kind : str
        One of `RELIEFS`.
    width, height : int
        Of the image [px].
    whole : bool
        Whether the whole rectangle is inside the mask, rather than a disc.
    seed : int
        Of the bumps.

    Returns
    -------
    Relieved
        The surface.

    Raises
    ------
    OptionError
        If the kind is unknown.
    """
    if kind not in RELIEFS:
        raise OptionError(
            given=f"The surface {kind!r} is unknown.", needed=f"Known are {', '.join(RELIEFS)}.", remedy="Choose one."
        )
    x = np.arange(width) - (width - 1) / 2.0
    y = ((height - 1) / 2.0 - np.arange(height))[:, None]
    radius = _RADIUS * min(width, height)
    mask = np.broadcast_to(True, (height, width)) if whole else x * x + y * y <= radius * radius
    z, along_x, along_y = _dome(x, y, 1.15 * (np.hypot(width, height) / 2.0 if whole else radius))
    rng = np.random.default_rng(seed)
    for _ in range(14):
        turn, away = rng.uniform(0.0, 2.0 * np.pi), radius * np.sqrt(rng.uniform(0.0, 0.8))
        middle, wide = (away * np.cos(turn), away * np.sin(turn)), radius * rng.uniform(0.06, 0.22)
        tall = wide * rng.uniform(0.25, 0.7) * rng.choice([-1.0, 1.0])
        _add_hill((x, y), (z, along_x, along_y), middle, wide=wide, tall=tall)
    cut = -0.05 * radius, 0.1 * radius
    if kind == "cliff":
        wide = 0.12 * radius
        _add_hill((x, y), (z, along_x, along_y), cut, wide=wide, tall=3.0 * wide, half=True)
    elif kind == "gentle cliff":
        tall = 55.0 * radius / (_RADIUS * 512.0)
        _add_hill((x, y), (z, along_x, along_y), cut, wide=0.5 * radius, tall=tall, half=True)
    elif kind == "flap":
        on = (np.abs(x) < 0.3 * radius) & (np.abs(y) < 0.3 * radius)
        z += np.where(on, 1.2 * (x + 0.3 * radius), 0.0)
        along_x += np.where(on, 1.2, 0.0)
    return Relieved(normals_of_slopes(along_x, along_y), z - z[mask].mean(), np.array(mask))


def _dome(x: FloatArray, y: FloatArray, radius: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return height and slopes of a sphere's cap; level beyond its outline."""
    out = np.minimum(x * x + y * y, (0.999 * radius) ** 2)
    z = np.sqrt(radius**2 - out)
    return z, -x / z, -y / z


def _add_hill(
    places: tuple[FloatArray, FloatArray],
    parts: tuple[FloatArray, FloatArray, FloatArray],
    middle: tuple[float, float],
    *,
    wide: float,
    tall: float,
    half: bool = False,
) -> None:
    """Add a Gaussian hill to height and slopes, or only what of it lies left of its middle."""
    across, up = places[0] - middle[0], places[1] - middle[1]
    hill = tall * np.exp(-up * up / (2.0 * wide * wide)) * np.exp(-across * across / (2.0 * wide * wide))
    if half:
        hill = np.where(across < 0.0, hill, 0.0)
    parts[0][...] += hill
    parts[1][...] -= hill * across / (wide * wide)
    parts[2][...] -= hill * up / (wide * wide)
