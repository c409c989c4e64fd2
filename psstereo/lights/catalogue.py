"""Every light, by name."""

from psstereo.lights.ambient import Ambient
from psstereo.lights.directional import Directional
from psstereo.lights.disc import Disc
from psstereo.lights.environment import Environment
from psstereo.lights.harmonics import Harmonics
from psstereo.lights.led import Led
from psstereo.lights.light import Light
from psstereo.lights.polygon import Polygon
from psstereo.lights.sun import Sun
from psstereo.lights.total import Total

__all__ = ["LIGHTS"]

LIGHTS: dict[str, type[Light]] = {
    Directional.name: Directional,
    Led.name: Led,
    Sun.name: Sun,
    Disc.name: Disc,
    Polygon.name: Polygon,
    Ambient.name: Ambient,
    Harmonics.name: Harmonics,
    Environment.name: Environment,
    Total.name: Total,
}
