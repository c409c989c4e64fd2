"""Every normal solver, by name."""

from typing import Any

from psstereo.normals.ambient import AmbientLeastSquares
from psstereo.normals.bipolynomial import BiPolynomial
from psstereo.normals.bivariate import Bivariate
from psstereo.normals.exemplar import Exemplar
from psstereo.normals.least_squares import LeastSquares
from psstereo.normals.low_rank import LowRank
from psstereo.normals.response_bend import ResponseBend
from psstereo.normals.robust import Robust
from psstereo.normals.sky import SkyLeastSquares
from psstereo.normals.solver import NormalSolver
from psstereo.normals.sparse_bayesian import SparseBayesian
from psstereo.normals.trimmed import Trimmed

__all__ = ["NORMAL_SOLVERS"]

NORMAL_SOLVERS: dict[str, type[NormalSolver[Any]]] = {
    LeastSquares.name: LeastSquares,
    AmbientLeastSquares.name: AmbientLeastSquares,
    SkyLeastSquares.name: SkyLeastSquares,
    Robust.name: Robust,
    Trimmed.name: Trimmed,
    SparseBayesian.name: SparseBayesian,
    LowRank.name: LowRank,
    ResponseBend.name: ResponseBend,
    BiPolynomial.name: BiPolynomial,
    Bivariate.name: Bivariate,
    Exemplar.name: Exemplar,
}
