"""Which solver the facts speak for; the one place where this is decided."""

from dataclasses import dataclass

from psstereo.normals import LeastSquares, Robust
from psstereo.normals.ambient import AmbientLeastSquares
from psstereo.normals.exemplar import Exemplar
from psstereo.normals.response_bend import ResponseBend
from psstereo.plan.contestants import CONTESTANTS, lambert_holds
from psstereo.plan.facts import Facts
from psstereo.plan.trials import Trial

__all__ = ["Choice", "choose_by_facts", "choose_whole"]

_AS_GOOD = 1 / 3
"""Angle to the normals of the richest solver, over that one's doubt, up to which a quicker solver is taken: with an
error of that size beside it, and in no direction of its own, the mean error grows by a twentieth [1]."""
_ALIKE = 0.6
"""The same up to which doubts are compared as they are: little is lost with either, and of two that are so alike the
steadier one has more often the very law of the surface [1]."""
_NOTHING = 0.001
"""Difference of doubts, or of normals, that never matters [deg]."""
_FOLLOWS = 1.4
"""Factor on the doubt of solvers that follow every observation, where Lambert's law is broken: what pulls them is
smooth, so that their normals move little whatever lights are taken away."""
_RICH = 0.5
"""The same for the solver whose reflectance is as rich as that by which solvers are compared: where Lambert's law is
broken it is the nearest to the truth nearly always, so that another one must seem twice as good."""
_FACTORS = {LeastSquares.name: _FOLLOWS, AmbientLeastSquares.name: _FOLLOWS, Exemplar.name: _RICH}


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
    """Choose the best of the solvers tried, or a quicker one with nearly the same normals.

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
    if [one.solver for one in facts.trials] == [AmbientLeastSquares.name]:
        level = "" if facts.ambient is None else f"level {facts.ambient:.2%} of the albedo"
        reason = "With a level of its own at each pixel, residuals of Lambert's law are noise; no solver does better."
        return Choice(solver=AmbientLeastSquares.name, reason=reason, figure=level)
    return _best(facts)


def _best(facts: Facts) -> Choice:
    """Choose among several trials."""
    trials = _by_cost(facts)
    doubts = {one.solver: one.doubt_deg * _FACTORS.get(one.solver, 1.0) for one in trials}
    least = min(doubts.values())
    best = next(one for one in trials if doubts[one.solver] <= least + _NOTHING)
    taken = next((one for one in trials if _beside(one, best, _AS_GOOD)), best)
    if taken is best and best.solver == Exemplar.name:
        plain = doubts | {best.solver: best.doubt_deg}
        taken = best = min((one for one in trials if _beside(one, best, _ALIKE)), key=lambda one: plain[one.solver])
    if best.doubt_deg <= min(one.doubt_deg for one in trials) + _NOTHING:
        reason = f"Of {len(trials)} solvers tried, {best.solver} is the steadiest and explains most"
    else:
        reason = f"Of {len(trials)} solvers tried, none outdoes {best.solver} by as much as it would have to"
    reason += "." if taken is best else f", and the normals of {taken.solver}, which is quicker, are nearly the same."
    others = ", ".join(f"{one.solver} {one.doubt_deg:.2g}°" for one in trials if one is not taken)
    return Choice(solver=taken.solver, reason=reason, figure=f"{taken.doubt_deg:.2g}° ({others})")


def _beside(one: Trial, best: Trial, share: float) -> bool:
    """Return whether a solver's normals are within a share of the best one's doubt of its normals, as far as known."""
    if one is best:
        return True
    if best.beside_deg is not None or one.beside_deg is None:  # only angles to the richest one are told
        return False
    return one.beside_deg <= max(share * best.doubt_deg, _NOTHING)


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
