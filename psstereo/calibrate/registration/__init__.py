"""Frames laid over one another although the light changes between them: by paint, by shading, of a whole capture."""

from psstereo.calibrate.registration.capture import registered
from psstereo.calibrate.registration.frames import Registration, register_frames

__all__ = [
    "Registration",
    "register_frames",
    "registered",
]
