"""Which methods are worth their time: those that no other one beats in both error and time."""

from collections.abc import Sequence

from psstereo.bench.run import Summary

__all__ = ["ERRORS", "error_key", "pareto_front"]

ERRORS = {
    "mean_deg": ("mean angular error", "°"),
    "rmse": ("root-mean-square height error", "px"),
    "mean_height": ("mean height error over range", "1"),
    "mean": ("mean height error", "unit of the data"),
    "bad_percent": ("wrong matches", "%"),
}
"""Errors by their name in records, the one looked at first if there are several: what they are, and their unit."""


def error_key(summaries: Sequence[Summary]) -> str | None:
    """Return the error by which the methods of a problem are compared.

    Parameters
    ----------
    summaries : sequence of Summary
        Of one problem.

    Returns
    -------
    str or None
        The first of `ERRORS` that two methods have, or that one has if no error is shared; None without errors.
    """
    counts = {key: sum(key in s.error for s in summaries) for key in ERRORS}
    for least in (2, 1):
        for key, count in counts.items():
            if count >= least:
                return key
    return None


def pareto_front(summaries: Sequence[Summary], key: str) -> list[Summary]:
    """Return the methods that no other one beats in both error and time, fastest first.

    Parameters
    ----------
    summaries : sequence of Summary
        Of one problem.
    key : str
        The error that counts; methods without it are not judged.

    Returns
    -------
    list of Summary
        Errors fall strictly along it; of two methods equal in time the better one is there.
    """
    judged = sorted(
        (s for s in summaries if s.declined is None and key in s.error), key=lambda s: (s.seconds, s.error[key])
    )
    front: list[Summary] = []
    for one in judged:
        if not front or one.error[key] < front[-1].error[key]:
            front.append(one)
    return front
