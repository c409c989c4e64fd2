"""What goes wrong in captures, each thing apart and by a known amount."""

from psstereo_synth.faults.ambient_leak import AmbientLeak
from psstereo_synth.faults.apply import apply_order, apply_radiance, apply_rig, apply_values
from psstereo_synth.faults.blur import Blur
from psstereo_synth.faults.catalogue import FAULTS
from psstereo_synth.faults.dead_pixels import DeadPixels
from psstereo_synth.faults.duplicate import Duplicate
from psstereo_synth.faults.fault import Draws, Fault
from psstereo_synth.faults.flicker import Flicker
from psstereo_synth.faults.light_error import LightError
from psstereo_synth.faults.motion import Motion
from psstereo_synth.faults.wrong_order import WrongOrder

__all__ = [
    "FAULTS",
    "AmbientLeak",
    "Blur",
    "DeadPixels",
    "Draws",
    "Duplicate",
    "Fault",
    "Flicker",
    "LightError",
    "Motion",
    "WrongOrder",
    "apply_order",
    "apply_radiance",
    "apply_rig",
    "apply_values",
]
