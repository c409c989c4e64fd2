"""Lights: where light comes from and how much of it reaches a surface."""

from psstereo.lights.beam import Beam
from psstereo.lights.catalogue import LIGHTS
from psstereo.lights.directional import Directional
from psstereo.lights.led import Led
from psstereo.lights.light import Distant, Light
from psstereo.lights.rig import Rig, StrengthUnit

__all__ = ["LIGHTS", "Beam", "Directional", "Distant", "Led", "Light", "Rig", "StrengthUnit"]
