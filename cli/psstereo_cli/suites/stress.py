"""Suite stress: cruel cases with bounds fixed beforehand; passed only if right, or if the trouble is told."""

from typing import TYPE_CHECKING, Any

from psstereo_cli.suites.size import dimensions

if TYPE_CHECKING:
    from psstereo.bench import Record
    from psstereo.bench.stress import Verdict
    from psstereo.types import Map, Progress

__all__ = ["stress"]


def stress(
    repeats: int, size: str | None, lights: int, threads: int, over: "Map", progress: "Progress"
) -> tuple[list["Record"], str, dict[str, Any]]:
    """Run every case once, in double and single precision; with a size, one grid of that size and nothing else."""
    del repeats, lights, threads, over
    from psstereo.bench.stress import run_stress
    from psstereo_synth.stress import grid_case, stress_cases

    cases = stress_cases() if size is None else [grid_case(*dimensions(size))]
    verdicts = run_stress(cases, progress=progress)
    records = [one.record("stress") for one in verdicts]
    facts = {"verdicts": [_plain(one) for one in verdicts], "notes": _notes(verdicts), "table": _table(verdicts)}
    return records, "float64", facts


def _plain(one: "Verdict") -> dict[str, Any]:
    """Return a verdict as plain values, for JSON."""
    import math

    case = one.case
    return {
        "family": case.family,
        "name": case.name,
        "parameter": case.parameter,
        "kind": one.kind,
        "rule": case.rule.value,
        "unit": case.unit,
        "passed": one.passed,
        "bound": one.bound if math.isfinite(one.bound) else None,
        "measured": one.measured if math.isfinite(one.measured) else None,
        "told": one.told,
        "why": one.why,
        "seconds": one.seconds,
        "slow": one.slow,
    }


def _notes(verdicts: list["Verdict"]) -> list[str]:
    """Return the count, and every failure with its reason."""
    passed = sum(one.passed is True for one in verdicts)
    failed = [one for one in verdicts if one.passed is False]
    out = sum(one.passed is None for one in verdicts)
    slow = sum(one.slow for one in verdicts)
    first = (
        f"{len(verdicts)} runs: {passed} passed, {len(failed)} failed, {out} left out, {slow} beyond their time limit."
    )
    return [
        first,
        *(f"FAIL {one.case.family}: {one.case.name}, {one.case.parameter}, {one.kind}: {one.why}." for one in failed),
    ]


def _table(verdicts: list["Verdict"]) -> dict[str, Any]:
    """Return what is printed: a row a case, with the bound and what was measured in either precision."""
    by_case: dict[int, list[Verdict]] = {}
    for one in verdicts:
        by_case.setdefault(id(one.case), []).append(one)
    columns = ("case", "parameter", "bound 64", "measured 64", "bound 32", "measured 32", "told", "verdict", "time")
    return {
        "title": "each within its bound, or told; single precision beside double",
        "rows": [_row(group) for group in by_case.values()],
        "columns": columns,
    }


def _row(group: list["Verdict"]) -> tuple[str, ...]:
    case, found = group[0].case, {one.kind: one for one in group}
    figures = []
    for kind in ("float64", "float32"):
        one = found.get(kind)
        figures += ["", ""] if one is None else [_figure(one.bound, case.unit), _figure(one.measured, case.unit)]
    told = next((one.told for one in group if one.told), "")
    words = {True: "pass", False: "FAIL", None: "left out"}
    verdicts = {words[one.passed] for one in group}
    verdict = "FAIL" if "FAIL" in verdicts else "/".join(sorted(verdicts))
    slow = " (slow)" if any(one.slow for one in group) else ""
    seconds = f"{sum(one.seconds for one in group):.2f} s"
    return f"{case.family}: {case.name}", case.parameter, *figures, told[:60], verdict + slow, seconds


def _figure(value: float, unit: str) -> str:
    if value != value:  # noqa: PLR0124 not a number: no value stands
        return "–"
    return f"{value:.2g}" if unit == "1" else f"{value:.2g} {unit}"
