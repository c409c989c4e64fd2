"""The sun's lights from date, time and place; how the camera stood; whether the clock is right; the sky beside it."""

from psstereo.calibrate.sun.calibration import SunCalibration, calibrate_sun
from psstereo.calibrate.sun.clock import ClockCheck, check_clock, facing_of_mask
from psstereo.calibrate.sun.cone import SunCone, judge_cone
from psstereo.calibrate.sun.position import Place, SunPositions, clear_sky_strength, sun_positions
from psstereo.calibrate.sun.rotation import ShadowedPole, rotation_from_heading, rotation_from_pole
from psstereo.calibrate.sun.sky import SkyEstimate, SkyOptions, estimate_sky
from psstereo.calibrate.sun.time_from_exif import parse_zone, place_of, time_of

__all__ = [
    "ClockCheck",
    "Place",
    "ShadowedPole",
    "SkyEstimate",
    "SkyOptions",
    "SunCalibration",
    "SunCone",
    "SunPositions",
    "calibrate_sun",
    "check_clock",
    "clear_sky_strength",
    "estimate_sky",
    "facing_of_mask",
    "judge_cone",
    "parse_zone",
    "place_of",
    "rotation_from_heading",
    "rotation_from_pole",
    "sun_positions",
    "time_of",
]
