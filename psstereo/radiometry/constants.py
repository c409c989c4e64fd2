"""Numbers of nature, each with its source."""

import math

__all__ = ["FULL_SPHERE", "HEMISPHERE", "SOLAR_CONSTANT", "SUN_ANGULAR_RADIUS", "SUN_RADIANCE", "SUN_SOLID_ANGLE"]

FULL_SPHERE = 4.0 * math.pi
"""Solid angle of all directions [sr]."""

HEMISPHERE = 2.0 * math.pi
"""Solid angle of all directions above a plane [sr]."""

SUN_ANGULAR_RADIUS = math.asin(6.957e8 / 1.495978707e11)
"""Half-angle of the sun's disc from the mean distance of the earth, about 4.6505e-3, a quarter of a degree [rad].

Nominal solar radius 6.957e8 m (IAU 2015 resolution B3, doi:10.3847/0004-6256/152/2/41) over one astronomical unit,
149 597 870 700 m (IAU 2012 resolution B2). It varies by ±1.7 % over the year.
"""

SUN_SOLID_ANGLE = 6.8e-5
"""Solid angle of the sun's disc, 4π sin²(SUN_ANGULAR_RADIUS / 2) = 6.794e-5 rounded to two figures [sr]."""

SOLAR_CONSTANT = 1361.0
"""Irradiance from the sun above the air, facing it, at one astronomical unit [W m⁻²].

Kopp and Lean (2011): 1360.8 ± 0.5, doi:10.1029/2010GL045777.
"""

SUN_RADIANCE = SOLAR_CONSTANT / SUN_SOLID_ANGLE
"""Mean radiance of the sun's disc above the air, about 2.0e7; air takes some of it away [W m⁻² sr⁻¹]."""
