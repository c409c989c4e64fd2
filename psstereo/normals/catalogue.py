"""Every normal solver, by name."""

from typing import Any

from psstereo.normals.least_squares import LeastSquares
from psstereo.normals.solver import NormalSolver

__all__ = ["NORMAL_SOLVERS"]

NORMAL_SOLVERS: dict[str, type[NormalSolver[Any]]] = {
    LeastSquares.name: LeastSquares,
}
