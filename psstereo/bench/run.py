"""Measuring: methods side by side on the same problem, in turn, so that a drifting machine hits all of them alike."""

import math
import statistics
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any

from psstereo.bench.environment import peak_memory
from psstereo.bench.problem import Problem
from psstereo.bench.record import Record
from psstereo.capture import Capture, Truth
from psstereo.errors import InputError, PsstereoError, RigError, UnsupportedError
from psstereo.metrics import summarise_angles
from psstereo.normals import NormalSolver, estimate_normals
from psstereo.results import NormalsResult
from psstereo.types import Map, Progress, no_progress

__all__ = ["DECLINES", "Summary", "run_solvers", "run_timed", "summarise", "why_declined"]

DECLINES = (RigError, UnsupportedError)
"""Errors by which a method says that a problem is not for it; all others end the run."""

_ERRORS = ("mean_deg", "median_deg", "rmse_deg", "p95_deg", "max_deg", "coverage")


def run_solvers(
    suite: str,
    problems: Iterable[Problem],
    methods: Mapping[str, NormalSolver[Any]],
    *,
    repeats: int = 3,
    warm_up: bool = True,
    over: Map = map,
    progress: Progress = no_progress,
) -> list[Record]:
    """Run every method on every problem.

    Parameters
    ----------
    suite : str
        Name of the suite, for the records.
    problems : iterable of Problem
        What is solved.
    methods : mapping
        Solvers by name.
    repeats : int
        Rounds; in each round every method has one turn.
    warm_up : bool
        Whether a round that does not count goes before the first. Without it the first method to load or compile
        something pays for all.
    over : map-like
        Executes the work.
    progress : callable
        Told how far it is.

    Returns
    -------
    list of Record
        One a problem, method and round; a single one of a method that declined the problem.
    """
    records = []
    chosen = list(problems)
    first = -1 if warm_up else 0
    total, done = len(chosen) * (repeats - first) * len(methods), 0
    for problem in chosen:
        capture, truth = problem.make()
        m, h, w, _ = capture.stack.shape
        sizes = {"lights": m, "width": w, "height": h, "pixels": int(capture.effective_mask.sum())}
        note = partial(Record, suite=suite, problem=problem.name, sizes=sizes)
        remaining = dict(methods)
        for repeat in range(first, repeats):
            for name, solver in methods.items():
                done += 1
                if name in remaining:
                    started = time.perf_counter()
                    try:
                        result = estimate_normals(capture, solver, over=over)
                    except DECLINES as refusal:
                        del remaining[name]
                        records.append(note(method=name, repeat=0, seconds={}, declined=why_declined(refusal)))
                        continue
                    seconds = {**result.seconds, "total": time.perf_counter() - started}
                    if repeat >= 0:
                        error = _angles_off(result, capture, truth)
                        records.append(
                            note(method=name, repeat=repeat, seconds=seconds, error=error, memory=peak_memory())
                        )
                progress(f"suite {suite}", done, total)
    return records


def _angles_off(result: NormalsResult, capture: Capture, truth: Truth) -> dict[str, float]:
    if truth.normals is None:
        return {}
    angles = asdict(summarise_angles(result.normals, truth.normals, capture.mask))
    return {key: float(angles[key]) for key in _ERRORS if math.isfinite(angles[key])}


def why_declined(refusal: PsstereoError) -> str:
    """Return a refusal in one line: what was given, and what the method needs.

    Parameters
    ----------
    refusal : PsstereoError
        What the method raised.
    """
    return f"{refusal.given} {refusal.needed}"


def run_timed(
    suite: str,
    problem: str,
    methods: Mapping[str, Callable[[], object]],
    *,
    repeats: int,
    sizes: Mapping[str, float],
    score: Callable[[Any], Mapping[str, float]] = lambda _answer: {},
    progress: Progress = no_progress,
) -> list[Record]:
    """Time any pieces of work in turn.

    Parameters
    ----------
    suite, problem : str
        Names for the records.
    methods : mapping
        Pieces of work by name, called without arguments.
    repeats : int
        Rounds that count; one more goes before them.
    sizes : mapping
        What the time depends on.
    score : callable
        Takes what a piece of work returns and gives its errors by name; its time does not count.
    progress : callable
        Told how far it is.

    Returns
    -------
    list of Record
        One a method and round; a single one of a method that declined.
    """
    records = []
    remaining = dict(methods)
    note = partial(Record, suite=suite, problem=problem, sizes=sizes)
    for repeat in range(-1, repeats):
        for i, (name, work) in enumerate(methods.items(), start=1):
            if name in remaining:
                started = time.perf_counter()
                try:
                    answer = work()
                except DECLINES as refusal:
                    del remaining[name]
                    records.append(note(method=name, repeat=0, seconds={}, declined=why_declined(refusal)))
                    continue
                seconds = {"total": time.perf_counter() - started}
                error = score(answer) if repeat >= 0 else {}
                del answer  # the next piece of work must not share the machine's memory with it
                if repeat >= 0:
                    records.append(note(method=name, repeat=repeat, seconds=seconds, error=error, memory=peak_memory()))
            progress(f"suite {suite}", (repeat + 1) * len(methods) + i, (repeats + 1) * len(methods))
    return records


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Medians over the rounds of one method on one problem; or that it declined.

    Attributes
    ----------
    problem, method : str
        What was measured.
    seconds : float
        Median total time; NaN if it declined [s].
    ratio : float
        Median over the rounds of its time over the baseline's in the same round; NaN if either declined [1].
    error : mapping
        Median figures of the error.
    spread : float
        Distance between the quartiles of the total time, or between both values of two; 0 for one round [s].
    sizes : mapping
        What time or error depends on.
    declined : str or None
        Why it refused the problem.
    """

    problem: str
    method: str
    seconds: float
    ratio: float
    error: Mapping[str, float]
    spread: float = 0.0
    sizes: Mapping[str, float] = field(default_factory=dict)
    declined: str | None = None


def summarise(records: Sequence[Record], baseline: str | None) -> list[Summary]:
    """Take medians, and ratios to a baseline round by round.

    Parameters
    ----------
    records : sequence of Record
        Of one run.
    baseline : str or None
        Method to which times are put in relation; None for the first of each problem.

    Returns
    -------
    list of Summary
        In the order of the records.

    Raises
    ------
    InputError
        If a round lacks the baseline.
    """
    first: dict[str, str] = {}
    for record in records:
        first.setdefault(record.problem, record.method if baseline is None else baseline)
    base = {(r.problem, r.repeat): r for r in records if r.method == first[r.problem]}
    unasked = {problem for (problem, _), record in base.items() if record.declined is not None}
    groups: dict[tuple[str, str], list[Record]] = {}
    for record in records:
        known = (record.problem, record.repeat) in base or record.problem in unasked or record.declined is not None
        if not known:
            raise InputError(
                given=f"Round {record.repeat} of the problem {record.problem!r} has no record of {baseline!r}.",
                needed="Ratios need the baseline in each round.",
                remedy="Measure it too, or choose another baseline.",
            )
        groups.setdefault((record.problem, record.method), []).append(record)
    return [_summary(group, {} if problem in unasked else base) for (problem, _), group in groups.items()]


def _summary(group: Sequence[Record], base: Mapping[tuple[str, int], Record]) -> Summary:
    one = group[0]
    make = partial(Summary, problem=one.problem, method=one.method, sizes=one.sizes)
    if one.declined is not None:
        return make(seconds=math.nan, ratio=math.nan, error={}, declined=one.declined)
    times = [r.seconds["total"] for r in group]
    ratios = [t / base[r.problem, r.repeat].seconds["total"] for t, r in zip(times, group, strict=True) if base]
    return make(
        seconds=statistics.median(times),
        ratio=statistics.median(ratios) if ratios else math.nan,
        error={key: statistics.median(r.error[key] for r in group if key in r.error) for key in one.error},
        spread=_between_quartiles(times),
    )


def _between_quartiles(times: Sequence[float]) -> float:
    if len(times) < 3:
        return max(times) - min(times)
    lower, _, upper = statistics.quantiles(times, n=4, method="inclusive")
    return upper - lower
