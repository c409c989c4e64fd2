"""Lamps near the surface: normals and metric depth, found together."""

from psstereo.near.lamps import wants_near
from psstereo.near.options import REFLECTANCES, NearOptions, NearResult, Round
from psstereo.near.solve import solve_near

__all__ = ["REFLECTANCES", "NearOptions", "NearResult", "Round", "solve_near", "wants_near"]
