"""Axis, lobe and flux of lamps from a matte board in a few poses."""

from psstereo.calibrate.lamps.board import Chessboard, board_pose, board_samples, joined
from psstereo.calibrate.lamps.calibration import LampCalibration, calibrate_lamps
from psstereo.calibrate.lamps.fit import LampFit, PlaneSamples, calibrate_lamp

__all__ = [
    "Chessboard",
    "LampCalibration",
    "LampFit",
    "PlaneSamples",
    "board_pose",
    "board_samples",
    "calibrate_lamp",
    "calibrate_lamps",
    "joined",
]
