"""Every check, by name, in the order in which they are made."""

from psstereo.plan.diagnosis.ambient import AmbientLeft
from psstereo.plan.diagnosis.axes import LightAxes, LightDepth
from psstereo.plan.diagnosis.background import Background
from psstereo.plan.diagnosis.black import ClippedBlack, CoarseSteps
from psstereo.plan.diagnosis.check import Check
from psstereo.plan.diagnosis.cone import LightCone
from psstereo.plan.diagnosis.duplicates import DuplicateImage, DuplicateLight
from psstereo.plan.diagnosis.failed import FailedFlash
from psstereo.plan.diagnosis.light_order import LightOrder
from psstereo.plan.diagnosis.motion import Moved
from psstereo.plan.diagnosis.near_light import NearLight
from psstereo.plan.diagnosis.response import ResponseLeft
from psstereo.plan.diagnosis.saturation import Saturated
from psstereo.plan.diagnosis.strengths import UnequalStrengths

__all__ = ["CHECKS"]

CHECKS: dict[str, type[Check]] = {
    check.name: check
    for check in (
        LightCone,
        Saturated,
        FailedFlash,
        DuplicateImage,
        DuplicateLight,
        CoarseSteps,
        Background,
        LightOrder,
        LightAxes,
        LightDepth,
        UnequalStrengths,
        ResponseLeft,
        NearLight,
        AmbientLeft,
        ClippedBlack,
        Moved,
    )
}
"""Those that need no fit come first, then order and axes of the lights, then causes that are read from a fit."""
