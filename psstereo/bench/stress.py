"""Cruel cases with a pass rule that is fixed beforehand: right within a bound, or the trouble is told; never silent.

A case says what it does, which bound holds a priori, and which flags or errors count as having told the trouble. The
judge knows nothing else of it, so that a case cannot excuse itself after the fact.
"""

import time
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from importlib.util import find_spec

import numpy as np
import numpy.typing as npt

from psstereo.bench.environment import peak_memory
from psstereo.bench.record import Record
from psstereo.errors import PsstereoError
from psstereo.flags import FATAL, Flag, fatal_mask
from psstereo.types import BoolArray, FlagArray, FloatArray, Progress, no_progress

__all__ = ["BOTH", "DOUBLE", "Answer", "Rule", "StressCase", "Verdict", "judge", "run_case", "run_stress"]

DOUBLE = ("float64",)
"""Kinds of a case that has nothing to do with single precision."""
BOTH = ("float64", "float32")
"""Kinds of a case whose data may be of either precision."""

_BARS = 6.0
"""Error bars that an error may have where a case accepts the answer's own error bar as having told it [1]."""


_NO_FLAG = Flag(0)


class Rule(Enum):
    """When a case passes."""

    WITHIN = "every value stands, within its bound"
    TOLD = "every value is within its bound, or carries a flag, or the whole was refused"
    FLAGGED = "no value stands, and each carries the flag"
    REFUSED = "the whole was refused"


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """What a case found, value by value.

    Attributes
    ----------
    error : float array (n,)
        Deviation from the truth; NaN where the answer is not a finite number [case's unit].
    bound : float array (n,)
        What it may be at most, from the input alone; a single number serves all [case's unit].
    flags : uint16 array (n,), optional
        Flags of the values.
    bar : float array (n,), optional
        Standard errors that the answer itself gives to the values, where the case lets these tell [case's unit].
    words : str
        What else is worth knowing, such as a published figure.
    """

    error: FloatArray
    bound: npt.ArrayLike
    flags: FlagArray | None = None
    bar: FloatArray | None = None
    words: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class StressCase:
    """A case and its rule.

    Attributes
    ----------
    family, name, parameter : str
        What it is about; together they are unique.
    run : callable
        Takes ``"float64"`` or ``"float32"``, the type of the data, and returns the `Answer`; the same every time.
    rule : Rule
        When it passes.
    unit : str
        Of errors and bounds.
    refusals : tuple of types
        Errors that are the right ones to refuse with; without any, a refusal is a failure.
    remarks : Flag
        Flags that tell the trouble on a value that stands; flags that go with NaN always do.
    demanded : Flag
        The flag that the rule ``FLAGGED`` asks for.
    kinds : tuple of str
        Types of data to run.
    limit : float
        Time from which it counts as slow, a generous multiple of what it takes. A case that never ends is not
        interrupted [s].
    needs : str
        Package without which the case is left out.
    large : bool
        Whether it takes gigabytes or minutes, and runs only when asked for.
    """

    family: str
    name: str
    parameter: str
    run: Callable[[str], Answer]
    rule: Rule = Rule.WITHIN
    unit: str = "1"
    refusals: tuple[type[PsstereoError], ...] = ()
    remarks: Flag = _NO_FLAG
    demanded: Flag = _NO_FLAG
    kinds: tuple[str, ...] = BOTH
    limit: float = 5.0
    needs: str = ""
    large: bool = False


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What became of a case with one type of data.

    Attributes
    ----------
    case : StressCase
        The case.
    kind : str
        Type of data.
    passed : bool or None
        None if it was left out.
    bound, measured : float
        Of the value that is worst beside its bound; NaN if none stands [case's unit].
    told : str
        Flags or error by which trouble was told, as words.
    why : str
        Why it failed or was left out, as words.
    seconds : float
        Wall-clock time [s].
    """

    case: StressCase
    kind: str
    passed: bool | None
    bound: float = float("nan")
    measured: float = float("nan")
    told: str = ""
    why: str = ""
    seconds: float = 0.0

    @property
    def slow(self) -> bool:
        """Whether it took longer than the case's limit."""
        return self.seconds > self.case.limit

    def record(self, suite: str) -> Record:
        """Return it as a record of the benchmark."""
        error = {"passed": float(self.passed is not False), "left_out": float(self.passed is None)}
        figures = {"bound": self.bound, "measured": self.measured}
        error |= {name: value for name, value in figures.items() if np.isfinite(value)}
        return Record(
            suite=suite,
            problem=f"{self.case.family}: {self.case.name}, {self.case.parameter}",
            method=self.kind,
            repeat=0,
            seconds={"total": self.seconds},
            error=error,
            memory=peak_memory(),
        )


def run_stress(cases: Iterable[StressCase], *, progress: Progress = no_progress) -> list[Verdict]:
    """Run cases with each of their types of data.

    Parameters
    ----------
    cases : iterable of StressCase
        The cases.
    progress : callable
        Told how far it is.

    Returns
    -------
    list of Verdict
        In the order of the cases.
    """
    jobs = [(case, kind) for case in cases for kind in case.kinds]
    verdicts = []
    for done, (case, kind) in enumerate(jobs, start=1):
        verdicts.append(run_case(case, kind))
        progress("suite stress", done, len(jobs))
    return verdicts


def run_case(case: StressCase, kind: str) -> Verdict:
    """Run a case with one type of data and judge it; nothing that the case raises gets out.

    Parameters
    ----------
    case : StressCase
        The case.
    kind : str
        One of its kinds.

    Returns
    -------
    Verdict
        Passed, failed or left out.
    """
    if case.needs and find_spec(case.needs) is None:
        return Verdict(case=case, kind=kind, passed=None, why=f"{case.needs} is not installed")
    started = time.perf_counter()
    told = why = ""
    answer: Answer | None = None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            answer = case.run(kind)
        except PsstereoError as error:
            told = f"{type(error).__name__}: {error.given}"
            expected = case.rule in {Rule.TOLD, Rule.REFUSED} and isinstance(error, case.refusals)
            why = "" if expected else "refused what it should not, or with another error than expected"
        except Exception as error:
            why = f"crashed with {type(error).__name__}: {error}"
    seconds = time.perf_counter() - started
    if not why and caught:
        why = f"warned: {caught[0].message}"
    if answer is None or why:
        return Verdict(case=case, kind=kind, passed=not why, told=told, why=why, seconds=seconds)
    return judge(case, kind, answer, seconds)


def judge(case: StressCase, kind: str, answer: Answer, seconds: float = 0.0) -> Verdict:
    """Hold an answer to the case's rule.

    Parameters
    ----------
    case : StressCase
        The case.
    kind : str
        Type of data that it ran with.
    answer : Answer
        What came out.
    seconds : float
        What it took [s].

    Returns
    -------
    Verdict
        Passed or failed, with the value that is worst beside its bound among those that told nothing.
    """
    error = np.atleast_1d(np.asarray(answer.error, np.float64)).ravel()
    bound = np.broadcast_to(np.asarray(answer.bound, np.float64), error.shape)
    flags = np.zeros(error.shape, np.uint16) if answer.flags is None else np.asarray(answer.flags).ravel()
    missing = ~np.isfinite(error)
    with np.errstate(invalid="ignore"):
        good = error <= bound
    told = _told(case, answer, error, missing, flags)
    why = _why(case, good, told, missing, flags)
    open_errors = ~good & ~missing & ~told
    at = _worst(error, bound, open_errors if open_errors.any() else (good if good.any() else ~missing))
    telling = flags[told & ~good] & (FATAL | np.uint16(case.remarks))
    words = [part for part in (answer.words, _names(telling), _count(told & ~good)) if part]
    return Verdict(
        case=case,
        kind=kind,
        passed=not why,
        bound=float(bound[at]) if at is not None else float("nan"),
        measured=float(error[at]) if at is not None else float("nan"),
        told="; ".join(words),
        why=why,
        seconds=seconds,
    )


def _told(case: StressCase, answer: Answer, error: FloatArray, missing: BoolArray, flags: FlagArray) -> BoolArray:
    """Return where an answer says itself that it is none, or how bad it is."""
    told = missing & fatal_mask(flags)
    told |= (flags & np.uint16(case.remarks)) != 0
    if answer.bar is not None:
        with np.errstate(invalid="ignore"):
            told |= ~missing & (error <= _BARS * np.asarray(answer.bar, np.float64).ravel())
    return np.asarray(told)


def _why(case: StressCase, good: BoolArray, told: BoolArray, missing: BoolArray, flags: FlagArray) -> str:
    """Return what breaks the rule, or nothing."""
    if len(good) == 0:
        return "no value came out"
    if case.rule is Rule.REFUSED:
        return "gave an answer where there is none"
    if case.rule is Rule.FLAGGED:
        fine = missing & ((flags & np.uint16(case.demanded)) != 0)
        return "" if fine.all() else f"{np.count_nonzero(~fine)} of {len(fine)} values stand, or lack the flag"
    fine = good if case.rule is Rule.WITHIN else good | told
    if fine.all():
        return ""
    silent = np.count_nonzero(missing & ~fine)
    wrong = np.count_nonzero(~fine) - silent
    return f"of {len(fine)} values {wrong} are wrong and {silent} missing, and nothing tells it"


def _worst(error: FloatArray, bound: FloatArray, among: BoolArray) -> int | None:
    """Return the index of the value that is largest beside its bound."""
    places = np.flatnonzero(among & np.isfinite(error))
    if len(places) == 0:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.nan_to_num(error[places] / bound[places], nan=0.0)
    return int(places[int(np.argmax(ratio))])


def _names(flags: FlagArray) -> str:
    """Return the names of all bits that are set somewhere."""
    found = int(np.bitwise_or.reduce(flags)) if len(flags) else 0
    return ", ".join(str(flag.name) for flag in Flag if found & flag)


def _count(told: BoolArray) -> str:
    share = np.count_nonzero(told) / len(told) if len(told) else 0.0
    return f"{100 * share:.3g} % told" if share else ""
