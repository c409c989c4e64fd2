"""Every fault, by name."""

from psstereo_synth.faults.ambient_leak import AmbientLeak
from psstereo_synth.faults.blur import Blur
from psstereo_synth.faults.dead_pixels import DeadPixels
from psstereo_synth.faults.duplicate import Duplicate
from psstereo_synth.faults.fault import Fault
from psstereo_synth.faults.flicker import Flicker
from psstereo_synth.faults.light_error import LightError
from psstereo_synth.faults.motion import Motion
from psstereo_synth.faults.wrong_order import WrongOrder

__all__ = ["FAULTS"]

FAULTS: dict[str, type[Fault]] = {
    kind.name: kind for kind in (Motion, WrongOrder, LightError, Duplicate, DeadPixels, AmbientLeak, Blur, Flicker)
}
