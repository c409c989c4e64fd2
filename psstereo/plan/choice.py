"""Which solver the facts speak for; the one place where this is decided."""

from dataclasses import dataclass

from psstereo.normals import LeastSquares, Robust
from psstereo.normals.ambient import AmbientLeastSquares
from psstereo.normals.exemplar import Exemplar
from psstereo.normals.response_bend import ResponseBend
from psstereo.normals.trimmed import Trimmed
from psstereo.plan.contestants import CONTESTANTS, lambert_holds
from psstereo.plan.facts import Facts
from psstereo.plan.trials import Trial

__all__ = ["Choice", "choose_by_facts", "choose_whole"]

_AS_GOOD = 1.05
"""Ratio of doubts up to which the quicker solver is taken."""
_NOTHING = 0.001
"""Difference of doubts that never matters [deg]."""
_FOLLOWS = 1.4
"""Factor on the doubt of solvers that follow every observation, where Lambert's law is broken: what pulls them is
smooth, so that their normals move little whatever lights are taken away."""
_CUTS = 1.2
"""The same for the one that cuts brightness off at fixed ranks, which follows half of them."""
_RICH = 0.8
"""The same for the solver whose reflectance is as rich as that by which solvers are compared: of two that seem as good
it is the nearer one more often."""
_FACTORS = {
    LeastSquares.name: _FOLLOWS,
    AmbientLeastSquares.name: _FOLLOWS,
    Trimmed.name: _CUTS,
    Exemplar.name: _RICH,
}


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
    doubts = {one.solver: one.doubt_deg * _FACTORS.get(one.solver, 1.0) for one in facts.trials}
    best = min(facts.trials, key=lambda one: doubts[one.solver])
    limit = max(_AS_GOOD * doubts[best.solver], doubts[best.solver] + _NOTHING)
    taken = next(one for one in _by_cost(facts) if doubts[one.solver] <= limit)
    reason = f"Of {len(facts.trials)} solvers tried, {taken.solver} is the steadiest and explains most"
    reason += "." if taken is best else ", or so nearly that the quicker one is as good."
    others = ", ".join(f"{one.solver} {one.doubt_deg:.2g}°" for one in _by_cost(facts) if one is not taken)
    return Choice(solver=taken.solver, reason=reason, figure=f"{taken.doubt_deg:.2g}° ({others})")


def choose_whole(facts: Facts) -> Choice:
    """Choose the solver of a run that leaves nothing out.

    Where the facts speak for another solver than least squares none of its corrections is left out, and it stays; its
    rivals answer the same question otherwise and are no corrections of it.

    Parameters
    ----------
    facts : Facts
        The facts.

    Returns
    -------
    Choice
        That of the facts, or the richest solver that the lights are enough for in the place of least squares.
    """
    choice = choose_by_facts(facts)
    if choice.solver != LeastSquares.name:
        return choice
    for kind in (ResponseBend, Robust):
        if facts.images >= kind.pays_from:
            reason = "Nothing was to be left out, and it leaves out highlights and shadows."
            return Choice(solver=kind.name, reason=reason, figure=choice.figure)
    return choice


def _by_cost(facts: Facts) -> list[Trial]:
    """Return the trials, the quickest solver first."""
    order = [kind.name for kind in CONTESTANTS]
    return sorted(facts.trials, key=lambda one: order.index(one.solver) if one.solver in order else len(order))
