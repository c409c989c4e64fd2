"""Normals and albedo from brightness under several lights."""

from psstereo.normals.catalogue import NORMAL_SOLVERS
from psstereo.normals.default import DefaultSolver, default_solver
from psstereo.normals.estimate import estimate_normals
from psstereo.normals.gate import GATES, Gate, gate
from psstereo.normals.least_squares import LeastSquares
from psstereo.normals.robust import Robust
from psstereo.normals.solver import NormalSolver, PixelNormals, Samples
from psstereo.normals.verdict import OUTSIDE, Verdict

__all__ = [
    "GATES",
    "NORMAL_SOLVERS",
    "OUTSIDE",
    "DefaultSolver",
    "Gate",
    "LeastSquares",
    "NormalSolver",
    "PixelNormals",
    "Robust",
    "Samples",
    "Verdict",
    "default_solver",
    "estimate_normals",
    "gate",
]
