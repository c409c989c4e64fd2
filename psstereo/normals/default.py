"""Which solver is used where nobody chose one."""

from dataclasses import dataclass
from typing import Any

from psstereo.lights import Rig
from psstereo.normals.least_squares import LeastSquares
from psstereo.normals.robust import Robust
from psstereo.normals.solver import NormalSolver

__all__ = ["DefaultSolver", "default_solver"]


@dataclass(frozen=True, kw_only=True)
class DefaultSolver:
    """A choice and its reason.

    Attributes
    ----------
    solver : NormalSolver
        The method, with its own defaults.
    reason : str
        Why this one, as a sentence.
    """

    solver: NormalSolver[Any]
    reason: str


def default_solver(rig: Rig) -> DefaultSolver:
    """Choose a solver for a rig; the one place where this is decided.

    Parameters
    ----------
    rig : Rig
        The lights.

    Returns
    -------
    DefaultSolver
        The solver, and why.

    Examples
    --------
    >>> from psstereo.lights import Rig
    >>> default_solver(Rig.distant([[0, 0, 1], [1, 0, 1], [0, 1, 1]])).solver.name
    'least-squares'
    """
    count = len(rig)
    if count < Robust.pays_from:
        few = f"No solver was named; with fewer than {Robust.pays_from} lights a robust fit outvotes good observations."
        return DefaultSolver(solver=LeastSquares(), reason=few)
    many = f"No solver was named; {count} lights are enough to leave highlights and shadows out."
    return DefaultSolver(solver=Robust(), reason=many)
