"""A round skylight over a floor."""

import numpy as np

from psstereo.lights import Disc
from psstereo.radiometry import disc_solid_angle, narrow_irradiance
from psstereo_synth.lecture.example import Example, largest_of, largest_relative
from psstereo_synth.lecture.statements import STATEMENTS

__all__ = ["skylight"]

_RADIANCE, _RADIUS = 1000.0, 1.0
"""Of the skylight [W m⁻² sr⁻¹], [m]."""
_PLACES = ((0.0, 2.0), (1.0, 2.0), (2.0, 2.0), (5.0, 2.0), (20.0, 2.0), (0.0, 1.0), (0.0, 10.0), (0.0, 100.0))
"""How far from the axis, and how far under the skylight [m]."""
_BEAMS = 1600
"""Small pieces of the skylight whose light is added up."""


def skylight() -> Example:
    """Compute the irradiance on a floor in closed form, by adding up small beams, and as if the skylight were far.

    *Statement.* A round skylight of radiance L, whose rim is seen under the angle θ from its axis, gives a floor
    under its middle

        E = ∫ L cos dΩ = π L sin²θ.

    It depends on the angle only: a skylight of twice the radius in twice the height gives the same. Under an
    endless one, θ = 90°, the floor gets π L. From so far away that all its parts have the same n·l, E = L Ω n·l.

    *Where it stops being true.* π L sin²θ holds on the axis only; across the floor the light falls off, at first
    slowly and then as 1/d⁴ (two cosines besides 1/d²). L Ω n·l neglects how n·l varies over the skylight:
    on the axis it is too large, by 1/4 (R/h)² at first, by 17 % where θ = 45°, and twice too large where the skylight
    fills the sky, since then Ω = 2π but E = π L. Aside it may be too small, in the table by 3 %.

    Returns
    -------
    Example
        The errors are relative: of the closed form on the axis against π L sin²θ, and of the sum of beams against the
        closed form everywhere.
    """
    lamp = Disc(centre=np.zeros(3), axis=np.array([0.0, 0.0, -1.0]), radius=_RADIUS, radiance=np.array([_RADIANCE]))
    offset, depth = np.array(_PLACES).T
    floor = np.stack([offset, np.zeros_like(offset), -depth], axis=-1)
    up = np.broadcast_to([0.0, 0.0, 1.0], floor.shape)
    exact = lamp.irradiance(floor, up)[:, 0]
    beams = lamp.beams(floor, _BEAMS)
    summed = sum(b.irradiance[:, 0] * np.maximum(b.directions[:, 2], 0.0) for b in beams)
    rim = np.arctan2(_RADIUS, depth)
    on_axis = np.where(offset == 0.0, np.pi * _RADIANCE * np.sin(rim) ** 2, np.nan)
    solid = disc_solid_angle(_RADIUS, depth, offset)
    narrow = narrow_irradiance(_RADIANCE, solid, depth / np.hypot(offset, depth))
    axis = offset == 0.0
    error = largest_of(largest_relative(exact[axis], on_axis[axis]), largest_relative(summed, exact))
    tolerance = 1e-12
    return Example(
        title="A skylight",
        statement=STATEMENTS["skylight"],
        columns=(
            "off the axis [m]",
            "below [m]",
            "E [W m⁻²]",
            f"sum of {_BEAMS} beams [W m⁻²]",
            "π L sin²θ [W m⁻²]",
            "L Ω n·l [W m⁻²]",
            "L Ω n·l / E [1]",
        ),
        rows=tuple(
            (*row[:4], "" if np.isnan(row[4]) else row[4], *row[5:])
            for row in np.stack([offset, depth, exact, summed, on_axis, narrow, narrow / exact], axis=-1).tolist()
        ),
        largest_error=error,
        tolerance=tolerance,
        holds=error <= tolerance,
        notes=(f"radius {_RADIUS:g} m, L = {_RADIANCE:g} W m⁻² sr⁻¹",),
    )
