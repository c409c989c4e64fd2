"""What the three stages that choose a solver share: at most one of them is done, and plain least squares if none is."""

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, ClassVar

from psstereo.capture import Capture
from psstereo.method_options import configure, settings_of
from psstereo.normals import NORMAL_SOLVERS, LeastSquares, NormalSolver
from psstereo.plan.choice import Choice, choose_by_facts, choose_whole
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.stage import Decision, Skip, Stage, Use, refuse

__all__ = ["ModelStage", "read_settings", "written_settings"]


def written_settings(method: Any) -> dict[str, Any]:
    """Return those options of a method that are not at their defaults, the gate aside, as words or plain numbers."""
    usual = settings_of(type(method)())
    own = {key: value for key, value in settings_of(method).items() if key not in ("gate", "threads")}
    return {
        key: value if isinstance(value, bool | int | str) else str(value)
        for key, value in own.items()
        if value != usual[key]
    }


def read_settings(stage: Stage, kind: Any, options: Mapping[str, Any]) -> Any:
    """Build a method from its options in a plan.

    Raises
    ------
    InputError, OptionError
        If an option is unknown or has a wrong value.
    """
    reserved = {"gate", "threads"} & set(options)
    if reserved:
        raise refuse(stage, f"it sets {reserved.pop()!r}, which has a place of its own.")
    words = {key: str(value) if not isinstance(value, bool) else str(value).lower() for key, value in options.items()}
    return configure(kind, words)


class ModelStage(Stage):
    """A stage that replaces least squares by another solver.

    Attributes
    ----------
    solvers : tuple of str
        Names of the solvers that it may choose.
    """

    solvers: ClassVar[tuple[str, ...]]
    needless: ClassVar[str]
    """Why it is left out where nothing speaks for it, as a sentence."""
    keys: ClassVar[tuple[str, ...]] = ("solver", "settings")

    def decide(self, facts: Facts) -> Use | Skip:
        """Do it if the best solver is one of this stage's; see :meth:`Stage.decide`."""
        return self._follow(choose_by_facts(facts), facts)

    def whole(self, facts: Facts) -> Use | Skip:
        """Do it if the richest of the solvers that agree is one of this stage's; see :meth:`Stage.whole`."""
        return self._follow(choose_whole(facts), facts)

    def _follow(self, choice: Choice, facts: Facts) -> Use | Skip:
        if facts.lamps:
            return Skip(reason="Lamps near the surface have a method of their own.")
        if choice.solver in self.solvers:
            return Use(reason=choice.reason, figure=choice.figure, options={"solver": choice.solver})
        if choice.solver != LeastSquares.name:
            return Skip(reason=f"The solver {choice.solver} is taken instead.", figure=self.figure(facts))
        return Skip(reason=self.needless, figure=self.figure(facts))

    def figure(self, facts: Facts) -> str:
        """Return what the stage's own trial says."""
        tried = [one for one in facts.trials if one.solver in self.solvers]
        return ", ".join(f"{one.solver} {one.doubt_deg:.2g}°" for one in tried)

    def asked(self, options: Options, facts: Facts) -> Use | Skip | None:
        """Return what a named solver means for this stage; see :meth:`Stage.asked`."""
        del facts
        if options.solver is None:
            return None
        if options.solver.name not in self.solvers:
            return Skip(reason=f"The solver {options.solver.name} was asked for.")
        settings = written_settings(options.solver)
        more = {"settings": settings} if settings else {}
        return Use(reason="Asked for.", options={"solver": options.solver.name, **more})

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Set the solver; see :meth:`Stage.apply`."""
        if not decision.use:
            return capture, options if options.solver is not None else replace(options, solver=self._plain(options))
        name = decision.options.get("solver")
        if name not in self.solvers:
            raise refuse(self, f"its solver is {name!r}.", f"Use {', '.join(self.solvers)}.")
        if options.solver is not None and not isinstance(options.solver, LeastSquares):
            raise refuse(self, f"it is on, and {options.solver.name} as well.", "Leave all but one of them out.")
        settings = decision.options.get("settings", {})
        if not isinstance(settings, Mapping):
            raise refuse(self, f"its settings are {settings!r}.", "Use an object of options by name.")
        solver: NormalSolver[Any] = read_settings(self, NORMAL_SOLVERS[name], settings)
        return capture, replace(options, solver=_gated(solver, options))

    @staticmethod
    def _plain(options: Options) -> NormalSolver[Any]:
        return _gated(LeastSquares(), options)


def _gated(solver: NormalSolver[Any], options: Options) -> NormalSolver[Any]:
    known = {entry.name for entry in fields(solver)}
    return replace(solver, gate=options.gate) if options.gate is not None and "gate" in known else solver
