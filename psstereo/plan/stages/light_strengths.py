"""Finding or checking the strengths of the lights."""

from dataclasses import replace
from typing import ClassVar

from psstereo.capture import Capture
from psstereo.normals.strength_choice import StrengthChoice
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.stage import Decision, Skip, Stage, Use, refuse

__all__ = ["LightStrengths"]


class LightStrengths(Stage):
    """Takes the strengths of the lights from the images, or compares them with what the images tell."""

    name: ClassVar[str] = "light strengths"
    summary: ClassVar[str] = "find, check or equalise the lights' strengths"
    keys: ClassVar[tuple[str, ...]] = ("choice",)

    def decide(self, facts: Facts) -> Use | Skip:
        """Leave them as they are; see :meth:`Stage.decide`."""
        ratio = "" if facts.strength_ratio is None else f"{facts.strength_ratio:.3g} : 1"
        return Skip(reason="The strengths of the capture were taken as they are.", figure=ratio)

    def asked(self, options: Options, facts: Facts) -> Use | Skip | None:
        """Return a choice other than the given strengths; see :meth:`Stage.asked`."""
        del facts
        if options.strengths is StrengthChoice.GIVEN:
            return None
        return Use(reason="Asked for.", options={"choice": options.strengths.value})

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Set the choice; see :meth:`Stage.apply`."""
        if not decision.use:
            return capture, replace(options, strengths=StrengthChoice.GIVEN)
        choices = {one.value: one for one in StrengthChoice if one is not StrengthChoice.GIVEN}
        named = decision.options.get("choice")
        if named not in choices:
            raise refuse(self, f"its choice is {named!r}.", f"Use {', '.join(choices)}.")
        return capture, replace(options, strengths=choices[named])
