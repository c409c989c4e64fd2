"""Every light, by name."""

from psstereo.lights.directional import Directional
from psstereo.lights.led import Led
from psstereo.lights.light import Light

__all__ = ["LIGHTS"]

LIGHTS: dict[str, type[Light]] = {
    Directional.name: Directional,
    Led.name: Led,
}
