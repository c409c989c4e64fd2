"""Integrating across cliffs."""

from dataclasses import replace
from typing import ClassVar

from psstereo.capture import Capture
from psstereo.depth import Discontinuity, Poisson
from psstereo.plan.facts import Facts
from psstereo.plan.options import AUTO, Options
from psstereo.plan.stage import Decision, Skip, Stage, Use, refuse

__all__ = ["Discontinuities"]

_MANY = 0.0018
"""Share of the pairs of pixels that turn at once from which cliffs are suspected; noise near outlines makes a few. At
cliffs the depth is up to ten times nearer to the truth then, and on smooth surfaces hardly worse. Where no pair turns,
the plain integrator is a fifth better on noisy smooth surfaces, and cliffs that the normals hide are lost to both."""


class Discontinuities(Stage):
    """Lets the surface break where its normals say so."""

    name: ClassVar[str] = "discontinuities"
    summary: ClassVar[str] = "let the surface break at cliffs"

    def decide(self, facts: Facts) -> Use | Skip:
        """Do it where normals turn at once; see :meth:`Stage.decide`."""
        if facts.lamps or facts.turning is None:
            return Skip(reason="It was not looked for.")
        share = f"{facts.turning:.2%} of the steps"
        if facts.turning >= _MANY:
            return Use(reason="Normals turn at once between some pixels.", figure=share)
        return Skip(reason="Normals turn gradually.", figure=share)

    def asked(self, options: Options, facts: Facts) -> Use | Skip | None:
        """Follow a named integrator; see :meth:`Stage.asked`."""
        del facts
        if options.integrator == AUTO:
            return None
        if isinstance(options.integrator, Discontinuity):
            return Use(reason="Asked for.")
        return Skip(reason="Another integrator was asked for." if options.integrator else "There is no depth to find.")

    def whole(self, facts: Facts) -> Use | Skip:
        """Do it; see :meth:`Stage.whole`."""
        return (
            Skip(reason="Lamps near the surface have a method of their own.")
            if facts.lamps
            else Use(reason="Nothing was to be left out.")
        )

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Take the integrator that breaks; see :meth:`Stage.apply`."""
        now = options.integrator
        if not decision.use:
            if isinstance(now, Discontinuity):
                raise refuse(self, "it is left out, and depth is found by the integrator that does it.")
            return capture, options
        if not isinstance(now, Poisson | Discontinuity):
            raise refuse(self, "it is on, and depth is left out or found by another integrator.")
        same = now if isinstance(now, Discontinuity) else Discontinuity(threads=now.threads)
        return capture, replace(options, integrator=same)
