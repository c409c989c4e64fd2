"""The sun as a light: its radiance, its solid angle, and how it sets."""

import numpy as np

from psstereo.lights import Sun
from psstereo.radiometry import (
    SOLAR_CONSTANT,
    SUN_ANGULAR_RADIUS,
    SUN_SOLID_ANGLE,
    cap_solid_angle,
    sun_irradiance,
    sun_radiance,
)
from psstereo_synth.lecture.example import Example
from psstereo_synth.lecture.statements import STATEMENTS

__all__ = ["sun"]

_ELEVATIONS = (90.0, 60.0, 30.0, 10.0, 1.0, 0.5, 0.27, 0.2, 0.1, 0.0, -0.1, -0.2, -0.27)
"""Of the middle of the sun's disc over level ground [deg]."""


def sun() -> Example:
    """Compute the irradiance from the sun as a direction, and as the disc that it is.

    *Statement.* From the earth the sun is a disc of half-angle a ≈ 0.27°, and fills Ω_sun = 4π sin²(a/2) = 6.8e-5 sr.
    It gives 1361 W m⁻² above the air, so its mean radiance is L_sun = 1361 / Ω_sun = 2.0e7 W m⁻² sr⁻¹. Ground with the
    normal n gets E = L_sun Ω_sun n·l, l being the direction to the middle of the disc: it is so small that the mean of
    n·l over it is that of its middle.

    *Where it stops being true.* In the half degree in which the disc crosses the ground's horizon: with its middle on
    the horizon the upper half still gives (2/3) a³ L, about 1.3 W m⁻², where n·l says none. Elsewhere L Ω n·l is too
    large by tan²(a/2) = 5e-6, since the disc is not quite a point. On a slope this happens at any hour of the
    day: the horizon that counts is that of the surface. Air and the disc's darker rim are left out.

    Returns
    -------
    Example
        The error is that of L Ω n·l, relative to the exact irradiance, where the whole disc is above the horizon.
    """
    solid = float(cap_solid_angle(SUN_ANGULAR_RADIUS))
    up = np.array([0.0, 0.0, 1.0])
    level = float(sun_radiance(SOLAR_CONSTANT, up, up, solid_angle=solid))
    angle = np.deg2rad(_ELEVATIONS)
    toward = np.stack([np.cos(angle), np.zeros_like(angle), np.sin(angle)], axis=-1)
    narrow = sun_irradiance(level, up, toward, solid_angle=solid)
    exact = np.array(
        [
            float(Sun(direction=way, radiance=np.array([level])).irradiance(np.zeros((1, 3)), up[None])[0, 0])
            for way in toward
        ]
    )
    whole = angle >= SUN_ANGULAR_RADIUS
    error = float(np.max(np.abs(narrow[whole] / exact[whole] - 1.0)))
    tolerance = 1e-5
    return Example(
        title="The sun",
        statement=STATEMENTS["sun"],
        columns=("elevation [deg]", "n·l [1]", "L Ω n·l [W m⁻²]", "disc, exact [W m⁻²]", "missing [W m⁻²]"),
        rows=tuple(
            zip(
                _ELEVATIONS,
                np.sin(angle).tolist(),
                narrow.tolist(),
                exact.tolist(),
                (exact - narrow).tolist(),
                strict=True,
            )
        ),
        largest_error=error,
        tolerance=tolerance,
        holds=error <= tolerance,
        notes=(
            f"a = {np.rad2deg(SUN_ANGULAR_RADIUS):.4f}°, Ω_sun = {solid:.3e} sr ({SUN_SOLID_ANGLE:.1e} to two figures)",
            f"L_sun = {SOLAR_CONSTANT:g} / Ω_sun = {level:.3e} W m⁻² sr⁻¹",
        ),
    )
