"""Compiled code for the solver's loops."""

from typing import ClassVar

from psstereo.capture import Capture
from psstereo.near import wants_near
from psstereo.plan.choice import choose_by_facts, choose_whole
from psstereo.plan.costs import COSTS
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.stage import Decision, Skip, Stage, Use, refuse
from psstereo.stack import PixelSet

__all__ = ["CompiledKernels"]


class CompiledKernels(Stage):
    """Loads compiled code where there is enough to do; this follows from the work and cannot be set."""

    name: ClassVar[str] = "compiled kernels"
    summary: ClassVar[str] = "load compiled loops, where there is enough work for them"

    def decide(self, facts: Facts) -> Use | Skip:
        """Do it where the work is more than loading; see :meth:`Stage.decide`."""
        return self._by_work(choose_by_facts(facts).solver, facts)

    def asked(self, options: Options, facts: Facts) -> Use | Skip | None:
        """Decide for a named solver; see :meth:`Stage.asked`."""
        return None if options.solver is None else self._by_work(options.solver.name, facts)

    def whole(self, facts: Facts) -> Use | Skip:
        """Do it where the work of the solver that is taken then is more than loading; see :meth:`Stage.whole`."""
        return self._by_work(choose_whole(facts).solver, facts)

    @staticmethod
    def _by_work(solver: str, facts: Facts) -> Use | Skip:
        work = facts.pixels * facts.images
        if facts.lamps or solver not in COSTS:
            return Skip(reason="The method decides by itself.", figure=f"{work:.2g} samples")
        limit, figure = COSTS[solver].break_even, f"{work:.2g} samples"
        if limit == float("inf"):
            return Skip(reason=f"The solver {solver} needs none.", figure=figure)
        if work >= limit:
            return Use(reason=f"They pay from {limit:.2g} samples on.", figure=figure)
        return Skip(reason=f"They pay from {limit:.2g} samples on.", figure=figure)

    def apply(self, decision: Decision, capture: Capture, options: Options) -> tuple[Capture, Options]:
        """Require what follows from the work; see :meth:`Stage.apply`."""
        cost = None if options.solver is None else COSTS.get(options.solver.name)
        if cost is None or wants_near(capture):  # under lamps the method decides by itself
            return capture, options
        work = len(PixelSet.from_mask(capture.effective_mask)) * len(capture.stack)
        if decision.use is not (work >= cost.break_even):
            raise refuse(self, f"it is {'on' if decision.use else 'left out'}, against what {work:.2g} samples need.")
        return capture, options
