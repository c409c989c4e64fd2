"""Finding or refining the directions of the lights."""

from dataclasses import asdict, replace
from typing import Any, ClassVar

from psstereo.capture import Capture
from psstereo.normals.light_choice import LightChoice, LightSource
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.stage import Decision, Skip, Stage, Use, refuse

__all__ = ["LightDirections"]


class LightDirections(Stage):
    """Takes the directions of the lights from the images."""

    name: ClassVar[str] = "light directions"
    summary: ClassVar[str] = "refine the lights' directions, or find them"
    keys: ClassVar[tuple[str, ...]] = ("source", "ambiguity", "relief", "doubt")

    def decide(self, facts: Facts) -> Use | Skip:
        """Leave them as they are; see :meth:`Stage.decide`."""
        cone = "" if facts.cone_deg is None else f"cone of {facts.cone_deg:.0f}°"
        return Skip(reason="The directions of the capture were taken as they are.", figure=cone)

    def asked(self, options: Options, facts: Facts) -> Use | Skip | None:
        """Return a choice other than the given lights; see :meth:`Stage.asked`."""
        del facts
        if options.lights.source is LightSource.GIVEN:
            return None
        words = {key: value for key, value in asdict(options.lights).items() if value is not None}
        return Use(reason="Asked for.", options={**words, "source": options.lights.source.value})

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Set the choice; see :meth:`Stage.apply`."""
        if not decision.use:
            return capture, replace(options, lights=LightChoice())
        given: dict[str, Any] = dict(decision.options)
        sources = {one.value: one for one in LightSource if one is not LightSource.GIVEN}
        if given.get("source") not in sources:
            raise refuse(self, f"its source is {given.get('source')!r}.", f"Use {' or '.join(sources)}.")
        doubt = given.get("doubt")
        if doubt is not None and not (isinstance(doubt, float) and doubt > 0):
            raise refuse(self, f"its doubt is {doubt!r}.", "Use radians above 0, with a decimal point.")
        return capture, replace(options, lights=LightChoice(**{**given, "source": sources[given["source"]]}))
