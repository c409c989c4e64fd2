"""Measuring: methods side by side on the same problem, in turn, so that a drifting machine hits all of them alike."""

import statistics
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from psstereo.bench.environment import peak_memory
from psstereo.bench.problem import Problem
from psstereo.bench.record import Record
from psstereo.errors import InputError
from psstereo.metrics import summarise_angles
from psstereo.normals import NormalSolver, estimate_normals
from psstereo.types import Map, Progress, no_progress

__all__ = ["Summary", "run_solvers", "run_timed", "summarise"]

_ERRORS = ("mean_deg", "median_deg", "rmse_deg", "p95_deg", "max_deg", "coverage")


def run_solvers(
    suite: str,
    problems: Iterable[Problem],
    methods: Mapping[str, NormalSolver[Any]],
    *,
    repeats: int = 3,
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
        Rounds; in each round every method has one turn. The first is preceded by one that does not count.
    over : map-like
        Executes the work.
    progress : callable
        Told how far it is.

    Returns
    -------
    list of Record
        One a problem, method and round.
    """
    records = []
    chosen = list(problems)
    total, done = len(chosen) * (repeats + 1) * len(methods), 0
    for problem in chosen:
        capture, truth = problem.make()
        for repeat in range(-1, repeats):
            for name, solver in methods.items():
                started = time.perf_counter()
                result = estimate_normals(capture, solver, over=over)
                seconds = {**result.seconds, "total": time.perf_counter() - started}
                done += 1
                progress(f"suite {suite}", done, total)
                if repeat < 0:
                    continue
                error: dict[str, float] = {}
                if truth.normals is not None:
                    angles = asdict(summarise_angles(result.normals, truth.normals, capture.mask))
                    error = {key: float(angles[key]) for key in _ERRORS}
                m, h, w, _ = capture.stack.shape
                sizes = {"lights": m, "width": w, "height": h, "pixels": int(result.facts["pixels"])}
                records.append(
                    Record(
                        suite=suite,
                        problem=problem.name,
                        method=name,
                        repeat=repeat,
                        seconds=seconds,
                        error=error,
                        sizes=sizes,
                        memory=peak_memory(),
                    )
                )
    return records


def run_timed(
    suite: str,
    problem: str,
    methods: Mapping[str, Callable[[], object]],
    *,
    repeats: int,
    sizes: Mapping[str, int],
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
        One a method and round.
    """
    records = []
    for repeat in range(-1, repeats):
        for i, (name, work) in enumerate(methods.items(), start=1):
            started = time.perf_counter()
            answer = work()
            seconds = time.perf_counter() - started
            error = score(answer) if repeat >= 0 else {}
            del answer  # the next piece of work must not share the machine's memory with it
            progress(f"suite {suite}", (repeat + 1) * len(methods) + i, (repeats + 1) * len(methods))
            if repeat >= 0:
                records.append(
                    Record(
                        suite=suite,
                        problem=problem,
                        method=name,
                        repeat=repeat,
                        seconds={"total": seconds},
                        error=error,
                        sizes=sizes,
                        memory=peak_memory(),
                    )
                )
    return records


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Medians over the rounds of one method on one problem.

    Attributes
    ----------
    problem, method : str
        What was measured.
    seconds : float
        Median total time [s].
    ratio : float
        Median over the rounds of its time over the baseline's in the same round [1].
    error : mapping
        Median figures of the error.
    """

    problem: str
    method: str
    seconds: float
    ratio: float
    error: Mapping[str, float]


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
    base = {(r.problem, r.repeat): r.seconds["total"] for r in records if r.method == first[r.problem]}
    groups: dict[tuple[str, str], list[Record]] = {}
    for record in records:
        if (record.problem, record.repeat) not in base:
            raise InputError(
                given=f"Round {record.repeat} of the problem {record.problem!r} has no record of {baseline!r}.",
                needed="Ratios need the baseline in each round.",
                remedy="Measure it too, or choose another baseline.",
            )
        groups.setdefault((record.problem, record.method), []).append(record)
    return [
        Summary(
            problem=problem,
            method=method,
            seconds=statistics.median(r.seconds["total"] for r in group),
            ratio=statistics.median(r.seconds["total"] / base[problem, r.repeat] for r in group),
            error={key: statistics.median(r.error[key] for r in group) for key in group[0].error},
        )
        for (problem, method), group in groups.items()
    ]
