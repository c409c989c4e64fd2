"""Which solver the facts speak for; the one place where this is decided."""

from dataclasses import dataclass

from psstereo.normals import LeastSquares, Robust
from psstereo.normals.ambient import AmbientLeastSquares
from psstereo.normals.trimmed import Trimmed
from psstereo.plan.contestants import CONTESTANTS, lambert_holds
from psstereo.plan.facts import Facts
from psstereo.plan.trials import Trial

__all__ = ["Choice", "choose_by_facts"]

_AS_GOOD = 1.05
"""Ratio of changes up to which the quicker solver is taken."""
_NOTHING = 0.02
"""Difference of changes that never matters [deg]."""
_FOLLOWS = 2.0
"""Factor on the change of solvers that follow every observation, where Lambert's law is broken: what pulls them has a
part that all choices of lights share and that no change shows; it is taken for as large as what shows."""
_CUTS = 1.5
"""The same for the one that cuts brightness off at fixed ranks, which follows half of them."""
_FACTORS = {LeastSquares.name: _FOLLOWS, AmbientLeastSquares.name: _FOLLOWS, Trimmed.name: _CUTS}


@dataclass(frozen=True, kw_only=True)
class Choice:
    """A solver and why.

    Attributes
    ----------
    solver : str
        Its name.
    reason : str
        Why, as a sentence.
    figure : str
        What it rests on.
    """

    solver: str
    reason: str
    figure: str = ""


def choose_by_facts(facts: Facts) -> Choice:
    """Choose the quickest solver that does as well as the best of those tried.

    Parameters
    ----------
    facts : Facts
        The facts.

    Returns
    -------
    Choice
        The solver's name, and why.
    """
    if facts.images < Robust.pays_from:
        few = f"With fewer than {Robust.pays_from} lights a robust fit outvotes good observations."
        return Choice(solver=LeastSquares.name, reason=few, figure=f"{facts.images} lights")
    if not facts.trials:
        if facts.misfit is not None and lambert_holds(facts.misfit, facts.bright_outliers):
            reason = "Residuals of Lambert's law are noise; least squares without shadows is as good as anything."
            return Choice(solver=LeastSquares.name, reason=reason, figure=f"broken at {facts.misfit:.1%} of the pixels")
        many = f"Nothing was tried; {facts.images} lights are enough to leave highlights and shadows out."
        return Choice(solver=Robust.name, reason=many, figure=f"{facts.images} lights")
    doubts = {one.solver: one.change_deg * _FACTORS.get(one.solver, 1.0) for one in facts.trials}
    best = min(facts.trials, key=lambda one: doubts[one.solver])
    least = doubts[best.solver]
    limit = max(_AS_GOOD * least, least + _NOTHING, least + best.error_deg)
    taken = next(one for one in _by_cost(facts) if doubts[one.solver] <= limit)
    reason = f"Of {len(facts.trials)} solvers tried, {taken.solver} changes least when lights are taken away"
    reason += "." if taken is best else ", or so little more that the quicker one is as good."
    others = ", ".join(f"{one.solver} {one.change_deg:.2g}°" for one in _by_cost(facts) if one is not taken)
    return Choice(solver=taken.solver, reason=reason, figure=f"{taken.change_deg:.2g}° ({others})")


def _by_cost(facts: Facts) -> list[Trial]:
    """Return the trials, the quickest solver first."""
    order = [kind.name for kind in CONTESTANTS]
    return sorted(facts.trials, key=lambda one: order.index(one.solver) if one.solver in order else len(order))
