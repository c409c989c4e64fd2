"""What a plan will cost: seconds and memory, told from the survey and a short probe of the machine."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from psstereo.depth import Integrator
from psstereo.normals import NORMAL_SOLVERS, LeastSquares
from psstereo.plan.costs import COSTS, DEPTH, MESH, Cost
from psstereo.plan.facts import Facts
from psstereo.plan.options import Options
from psstereo.plan.probe import Speed, machine_speed

if TYPE_CHECKING:
    from psstereo.plan.plan import Plan

__all__ = ["Prediction", "predict"]

_TOGETHER = 0.8
"""Share of a thread that each further one adds: they share the memory [1]."""
_CONVERSION = 5e-9
"""Time to convert a value of an image into a sample [s]."""
_SURVEY = 1.3e-7
"""Time of the survey an observation of the sample, the trials aside [s]."""
_START = 0.02
"""Time to load what the survey needs [s]."""
_TRYING = 0.08
"""Time to load the solvers that are tried, more than each takes by itself [s]."""
_JUDGED = 4e-5
"""Time to compare one solver's normal of one pixel with the others' [s]."""
_ASSEMBLY = 9e-7
"""Time to put the answer together, a pixel [s]."""
_COMPILER = 0.25
"""Time to load the compiler, which compiled solvers and integration share [s]."""
_BASE = 150e6
"""Memory of the program and its libraries [byte]."""
_COMPILED = 75e6
"""Memory of the compiler, where compiled code is loaded [byte]."""
_IMAGE = 90.0
"""Memory of results, an image's pixel [byte]."""
_SURFACE = 420.0
"""Memory of integration and mesh, a pixel under the mask [byte]."""


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """Cost of a run.

    Attributes
    ----------
    read, survey, solve, depth, mesh : float
        Time of its parts [s].
    memory : float
        Largest memory of the process [byte].
    """

    read: float
    survey: float
    solve: float
    depth: float
    mesh: float
    memory: float

    @property
    def seconds(self) -> float:
        """Time of all parts together [s]."""
        return self.read + self.survey + self.solve + self.depth + self.mesh


def predict(plan: "Plan", options: Options, speed: Speed | None = None) -> Prediction | None:
    """Predict what running a plan costs.

    Parameters
    ----------
    plan : Plan
        A plan with a survey behind it.
    options : Options
        For methods that were handed over as objects, and the number of workers.
    speed : Speed, optional
        How fast the machine is; probed, and kept for the next time, if absent.

    Returns
    -------
    Prediction or None
        None where no sample was looked at, as under near lamps: how many rounds they take shows only when it is done.
    """
    facts = plan.facts
    if not facts.surveyed:
        return None
    fast = machine_speed() if speed is None else speed
    solver = options.solver.name if options.solver is not None else _solver(plan)
    threads = max(facts.workers, 1)
    share = 1.0 / (1.0 + _TOGETHER * (threads - 1))
    values = float(facts.images * facts.height * facts.width * facts.channels)
    mesh = _of(MESH, facts.pixels, fast.integrating) if plan["mesh"].use else 0.0
    return Prediction(
        read=((facts.decode_seconds or 0.0) * facts.images + _CONVERSION * fast.solving * values) * share,
        survey=fast.solving * (_START + _SURVEY * facts.surveyed * facts.images + _trials(facts)),
        solve=_solving(facts, solver, _pupils(facts, options, solver), share, fast),
        depth=_depth(plan, options, solver, fast) if plan["depth"].use else 0.0,
        mesh=mesh,
        memory=_memory(facts, plan, solver),
    )


def _trials(facts: Facts) -> float:
    """Return the time of all trials, with what is loaded for them."""
    if not facts.trials:
        return 0.0
    found = _TRYING + max(_loaded(facts).values(), default=0.0)
    for one in facts.trials:
        cost = COSTS[one.solver]
        fast = _compiled(facts, one.solver)
        each = cost.compiled if fast else cost.readable
        taught = (cost.learning if fast else cost.readable) if cost.learning else 0.0
        found += one.pixels * (facts.images * (2 * each + taught) + _JUDGED)
    return found


def _loaded(facts: Facts) -> dict[str, float]:
    """Return the solvers whose compiled code is loaded for their trials, and what that takes [s]."""
    return {one.solver: COSTS[one.solver].load for one in facts.trials if _compiled(facts, one.solver)}


def _solver(plan: "Plan") -> str:
    for stage in ("non-Lambertian solving", "robust solving", "ambient solving"):
        if plan[stage].use:
            return str(plan[stage].options["solver"])
    return LeastSquares.name


def _integrator(plan: "Plan", options: Options) -> str:
    named = options.integrator.name if isinstance(options.integrator, Integrator) else "poisson"
    found = "discontinuity" if plan["discontinuities"].use else named
    return found if found in DEPTH else "poisson"


def _depth(plan: "Plan", options: Options, solver: str, speed: Speed) -> float:
    facts, cost = plan.facts, DEPTH[_integrator(plan, options)]
    found = _of(cost, facts.pixels, speed.integrating)
    shared = _compiled(facts, solver) and facts.pixels >= cost.break_even
    return found - speed.integrating * _COMPILER * shared


def _compiled(facts: Facts, solver: str) -> bool:
    """Return whether the solver's loops are compiled."""
    return facts.pixels * facts.images >= COSTS.get(solver, COSTS["robust"]).break_even


def _of(cost: Cost, work: float, speed: float) -> float:
    compiled = work >= cost.break_even
    return speed * ((cost.compiled if compiled else cost.readable) * work + (cost.load if compiled else cost.start))


def _pupils(facts: Facts, options: Options, solver: str) -> int:
    """Return the number of pixels that the solver learns from before it solves."""
    method = options.solver if options.solver is not None else NORMAL_SOLVERS[solver]()
    return min(method.learns_from, facts.pixels)


def _solving(facts: Facts, solver: str, pupils: int, share: float, speed: Speed) -> float:
    cost = COSTS.get(solver, COSTS["robust"])
    values = facts.images * (facts.channels if facts.kept_apart else 1)
    compiled = _compiled(facts, solver)
    each = cost.compiled if compiled else cost.readable
    start = cost.load if compiled else cost.start
    learning = cost.learning if compiled else cost.readable
    return speed.solving * (
        (each * values + _ASSEMBLY) * facts.pixels * share
        + learning * values * pupils
        + (0.0 if solver in _loaded(facts) else start)
    )


def _memory(facts: Facts, plan: "Plan", solver: str) -> float:
    kept = facts.sample_bytes if facts.in_memory else (facts.memory_limit or 0)
    compiled = _compiled(facts, solver)
    surface = _SURFACE * facts.pixels if plan["depth"].use else 0.0
    frames = facts.workers * facts.height * facts.width * facts.channels * (facts.bits / 8 + 8)
    solving = _IMAGE * facts.height * facts.width
    return _BASE + _COMPILED * compiled + kept + frames + max(solving, surface)
