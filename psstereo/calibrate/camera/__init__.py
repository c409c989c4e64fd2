"""What the camera does to the light: its matrix and lens from boards, its flat field from a white card."""

from psstereo.calibrate.camera.flat_field import FlatFit, flat_from_frames
from psstereo.calibrate.camera.lens_target import Board, LensFit, find_corners, lens_from_corners, lens_from_pictures

__all__ = [
    "Board",
    "FlatFit",
    "LensFit",
    "find_corners",
    "flat_from_frames",
    "lens_from_corners",
    "lens_from_pictures",
]
