"""Lights from balls: outlines, highlights on mirrors, shading of matte ones, and where several balls see a lamp."""

from psstereo.calibrate.balls.ball import Ball
from psstereo.calibrate.balls.highlight import Highlight, find_highlight
from psstereo.calibrate.balls.matte_ball import MatteCalibration, calibrate_matte_balls
from psstereo.calibrate.balls.mirror_calibration import MirrorCalibration, calibrate_mirror_balls
from psstereo.calibrate.balls.outline import ball_from_mask, ball_from_points, refine_outline
from psstereo.calibrate.balls.pictures import BallPictures
from psstereo.calibrate.balls.search import find_balls
from psstereo.calibrate.balls.triangulate import Reach, Triangulation, triangulate_lamps

__all__ = [
    "Ball",
    "BallPictures",
    "Highlight",
    "MatteCalibration",
    "MirrorCalibration",
    "Reach",
    "Triangulation",
    "ball_from_mask",
    "ball_from_points",
    "calibrate_matte_balls",
    "calibrate_mirror_balls",
    "find_balls",
    "find_highlight",
    "refine_outline",
    "triangulate_lamps",
]
