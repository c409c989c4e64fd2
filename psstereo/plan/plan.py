"""Plans: what is done with a capture and what is left out, each with its reason; made by the facts alone."""

from collections.abc import Sequence
from dataclasses import dataclass

from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.predict import Prediction
from psstereo.plan.stage import Decision, Skip, Use
from psstereo.plan.stages.catalogue import STAGES

__all__ = ["Plan", "make_plan"]


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is done with a capture.

    Attributes
    ----------
    facts : Facts
        What it rests on.
    decisions : tuple of Decision
        One a stage, in the order of :data:`psstereo.plan.stages.catalogue.STAGES`.
    prediction : Prediction or None
        What it will cost, if that was predicted.
    """

    facts: Facts
    decisions: tuple[Decision, ...]
    prediction: Prediction | None = None

    def __getitem__(self, stage: str) -> Decision:
        """Return the decision about a stage."""
        return next(one for one in self.decisions if one.stage == stage)

    def explain(self) -> Sequence[tuple[str, str, str, str]]:
        """Return rows for a table: stage, what is done, figure, reason."""
        return [(one.stage, _how(one), one.figure, one.reason) for one in self.decisions]


def make_plan(facts: Facts, options: Options | None = None) -> Plan:
    """Decide about every stage; pure, and of the options only what was asked for explicitly matters.

    Parameters
    ----------
    facts : Facts
        From :func:`psstereo.plan.survey.survey`.
    options : Options, optional
        What was asked for; it goes before what the facts say.

    Returns
    -------
    Plan
        The plan.
    """
    wanted = options or Options()
    decisions = []
    for stage in STAGES.values():
        found = stage.asked(wanted, facts)
        if found is None:
            found = stage.whole(facts) if wanted.nothing_left_out else stage.decide(facts)
        decisions.append(_decision(stage.name, found))
    return Plan(facts=facts, decisions=tuple(decisions))


def _decision(stage: str, found: Use | Skip) -> Decision:
    if isinstance(found, Skip):
        return Decision(stage=stage, use=False, reason=found.reason, figure=found.figure)
    return Decision(stage=stage, use=True, reason=found.reason, figure=found.figure, options=found.options)


def _how(decision: Decision) -> str:
    if not decision.use:
        return "left out"
    named = [str(one) for one in decision.options.values() if not isinstance(one, dict)]
    return ", ".join(named) or "done"
