"""Lights: where light comes from and how much of it reaches a surface."""

from psstereo.lights.ambient import Ambient
from psstereo.lights.beam import Beam
from psstereo.lights.catalogue import LIGHTS
from psstereo.lights.directional import Directional
from psstereo.lights.disc import Disc
from psstereo.lights.environment import Environment
from psstereo.lights.harmonics import Harmonics, real_harmonics
from psstereo.lights.lat_long import lat_long_directions
from psstereo.lights.led import Led
from psstereo.lights.light import Distant, Light
from psstereo.lights.polygon import Polygon
from psstereo.lights.rig import Rig, StrengthUnit
from psstereo.lights.solar import from_azimuth, solar_declination, sun_path
from psstereo.lights.sun import Sun
from psstereo.lights.total import Total

__all__ = [
    "LIGHTS", "Ambient", "Beam", "Directional", "Disc", "Distant", "Environment", "Harmonics", "Led", "Light",
    "Polygon", "Rig", "StrengthUnit", "Sun", "Total", "from_azimuth", "lat_long_directions", "real_harmonics",
    "solar_declination", "sun_path",
]  # fmt: skip
