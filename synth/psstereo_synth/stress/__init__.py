"""Cruel cases for every part of the library, each with a rule for passing that is fixed beforehand."""

from psstereo_synth.stress.catalogue import STRESS_FAMILIES, stress_cases
from psstereo_synth.stress.integration import grid_case

__all__ = ["STRESS_FAMILIES", "grid_case", "stress_cases"]
