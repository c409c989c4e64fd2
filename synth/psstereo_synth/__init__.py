"""Synthetic captures with known truth, for tests, benchmarks and learning."""

from psstereo_synth.albedo import checker
from psstereo_synth.capture import expose, lambertian_capture
from psstereo_synth.demo import demo_capture
from psstereo_synth.hills import hills
from psstereo_synth.rigs import ring, spiral
from psstereo_synth.surface import Surface

__all__ = ["Surface", "checker", "demo_capture", "expose", "hills", "lambertian_capture", "ring", "spiral"]
