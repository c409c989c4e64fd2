"""Metrics: how far a result is from the truth, and whether it can be a surface at all."""

from psstereo.metrics.albedo import AlbedoError, albedo_error
from psstereo.metrics.angular import AngularSummary, ShortTruth, angular_error, summarise_angles
from psstereo.metrics.coverage import Coverage, confidence_angle, coverage
from psstereo.metrics.height import ALIGNMENTS, HeightError, height_error
from psstereo.metrics.integrability import Integrability, integrability

__all__ = [
    "ALIGNMENTS",
    "AlbedoError",
    "AngularSummary",
    "Coverage",
    "HeightError",
    "Integrability",
    "ShortTruth",
    "albedo_error",
    "angular_error",
    "confidence_angle",
    "coverage",
    "height_error",
    "integrability",
    "summarise_angles",
]
