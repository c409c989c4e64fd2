"""Integrating normals to depth."""

from dataclasses import replace
from typing import ClassVar

from psstereo.capture import Capture
from psstereo.catalogue import choose
from psstereo.depth import INTEGRATORS, Poisson
from psstereo.plan.facts import Facts
from psstereo.plan.options import AUTO, Options
from psstereo.plan.stage import Decision, Skip, Stage, Use, refuse
from psstereo.plan.stages.models import read_settings, written_settings

__all__ = ["Depth"]


class Depth(Stage):
    """Finds the surface that has the normals."""

    name: ClassVar[str] = "depth"
    summary: ClassVar[str] = "integrate normals to depth"
    keys: ClassVar[tuple[str, ...]] = ("integrator", "settings")

    def decide(self, facts: Facts) -> Use | Skip:
        """Do it; see :meth:`Stage.decide`."""
        return Use(
            reason=f"The mask has {facts.components} piece{'' if facts.components == 1 else 's'}.",
            figure=f"{facts.pixels} pixels",
            options={"integrator": Poisson.name},
        )

    def asked(self, options: Options, facts: Facts) -> Use | Skip | None:
        """Return a named integrator, or none; see :meth:`Stage.asked`."""
        del facts
        if options.integrator == AUTO:
            return None
        if options.integrator is None:
            return Skip(reason="Only normals were asked for.")
        assert not isinstance(options.integrator, str)
        settings = written_settings(options.integrator)
        more = {"settings": settings} if settings else {}
        return Use(reason="Asked for.", options={"integrator": options.integrator.name, **more})

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Set the integrator; see :meth:`Stage.apply`."""
        if not decision.use:
            return capture, replace(options, integrator=None)
        kind = choose(INTEGRATORS, str(decision.options.get("integrator", Poisson.name)), "integrator")
        settings = decision.options.get("settings", {})
        if not isinstance(settings, dict):
            raise refuse(self, f"its settings are {settings!r}.", "Use an object of options by name.")
        built = read_settings(self, kind, settings) if settings else kind()
        return capture, replace(options, integrator=replace(built, threads=options.workers))
