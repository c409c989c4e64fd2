"""Normals and albedo from brightness under several lights."""

from psstereo.normals.catalogue import NORMAL_SOLVERS
from psstereo.normals.estimate import estimate_normals
from psstereo.normals.gate import GATES, Gate, gate
from psstereo.normals.least_squares import LeastSquares
from psstereo.normals.solver import NormalSolver, PixelNormals, Samples

__all__ = [
    "GATES",
    "NORMAL_SOLVERS",
    "Gate",
    "LeastSquares",
    "NormalSolver",
    "PixelNormals",
    "Samples",
    "estimate_normals",
    "gate",
]
