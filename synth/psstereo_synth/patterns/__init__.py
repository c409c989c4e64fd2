"""Albedo patterns on surfaces."""

from psstereo_synth.patterns.catalogue import PATTERNS
from psstereo_synth.patterns.checker import Checker
from psstereo_synth.patterns.constant import Constant
from psstereo_synth.patterns.gradient import Gradient
from psstereo_synth.patterns.image import ImagePattern
from psstereo_synth.patterns.pattern import Pattern

__all__ = ["PATTERNS", "Checker", "Constant", "Gradient", "ImagePattern", "Pattern"]
