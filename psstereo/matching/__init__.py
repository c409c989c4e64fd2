"""Matching between views: a matte point keeps its brightness when the camera moves, and so says where it is."""

from psstereo.matching.constancy import Constancy, brightness_constancy, compare_values, pair_constancy
from psstereo.matching.disparity import Disparity, fill_from_behind
from psstereo.matching.failures import FailureReport, failure_report
from psstereo.matching.flags import MATCH_SENTENCES, MatchFlag, count_match_flags
from psstereo.matching.geometry import CalibratedView, covisible, rectified_views
from psstereo.matching.images import ViewImages
from psstereo.matching.inputs import PairCalibration, read_disparity, read_pair_calibration, read_view_list
from psstereo.matching.noise import Noise
from psstereo.matching.prior import crossover, prior_from_disparity, reject_by_surface
from psstereo.matching.rectified import RectifiedMatcher
from psstereo.matching.score import disparity_score, visible_in_right
from psstereo.matching.smoothing import Smoothing
from psstereo.matching.sweep import PlaneSweep, SweptDepth, agreeing_views, inside_box, nearest_views

__all__ = [
    "MATCH_SENTENCES",
    "CalibratedView",
    "Constancy",
    "Disparity",
    "FailureReport",
    "MatchFlag",
    "Noise",
    "PairCalibration",
    "PlaneSweep",
    "RectifiedMatcher",
    "Smoothing",
    "SweptDepth",
    "ViewImages",
    "agreeing_views",
    "brightness_constancy",
    "compare_values",
    "count_match_flags",
    "covisible",
    "crossover",
    "disparity_score",
    "failure_report",
    "fill_from_behind",
    "inside_box",
    "nearest_views",
    "pair_constancy",
    "prior_from_disparity",
    "read_disparity",
    "read_pair_calibration",
    "read_view_list",
    "rectified_views",
    "reject_by_surface",
    "visible_in_right",
]
