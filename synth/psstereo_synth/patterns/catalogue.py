"""Every albedo pattern, by name."""

from psstereo_synth.patterns.checker import Checker
from psstereo_synth.patterns.constant import Constant
from psstereo_synth.patterns.gradient import Gradient
from psstereo_synth.patterns.image import ImagePattern
from psstereo_synth.patterns.pattern import Pattern

__all__ = ["PATTERNS"]

PATTERNS: dict[str, type[Pattern]] = {
    Constant.name: Constant,
    Gradient.name: Gradient,
    Checker.name: Checker,
    ImagePattern.name: ImagePattern,
}
