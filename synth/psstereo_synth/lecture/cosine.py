"""The cosine law: a slanting beam is spread over a larger area."""

import numpy as np

from psstereo.errors import InputError
from psstereo.lights import Directional
from psstereo.types import FloatArray
from psstereo_synth.lecture.example import Example, largest_of, largest_relative
from psstereo_synth.lecture.statements import STATEMENTS

__all__ = ["cosine", "footprint_area"]

_STRENGTH = 1000.0
"""Irradiance of a surface that faces the beam [W m⁻²]."""
_ELEVATIONS = (90.0, 60.0, 45.0, 30.0, 10.0, 1.0, 1e-3, 1e-6)
"""Of the beam over the ground [deg]."""
_CORNERS = 360
"""Of the polygon that stands for the beam's round cross-section."""


def _polygon_area(points: FloatArray) -> float:
    """Return the area of a flat polygon (k, 3), half the length of the sum of its edges' cross products [m²]."""
    twice = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    return float(0.5 * np.sqrt(twice @ twice))


def footprint_area(direction: FloatArray, radius: float) -> tuple[float, float]:
    """Cut a beam across, and by the ground z = 0, and measure both areas.

    No cosine is used: the outline of the beam's cross-section is followed along the beam down to the ground. A long
    footprint that lies across the axes loses digits, since its width is a small difference of coordinates: 1e-15 / n·l
    of its area is lost.

    Parameters
    ----------
    direction : float array (3,)
        Unit vector from the ground against the beam, with z > 0 [1].
    radius : float
        Of the beam [m].

    Returns
    -------
    across, footprint : float
        Areas of the cross-section and of the ground that it lights [m²].

    Raises
    ------
    InputError
        If the beam does not come from above.

    Examples
    --------
    >>> across, footprint = footprint_area(np.array([0.6, 0.0, 0.8]), 1.0)
    >>> print(f"{footprint / across:.12f}")
    1.250000000000
    """
    if not direction[2] > 0.0:
        raise InputError(
            given=f"The beam comes from {np.asarray(direction).tolist()}.",
            needed="It reaches the ground z = 0 from above, from z > 0.",
            remedy="Turn it round; light from below or along the ground gives no footprint.",
        )
    turn = np.linspace(0.0, 2.0 * np.pi, _CORNERS, endpoint=False)[:, None]
    side = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    side /= np.sqrt(side @ side)
    outline = radius * (np.cos(turn) * side + np.sin(turn) * np.cross(direction, side))
    ground = outline - outline[:, 2:] / direction[2] * direction
    return _polygon_area(outline), _polygon_area(ground)


def cosine() -> Example:
    """Follow a beam to the ground, and compare the power per area there with the light's irradiance.

    *Statement.* A beam of cross-section A carries the power E₀ A, whatever it falls on. Ground that faces it gets E₀.
    If the ground's normal n and the direction l to the light enclose the angle θ, the same power lands on the area
    A / cosθ, so that E = E₀ cosθ = E₀ n·l. The cosine is geometry of the light, not a property of the surface.

    *Where it stops being true.* Never at the surface element itself, however low the light. But ground turned away
    from the light, n·l < 0, gets nothing rather than a negative amount; a source with an extent, such as the sun, has
    no single θ when part of it is below the horizon (example "sun"); and uneven ground has another n at each place.

    Returns
    -------
    Example
        The errors are relative: of the area against A / n·l, and of E₀ A / footprint against the light's irradiance.
    """
    angle = np.deg2rad(_ELEVATIONS)
    toward = np.stack([np.cos(angle), np.zeros_like(angle), np.sin(angle)], axis=-1)
    areas = np.array([footprint_area(way / np.sqrt(way @ way), 1.0) for way in toward])
    spread = areas[:, 1] / areas[:, 0]
    ground = np.array([[0.0, 0.0, 1.0]])
    light = [
        float(Directional(direction=way, strength=np.array([_STRENGTH])).irradiance(np.zeros((1, 3)), ground)[0, 0])
        for way in toward
    ]
    dot = np.sin(angle)
    error = largest_of(largest_relative(spread, 1.0 / dot), largest_relative(_STRENGTH / spread, light))
    tolerance = 1e-12
    return Example(
        title="The cosine law",
        statement=STATEMENTS["cosine"],
        columns=("elevation [deg]", "n·l [1]", "footprint / area [1]", "E₀ area / footprint [W m⁻²]", "E [W m⁻²]"),
        rows=tuple(zip(_ELEVATIONS, dot.tolist(), spread.tolist(), (_STRENGTH / spread).tolist(), light, strict=True)),
        largest_error=error,
        tolerance=tolerance,
        holds=error <= tolerance,
        notes=(f"E₀ = {_STRENGTH:g} W m⁻²",),
    )
