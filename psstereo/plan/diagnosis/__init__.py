"""What is the matter with a capture: one check a file, each with its figure and its remedy."""

from psstereo.plan.diagnosis.catalogue import CHECKS
from psstereo.plan.diagnosis.check import Check
from psstereo.plan.diagnosis.diagnose import diagnose
from psstereo.plan.diagnosis.finding import Finding, Severity
from psstereo.plan.diagnosis.motion_probe import MotionProbe

__all__ = ["CHECKS", "Check", "Finding", "MotionProbe", "Severity", "diagnose"]
