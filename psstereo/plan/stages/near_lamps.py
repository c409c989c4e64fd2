"""Lamps at places near the object."""

from dataclasses import replace
from typing import ClassVar

from psstereo.capture import Capture
from psstereo.near import REFLECTANCES, wants_near
from psstereo.normals.exemplar import Exemplar
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.stage import Decision, Skip, Stage, Use, refuse

__all__ = ["NearLamps"]


class NearLamps(Stage):
    """Finds normals and depth together, since each lamp's direction and fall-off depend on the depth."""

    name: ClassVar[str] = "near lamps"
    summary: ClassVar[str] = "find normals and depth together under lamps at places"
    keys: ClassVar[tuple[str, ...]] = ("distance", "reflectance")

    def decide(self, facts: Facts) -> Use | Skip:
        """Do it where a light has a place; see :meth:`Stage.decide`."""
        if not facts.lamps:
            return Skip(reason="All lights are distant.")
        return self._use(facts, "auto")

    def whole(self, facts: Facts) -> Use | Skip:
        """Fit exemplar materials wherever the lamps are enough; see :meth:`Stage.whole`."""
        return self._use(facts, "exemplar") if facts.lamps else self.decide(facts)

    def asked(self, options: Options, facts: Facts) -> Use | Skip | None:
        """Leave it out for a solver of distant lights; take exemplars, and a distance; see :meth:`Stage.asked`."""
        if not facts.lamps:
            return None
        more = {} if options.distance is None else {"distance": options.distance}
        if isinstance(options.solver, Exemplar):
            reason = "The lights have places, and exemplar materials were asked for."
            return Use(reason=reason, figure=_lamps(facts), options={"reflectance": "exemplar", **more})
        if options.solver is not None:
            return Skip(reason="A solver for distant lights was asked for.")
        return self._use(facts, "exemplar" if options.nothing_left_out else "auto", **more) if more else None

    @staticmethod
    def _use(facts: Facts, reflectance: str, **more: float) -> Use:
        """Return what is done with as many lamps as there are."""
        least = Exemplar.least_lights
        if facts.images < least:
            reason = f"The lights have places; too few for exemplar materials, which need {least}."
            return Use(reason=reason, figure=_lamps(facts), options={"reflectance": "lambert", **more})
        reason = "The lights have places; whether the surface is matte shows when it has been found."
        if reflectance == "exemplar":
            reason = "The lights have places; exemplar materials are fitted too."
        return Use(reason=reason, figure=_lamps(facts), options={"reflectance": reflectance, **more})

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Set the distance; what the surface is taken for stays in the plan; see :meth:`Stage.apply`."""
        if decision.use and not wants_near(capture):
            raise refuse(self, "it is on, and no light of the capture has a place.")
        distance, reflectance = decision.options.get("distance"), decision.options.get("reflectance", "auto")
        if distance is not None and (isinstance(distance, bool) or not isinstance(distance, int | float)):
            raise refuse(self, f"its distance is {distance!r}.", "Use a number, in the unit of the lamps.")
        if reflectance not in REFLECTANCES:
            raise refuse(self, f"its reflectance is {reflectance!r}.", f"Use {', '.join(REFLECTANCES)}.")
        return capture, replace(options, distance=distance)


def _lamps(facts: Facts) -> str:
    return f"{facts.images} lamps"
